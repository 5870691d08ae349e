"""Files that appear whole or not at all."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.demos.hdf5 import new_large_file, new_whole_file
from artiskill.errors import DemoError

ROOM = 3_000_000


def fill(file: Any) -> None:
    values = np.random.default_rng(0).random((100, 500))
    for k in range(3):
        file.create_group(f"traj_{k}").create_dataset("xyz", data=values + k, chunks=(10, 500), compression="gzip")
    file.attrs["format"] = "some"


def test_a_large_file_has_its_place_on_the_disk_from_the_start(tmp_path: Path) -> None:
    """Others may fill the disk meanwhile."""
    with new_large_file(tmp_path / "large.h5", ROOM) as file:
        (part,) = tmp_path.iterdir()
        assert part.stat().st_blocks * 512 >= ROOM
        fill(file)
    assert os.listdir(tmp_path) == ["large.h5"]


def test_large_and_small_files_are_the_same_bytes(tmp_path: Path) -> None:
    with new_whole_file(tmp_path / "small.h5") as file:
        fill(file)
    for room in (ROOM, 1):  # too little is no error as long as the disk has more
        with new_large_file(tmp_path / "large.h5", room) as file:
            fill(file)
        assert (tmp_path / "large.h5").read_bytes() == (tmp_path / "small.h5").read_bytes()


@pytest.mark.parametrize("known", [True, False])
def test_a_full_disk_is_one_error_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, known: bool
) -> None:
    """Known beforehand, or filled by another process right then."""
    if known:
        room = 1 << 60
    else:
        room = ROOM

        def refuse(*place: int) -> None:
            raise OSError(28, os.strerror(28))

        monkeypatch.setattr("os.posix_fallocate", refuse)
    with (
        pytest.raises(DemoError, match=r"cannot write .*large.h5'.*No space left on device"),
        new_large_file(tmp_path / "large.h5", room) as file,
    ):
        fill(file)
    assert not os.listdir(tmp_path)
