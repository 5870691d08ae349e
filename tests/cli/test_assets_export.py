"""`artiskill assets export`."""

from pathlib import Path

import mujoco
import pytest

from artiskill.cli.main import main


def test_writes_where_it_says(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "box"
    assert main(["assets", "export", "cabinet-0001", "--format", "mjcf", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert str(out / "cabinet-0001.xml") in said
    assert mujoco.MjModel.from_xml_path(str(out / "cabinet-0001.xml")).nbody > 1


def test_the_folder_is_named_after_object_and_format(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["assets", "export", "generated:bucket:3", "--format", "urdf"]) == 0
    assert (tmp_path / "exported" / "generated-bucket-3-urdf" / "mobility.urdf").is_file()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["cabinet-0001", "--format", "usd"], "unknown format 'usd'"),
        (["cabinet-001", "--format", "mjcf"], "did you mean 'cabinet-0001'"),
        (["cabinet-0001"], "--format"),
        (["cabinet-0001", "--format", "mjcf", "--fource"], "did you mean '--force'"),
    ],
)
def test_one_line_says_what_is_wrong(
    arguments: list[str],
    said: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["assets", "export", *arguments]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_foreign_files_are_only_replaced_by_force(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    command = ["assets", "export", "cabinet-0001", "--format", "mjcf", "--out", str(tmp_path)]
    assert main(command) == 2
    assert "notes.txt" in capsys.readouterr().err
    assert main([*command, "--force"]) == 0
    assert not (tmp_path / "notes.txt").exists()
