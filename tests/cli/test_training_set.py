"""`artiskill training-set`."""

from pathlib import Path

import pytest
from tests.learning.training_files import write_files

from artiskill.cli.main import main


def test_a_set_and_its_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files, out = write_files(tmp_path / "files"), tmp_path / "set"
    command = ["training-set", str(files), "--out", str(out), "--points", "4"]
    assert main(command) == 0
    shown = capsys.readouterr()
    rows = [line.split() for line in shown.out.splitlines()]
    assert ["cabinet-0002", "link_0", "2", "5", "1"] in rows
    assert ["cabinet-0020", "link_1", "1", "5", "2"] in rows
    assert ["all", "4", "11", "3"] in rows
    assert "OpenCabinetDrawer, joint: 15 frames of 4 points (uniform, robot frame), 0.0 MB" in shown.out
    assert shown.out.splitlines()[-1] == f"training set: {out}"
    assert shown.err.startswith("writing: 1/5 trajectories")
    assert main(command) == 0
    assert capsys.readouterr().err == ""  # it was there


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--points", "5"], "the training files have 4 points each: choose at most so many, not 5"),
        (["--points", "0"], "the number of points must be at least 1, not 0"),
        (["--points", "4", "--frame", "world"], "has training files of frame robot, not 'world'"),
        (
            ["--points", "4", "--objects", "cabinet-0021"],
            "unknown object 'cabinet-0021'; did you mean 'cabinet-0020'",
        ),
        (["--points", "4", "--task", "PushChair"], "is of task OpenCabinetDrawer, not 'PushChair'"),
        (["--point", "4"], "unknown option '--point'; did you mean '--points'"),
    ],
)
def test_what_is_wrong_is_one_line(
    options: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = write_files(tmp_path / "files")
    assert main(["training-set", str(files), "--out", str(tmp_path / "set"), *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "set").exists()


def test_an_interruption_is_no_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*args: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("artiskill.learning.building.choose_trajectories", interrupt)
    files = write_files(tmp_path / "files")
    assert main(["training-set", str(files), "--out", str(tmp_path / "set"), "--points", "4"]) == 130
    assert capsys.readouterr().err == "interrupted; what was replayed is kept, the same command goes on\n"
    assert not (tmp_path / "set").exists()
