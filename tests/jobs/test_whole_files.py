import os
from pathlib import Path

import pytest

from artiskill.errors import ConfigError
from artiskill.jobs.whole_files import TEMPORARY_PREFIX, output_path, remove_leftovers, whole_file


def test_all_or_nothing(tmp_path: Path) -> None:
    path = tmp_path / "file.txt"
    path.write_text("old")
    with pytest.raises(UnicodeEncodeError), whole_file(path) as temporary:
        temporary.write_text("half \u00e4", encoding="ascii")
    assert path.read_text() == "old"
    with whole_file(path) as temporary:
        temporary.write_text("new")
        assert temporary.suffix == ".txt"
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_leftovers(tmp_path: Path) -> None:
    """Those of `whole_file` go; what anybody else calls alike stays."""
    with whole_file(tmp_path / "file.h5") as temporary:
        ours = temporary
    (tmp_path / "file.h5").rename(ours)  # as a killed process leaves it
    (tmp_path / f"{TEMPORARY_PREFIX}of-my-own.txt").touch()
    (tmp_path / "file.txt").touch()
    remove_leftovers(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{TEMPORARY_PREFIX}of-my-own.txt", "file.txt"]


def test_regular_files_only(tmp_path: Path) -> None:
    """What is no regular file stays what it is; links stand for devices, lest a fault here harm the machine."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "device").symlink_to("/dev/null")
    (tmp_path / "folder").mkdir()
    for name in ("pipe", "device", "folder"):
        kind = (tmp_path / name).lstat().st_mode
        with pytest.raises(OSError, match=r"regular file|directory"), whole_file(tmp_path / name):
            pytest.fail("it was opened")
        assert (tmp_path / name).lstat().st_mode == kind
    for name in ("pipe", "device"):
        with pytest.raises(ConfigError, match="not a regular file"):
            output_path(tmp_path / name)
    assert output_path(tmp_path / "folder") == tmp_path / "folder"
    for bad in ("a\0b", "x" * 300, "\ud800", None, 3):
        with pytest.raises(ConfigError):
            output_path(bad)  # type: ignore[arg-type]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["device", "folder", "pipe"]


@pytest.mark.parametrize("umask", [0o022, 0o077, 0o002])
def test_files_have_the_users_umask(tmp_path: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        (tmp_path / "usual").touch()
        with whole_file(tmp_path / "ours.PNG") as temporary:
            temporary.write_text("a")
    finally:
        os.umask(before)
    assert (tmp_path / "ours.PNG").stat().st_mode == (tmp_path / "usual").stat().st_mode
