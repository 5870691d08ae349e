"""Many objects at once: reports in order, duplicates found, files written whole, loads that fail."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from artiskill.assets.catalog import list_objects
from artiskill.checks.config import default_checks_config, load_checks_config
from artiskill.checks.runner import check_objects, write_json
from artiskill.errors import ConfigError


def test_duplicates_are_found_and_others_pass(make: SimpleNamespace) -> None:
    one = make.cabinet()
    copy, wide = replace(one, id="copy"), make.cabinet("wide", width_m=0.8)
    reports = check_objects([one, copy, wide, make.chair()])
    duplicates = {report.id: [r for r in report.results if r.check == "duplicates"] for report in reports}
    assert duplicates["copy"][0].subject == one.id
    assert duplicates["copy"][0].value == pytest.approx(0, abs=1)
    assert not duplicates["copy"][0].passed
    assert duplicates["wide"][0].passed
    assert duplicates["chair"] == []  # alone in its category


def test_processes_change_nothing(make: SimpleNamespace) -> None:
    items = ["generated:8", make.cabinet(), make.bucket()]
    seen: list[str] = []
    alone = check_objects(items)
    together = check_objects(items, workers=2, on_done=lambda report: seen.append(report.id))
    assert [r.results for r in together] == [r.results for r in alone]
    assert sorted(seen) == sorted(r.id for r in alone)


def test_what_cannot_be_loaded_is_a_fault(make: SimpleNamespace) -> None:
    report, other = check_objects(["cabinet-9999", make.bucket()])
    assert [r.check for r in report.failures()] == ["loads"]
    assert "cabinet-9999" in report.failures()[0].note
    assert other.passed


def test_json(make: SimpleNamespace, tmp_path: Path) -> None:
    config = default_checks_config()
    reports = check_objects([make.cabinet()])
    write_json(reports, config, tmp_path / "out.json")
    data = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    assert data["passed"] is True
    assert data["objects"][0]["id"] == "drawer-cabinet"
    assert {"check", "subject", "value", "limit", "unit", "passed", "note"} == set(
        data["objects"][0]["results"][0]
    )
    assert data["config"]["penetration_m"] == config.penetration_m
    assert [path.name for path in tmp_path.iterdir()] == ["out.json"]
    with pytest.raises(ConfigError, match="cannot write"):
        write_json(reports, config, tmp_path / "missing" / "out.json")


def test_illegal_settings(make: SimpleNamespace) -> None:
    with pytest.raises(ConfigError, match="workers"):
        check_objects([make.bucket()], workers=0)
    with pytest.raises(ConfigError, match="penetration_m"):
        load_checks_config({"penetration_m": 0})
    with pytest.raises(ConfigError, match="unknown key"):
        load_checks_config({"settle.drift_mm": 1})


@pytest.mark.slow
def test_the_catalogue_passes() -> None:
    """Every object of the benchmark, all categories and splits."""
    reports = check_objects(list_objects(), workers=2)
    assert [(r.id, f.check, f.subject, f.note) for r in reports for f in r.failures()] == []
