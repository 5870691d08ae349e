import csv
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from artiskill.errors import ConfigError
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.report import REPORT_FILES, Report, check_output_folder, write_report


@pytest.fixture(scope="module")
def report() -> Report:
    return evaluate(
        "OpenCabinetDrawer", "random", ["cabinet-0005", "cabinet-0010"], 2, config={"episode_steps": 5}
    )


def read_csv(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_files_agree(report: Report, tmp_path: Path) -> None:
    folder = write_report(report, tmp_path / "new" / "folder")
    assert sorted(p.name for p in folder.iterdir()) == sorted(REPORT_FILES)
    data = json.loads((folder / "report.json").read_text())
    assert data == report.to_mapping()
    assert (data["levels"], data["interval"]) == ([0, 1], list(report.total.interval))
    assert yaml.safe_load((folder / "config.yaml").read_text()) == data["config"]
    assert data["config"]["episode_steps"] == 5
    rows = read_csv(folder / "report.csv")
    assert [row["object"] for row in rows] == ["cabinet-0005", "cabinet-0010"]
    for row, entry in zip(rows, data["objects"], strict=True):
        assert [float(row["interval_low"]), float(row["interval_high"])] == entry["interval"]
        assert float(row["mean_length"]) == entry["mean_length"] == 5.0
        assert float(row["cabinet_static"]) == entry["flags"]["cabinet_static"]
    episodes = read_csv(folder / "episodes.csv")
    assert [(e["object"], e["level"]) for e in episodes] == [(r["object"], k) for r in rows for k in "01"]
    assert episodes[0]["target"] == report.episodes[0].target
    taken = np.concatenate([episode.act_s for episode in report.episodes]) * 1000
    assert len(taken) == sum(episode.length for episode in report.episodes)
    assert data["timing"]["act_ms"]["max"] == pytest.approx(taken.max(), abs=1e-3)
    assert 0 < data["timing"]["act_ms"]["median"] <= data["timing"]["act_ms"]["p95"]
    assert data["timing"]["machine"]["cores"] >= 1
    text = (folder / "report.md").read_text()
    assert "| cabinet-0005 | any | 0/2 | 0.0% |" in text
    assert "| **all** |  | 0/4 | 0.0% |" in text


def test_same_report_same_bytes(report: Report, tmp_path: Path) -> None:
    again = evaluate(
        "OpenCabinetDrawer", "random", ["cabinet-0005", "cabinet-0010"], 2, config={"episode_steps": 5}
    )
    first, second = write_report(report, tmp_path / "a"), write_report(again, tmp_path / "b")
    for name in set(REPORT_FILES) - {"report.json"}:  # only that one holds the timing
        assert (first / name).read_bytes() == (second / name).read_bytes()


def test_an_earlier_report_is_replaced_and_nothing_else(report: Report, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    write_report(report, tmp_path)
    write_report(replace(report, policy="other"), tmp_path)
    assert json.loads((tmp_path / "report.json").read_text())["policy"] == "other"
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([*REPORT_FILES, "notes.txt"])


def test_a_failure_leaves_the_earlier_report(
    report: Report, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_report(report, tmp_path)

    def full(self: Path, *args: object, **kwargs: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(ConfigError, match="No space left"):
        write_report(replace(report, policy="other"), tmp_path)
    assert json.loads((tmp_path / "report.json").read_text())["policy"] == "random"
    assert sorted(os.listdir(tmp_path)) == sorted(REPORT_FILES)


def test_folders_that_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="is not a folder"):
        check_output_folder(tmp_path / "file" / "below")
    check_output_folder(tmp_path / "new" / "below")
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("blocked", REPORT_FILES)
def test_a_folder_in_a_files_place_is_seen_before_anything_is_written(
    report: Report, tmp_path: Path, blocked: str
) -> None:
    (tmp_path / blocked).mkdir()
    with pytest.raises(ConfigError, match=f"{blocked}' is a folder"):
        write_report(report, tmp_path)
    assert os.listdir(tmp_path) == [blocked]


@pytest.mark.parametrize("has_earlier", [True, False])
@pytest.mark.parametrize("stop", [KeyboardInterrupt(), OSError(5, "Input/output error")])
def test_what_stops_the_writing_halfway_leaves_all_as_it_was(
    report: Report, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stop: BaseException, has_earlier: bool
) -> None:
    if has_earlier:
        write_report(report, tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    move, moved = os.replace, []

    def stumble(source: Path, target: Path) -> None:
        move(source, target)
        moved.append(target.name)
        if len(moved) == 3:
            raise stop

    monkeypatch.setattr(os, "replace", stumble)
    with pytest.raises((ConfigError, KeyboardInterrupt)):
        write_report(replace(report, policy="other", config={}), tmp_path)
    assert moved[:3] == list(REPORT_FILES[:3])
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
