"""`artiskill assets check`: what it prints, what it writes, how it ends."""

import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from artiskill.checks.context import CheckResult, at_least, at_most, failed, fine
from artiskill.checks.runner import ObjectReport
from artiskill.cli.assets_check import print_to
from artiskill.cli.main import main


def named(check: str, result: CheckResult) -> CheckResult:
    return replace(result, check=check)


SOUND = (
    named("compiles", fine("object", "")),
    named("closed", at_most("object", 0.2, 1.0, "mm")),
    named("roll", at_least("way", 0.5, 0.1, "m")),
)


def text_of(reports: list[ObjectReport], width: int = 120) -> str:
    console = Console(width=width, record=True, file=io.StringIO())
    print_to(console, reports)
    return console.export_text()


def test_a_table_of_sound_objects() -> None:
    text = text_of([ObjectReport("chair-1", "chair", "generated", SOUND, 0.1)])
    assert "chairs" in text
    assert "0.20" in text
    assert "faults\n" not in text
    assert "all pass" in text
    assert "compiles" not in text  # nothing to say about it


def test_faults_are_listed_and_shortened() -> None:
    faults = tuple(named("sweep", at_most(f"link_{i}", 5.0 + i, 1.0, "mm", "wheel in [fork]")) for i in range(9))
    lean = named("roll", at_most("lean", 20.0, 10.0, "deg", "60 N"))
    report = ObjectReport(
        "chair-1", "chair", "generated", (*SOUND, *faults, lean, named("loads", failed("object", "x"))), 0.1
    )
    text = text_of([report])
    assert "13.0 !" in text
    assert "20.0 deg !" in text  # another unit than its column's
    assert "wheel in [fork]" in text  # no markup
    assert "and 6 more" in text
    assert "1 of 1 objects fail" in text


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out.json"
    arguments = ["assets", "check", "generated:cabinet:8", "--workers", "1"]
    assert main([*arguments, "--json", str(out)]) in (0, 1)
    assert json.loads(out.read_text(encoding="utf-8"))["objects"][0]["id"] == "generated-cabinet-8"
    assert main([*arguments, "--set", "categories.cabinet.mass_kg=[1, 2]"]) == 1
    assert "1 to 2 kg" in capsys.readouterr().out


def test_errors_name_what_is_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["assets", "check", "cabinet-1"]) == 2
    assert "cabinet-0001" in capsys.readouterr().err
    assert main(["assets", "chekc"]) == 2
    assert "check" in capsys.readouterr().err
    assert main(["assets", "check", "--worker", "2"]) == 2
    assert "--workers" in capsys.readouterr().err
    assert main(["assets", "check", "generated:cabinet:8", "--json", "/no/such/place.json"]) == 2
