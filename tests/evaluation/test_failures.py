"""How episodes failed: the stage that each got to is the one that a single environment passes through."""

import csv
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from artiskill.cli.main import main
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.failures import Failures, find_failures, stage_bonus
from artiskill.evaluation.report import ACTIONS_FILE, EPISODES_CSV, Report, unpack_actions, write_report
from artiskill.tasks.registry import make_task

TASK, OBJECTS = "OpenCabinetDrawer", ["cabinet-0002", "cabinet-0003"]
CUT = {"episode_steps": 62}  # ends some of the expert's episodes at the handle, some while the drawer opens


@pytest.fixture(scope="module")
def report() -> Report:
    return evaluate(TASK, "expert", OBJECTS, 4, config=CUT)


@pytest.fixture(scope="module")
def folder(report: Report, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_report(report, tmp_path_factory.mktemp("report"))


@pytest.fixture(scope="module")
def found(folder: Path) -> Failures:
    return find_failures(folder)


def test_all_failures_and_no_success(report: Report, found: Failures) -> None:
    failed = [(one.object, one.target, one.level) for one in report.episodes if not one.success]
    assert 0 < len(failed) < len(report.episodes) == found.played
    assert [(one.object, one.target, one.level) for one in found.episodes] == failed
    lacked = [tuple(name for name, held in one.flags.items() if not held) for one in report.episodes]
    assert [one.kind.missing for one in found.episodes] == [names for names in lacked if names]


def test_stages_are_those_that_were_passed_through(report: Report, folder: Path, found: Failures) -> None:
    stages = [stage.name for stage in make_task(TASK).reward_table.stages]
    stored = unpack_actions((folder / ACTIONS_FILE).read_bytes())
    env = ManipulationEnv(TASK, OBJECTS, config=CUT)
    for one in found.episodes:
        place = [(e.object, e.level) for e in report.episodes].index((one.object, one.level))
        env.reset(options={"level": one.level, "object": one.object})
        passed = []
        for action in stored[place]:
            *_, info = env.step(action)
            earned = info["reward_terms"]["stage"]
            passed.append(max(k for k, bonus in enumerate(stage_bonus(env.task)) if bonus <= earned))
        assert (one.kind.furthest, one.kind.final) == (stages[max(passed)], stages[passed[-1]])
    assert len({one.kind.furthest for one in found.episodes}) > 1, "several kinds were looked at"


def test_kinds_are_counted(found: Failures) -> None:
    counts = [objects.total() for _, objects in found.by_kind()]
    assert counts == sorted(counts, reverse=True)
    assert sum(counts) == len(found.episodes)


def test_any_number_of_workers(folder: Path, found: Failures) -> None:
    assert find_failures(folder, workers=2) == found


def test_a_report_that_differs_is_refused(report: Report, folder: Path, tmp_path: Path) -> None:
    forged = Path(shutil.copytree(folder, tmp_path / "forged"))
    with (forged / EPISODES_CSV).open() as file:
        rows = list(csv.DictReader(file))
    failed = next(row for row in rows if row["success"] == "0")
    text = (forged / EPISODES_CSV).read_text()
    (forged / EPISODES_CSV).write_text(text.replace(failed["digest"], f"{1:016x}"))
    with pytest.raises(ConfigError, match=f"{failed['object']}, level {failed['level']} goes otherwise"):
        find_failures(forged)


def test_a_reward_without_stages_has_no_kinds() -> None:
    task: Any = SimpleNamespace(config=SimpleNamespace(name="Mine"))
    with pytest.raises(ConfigError, match=r"^the reward of Mine has no stages"):
        stage_bonus(task)


def test_the_command_prints_and_writes(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "failures.csv"
    assert main(["report", "failures", str(folder), "--workers", "1", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    found = find_failures(folder)
    assert f"{len(found.episodes)} of 8 episodes failed" in said
    assert all(one.kind.furthest in said for one in found.episodes)
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert [(row["object"], int(row["level"]), row["furthest"]) for row in rows] == [
        (one.object, one.level, one.kind.furthest) for one in found.episodes
    ]
    assert all(row["missing"] for row in rows)
