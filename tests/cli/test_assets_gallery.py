"""`artiskill assets gallery`."""

from pathlib import Path

import pytest

from artiskill.cli.main import main


def test_makes_the_page_of_the_named_objects(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["assets", "gallery", "cabinet-0001", "--out", str(out), "--workers", "1"]) == 0
    assert str(out / "index.html") in capsys.readouterr().out
    assert "cabinet-0001" in (out / "objects.js").read_text()


def test_unknown_names_are_said_before_anything_is_written(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    assert main(["assets", "gallery", "cabinet-001", "--out", str(out)]) == 2
    assert "did you mean" in capsys.readouterr().err
    assert not out.exists()
