from pathlib import Path

import pytest

from artiskill.jobs.whole_files import TEMPORARY_PREFIX, remove_leftovers, whole_file


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
