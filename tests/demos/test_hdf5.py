"""Files that appear whole or not at all; strangers' files: nothing that leads elsewhere is followed."""

import json
import os
import shutil
import time
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import PACK, entry_of, read_manifest, sha256_of, write_manifest
from artiskill.demos.hdf5 import load_h5py, new_large_file, new_whole_file, open_file
from artiskill.demos.stats import folder_stats
from artiskill.demos.training_file import TrainingFile
from artiskill.demos.verify import verify
from artiskill.errors import ArtiSkillError, DemoError

ROOM = 3_000_000
h5py = load_h5py()
SECRET = 1234.5


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


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of demonstrations whose file is to be changed."""
    source = PACK / "OpenCabinetDrawer"
    name = next(iter(read_manifest(source).files))
    (tmp_path / "demos").mkdir()
    for file in (name, "manifest.json"):
        shutil.copy(source / file, tmp_path / "demos" / file)
    manifest = read_manifest(tmp_path / "demos")
    kept = {name: manifest.files[name]}
    write_manifest(type(manifest)(manifest.settings, kept), tmp_path / "demos")
    return tmp_path / "demos"


@pytest.fixture
def path(folder: Path) -> Path:
    return next(folder.glob("*.h5"))


@pytest.fixture
def secret(tmp_path: Path, path: Path) -> Path:
    """Somebody's private file, whose array would fit."""
    with h5py.File(path) as file:
        shape = file["traj_0/rewards"].shape
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["rewards"] = np.full(shape, SECRET)
    (tmp_path / "secret.raw").write_bytes(np.full(shape, SECRET).tobytes())
    return tmp_path / "secret.h5"


def external_link(group: Any, secret: Path) -> None:
    del group["rewards"]
    group["rewards"] = h5py.ExternalLink(str(secret), "/rewards")


def soft_link(group: Any, secret: Path) -> None:
    group.move("rewards", "others")
    group["rewards"] = h5py.SoftLink(f"{group.name}/others")


def external_raw_data(group: Any, secret: Path) -> None:
    shape = group["rewards"].shape
    del group["rewards"]
    group.create_dataset(
        "rewards", shape, "f8", external=[(str(secret.with_suffix(".raw")), 0, h5py.h5f.UNLIMITED)]
    )


def virtual_dataset(group: Any, secret: Path) -> None:
    shape = group["rewards"].shape
    del group["rewards"]
    layout = h5py.VirtualLayout(shape, "f8")
    layout[:] = h5py.VirtualSource(str(secret), "rewards", shape)
    group.create_virtual_dataset("rewards", layout)


def linked_trajectory(group: Any, secret: Path) -> None:
    group.file["traj_9"] = h5py.ExternalLink(str(secret), "/")


def group_in_itself(group: Any, secret: Path) -> None:
    group["inner"] = group


def named_type(group: Any, secret: Path) -> None:
    group["kind"] = np.dtype("f8")


def other_filter(group: Any, secret: Path) -> None:
    values = group["rewards"][()]
    del group["rewards"]
    group.create_dataset("rewards", data=values, compression="lzf")


def texts(group: Any, secret: Path) -> None:
    del group["rewards"]
    group["rewards"] = ["a", "b"]


def references(group: Any, secret: Path) -> None:
    group.attrs["to"] = group.ref


def nothing_written(group: Any, secret: Path) -> None:
    del group["rewards"]
    group.create_dataset("rewards", (1_500_000_000,), "f8")


def no_chunk_written(group: Any, secret: Path) -> None:
    del group["rewards"]
    group.create_dataset("rewards", (1_500_000_000,), "f8", chunks=(1000,), compression="gzip")


def large_chunk(group: Any, secret: Path) -> None:
    del group["rewards"]
    group.create_dataset("rewards", (10,), "f8", chunks=(400_000_000,), maxshape=(None,), compression="gzip")


def bomb(group: Any, secret: Path) -> None:
    """300 MB of zeros in 300 kB: as dense as deflate packs."""
    del group["rewards"]
    size = 300_000_000
    made = group.create_dataset("rewards", (size // 8,), "f8", chunks=(size // 8,), compression="gzip")
    packer = zlib.compressobj(9)
    packed = b"".join(packer.compress(bytes(1_000_000)) for _ in range(size // 1_000_000)) + packer.flush()
    made.id.write_direct_chunk((0,), packed)


CHANGES: dict[str, Callable[[Any, Path], None]] = {
    change.__name__: change
    for change in (
        external_link,
        soft_link,
        external_raw_data,
        virtual_dataset,
        linked_trajectory,
        group_in_itself,
        named_type,
        other_filter,
        texts,
        references,
        nothing_written,
        no_chunk_written,
        large_chunk,
        bomb,
    )
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_strange_content_is_refused_before_it_is_read(
    folder: Path, path: Path, secret: Path, change: Callable[[Any, Path], None]
) -> None:
    with h5py.File(path, "r+") as file:
        change(file["traj_0"], secret)
    start = time.process_time()
    with pytest.raises(DemoError, match="cannot read what it holds"):
        DemoFile(path)
    manifest = read_manifest(folder)  # a stranger's manifest fits his file
    (entry,) = manifest.files.values()
    entry = replace(entry, sha256=sha256_of(path), bytes=path.stat().st_size)
    write_manifest(manifest.with_file(path.name, entry), folder)
    with pytest.raises(DemoError, match="cannot read what it holds"):
        folder_stats(folder)
    (verdict,) = verify(folder)
    assert "cannot read what it holds" in verdict.faults[0]
    assert time.process_time() - start < 5


def test_training_files_follow_nothing_either(tmp_path: Path, secret: Path) -> None:
    with h5py.File(tmp_path / "training.h5", "w") as file:
        file.create_group("traj_0/obs")["state"] = h5py.ExternalLink(str(secret), "/rewards")
    with pytest.raises(DemoError, match="link to elsewhere"):
        TrainingFile(tmp_path / "training.h5")


def test_what_we_write_is_legal() -> None:
    for path in PACK.glob("*/*.h5"):
        with DemoFile(path) as file:
            assert entry_of(file).trajectories == len(file)


def test_files_that_are_none(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.h5")
    (tmp_path / "device.h5").symlink_to("/dev/zero")
    (tmp_path / "empty.h5").touch()
    for name in ("pipe.h5", "device.h5", "empty.h5", "nothing.h5", "a\0b", "x" * 300, "\ud800"):
        with pytest.raises(DemoError):
            open_file(tmp_path / name)
        with pytest.raises(DemoError):
            DemoFile(tmp_path / name)


@pytest.mark.parametrize("facts", [[], {}, {"name": 3}, {"name": None}])
def test_damaged_facts(path: Path, facts: object) -> None:
    with h5py.File(path, "r+") as file:
        file.attrs["facts"] = json.dumps(facts)
    with pytest.raises(DemoError, match="damaged"):
        DemoFile(path)


@pytest.mark.parametrize(
    "name", ["{}", "{}/object.zip", "./here/object", "partnet:{}", "partnet:../here", "x.zip"]
)
def test_a_file_does_not_choose_what_is_opened(
    path: Path, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its object's name is a stranger's: whatever is a path is for the user to name."""
    (tmp_path / "data").mkdir()
    monkeypatch.setenv("PARTNET_MOBILITY_DATASET", str(tmp_path / "data"))
    monkeypatch.setattr(
        "artiskill.assets.partnet.importer.import_partnet", lambda *_, **__: pytest.fail("it was opened")
    )
    with h5py.File(path, "r+") as file:
        facts = json.loads(file.attrs["facts"]) | {"name": name.format(tmp_path / "here")}
        file.attrs["facts"] = json.dumps(facts)
    with DemoFile(path) as file, pytest.raises(DemoError, match="cannot load its object"):
        file.load_object()


@pytest.mark.parametrize(
    "change", [{"robot": "here.yaml"}, {"robot": {"like": "here.yaml"}}, {"robot.like": "x.yaml"}]
)
def test_settings_open_no_file(path: Path, change: dict[str, Any]) -> None:
    with h5py.File(path, "r+") as file:
        settings = json.loads(file.attrs["settings"])
        settings["config"] |= change
        file.attrs["settings"] = json.dumps(settings)
    with pytest.raises(ArtiSkillError, match="must be resolved"):
        DemoFile(path)
