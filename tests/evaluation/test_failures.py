"""How episodes failed: the stage that each got to is the one that a single environment passes through."""

import csv
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from artiskill.cli.main import main
from artiskill.envs.core import Episodes
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import Cause, ConfigError
from artiskill.evaluation.action_replay import pack_actions, unpack_actions
from artiskill.evaluation.evaluate import evaluate, run_episode
from artiskill.evaluation.failures import Failures, find_failures, stage_bonus
from artiskill.evaluation.plan import plan_evaluation
from artiskill.evaluation.policies import StillActor
from artiskill.evaluation.report import ACTIONS_FILE, EPISODES_CSV, Report, make_report, write_report
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


@pytest.mark.parametrize("steps", [0, 2])
def test_a_policys_own_fault_is_a_kind(steps: int, tmp_path: Path) -> None:
    class Shaky(StillActor):
        def act(self, env: ManipulationEnv, observation: Any) -> np.ndarray:
            if env.save_state().elapsed == steps:
                raise np.linalg.LinAlgError("SVD did not converge")
            return super().act(env, observation)

    plan = plan_evaluation(TASK, "still", OBJECTS[:1], 2, config=CUT)
    env = plan.batches[0].make_env()
    results = [run_episode(env, Shaky(), level) for level in (0, 1)]
    found = find_failures(write_report(make_report(plan, [results], 1.0, 1), tmp_path))
    assert [(one.kind.furthest, one.kind.fault) for one in found.episodes] == [("approach", "LinAlgError")] * 2


def test_physics_that_run_away_leave_an_episode_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They begin anew from where nothing has been done yet: that is not where the episode ended."""
    step = Episodes.step

    def run_away(episodes: Episodes, *values: Any) -> dict[int, Cause]:
        diverged = step(episodes, *values)
        return diverged if episodes.elapsed[0] < 55 else {0: (OBJECTS[0], ("BADQACC",))}

    monkeypatch.setattr(Episodes, "step", run_away)
    report = evaluate(TASK, "expert", OBJECTS[:1], 1, config=CUT)
    kind = find_failures(write_report(report, tmp_path)).episodes[0].kind
    assert kind.fault == "DivergedError"
    assert kind.final == kind.furthest != "approach"


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


def test_damaged_actions_are_refused(folder: Path, tmp_path: Path) -> None:
    damaged = Path(shutil.copytree(folder, tmp_path / "damaged"))
    (damaged / ACTIONS_FILE).write_bytes(b"nothing")
    with pytest.raises(ConfigError, match=r"actions.npz': it is damaged"):
        find_failures(damaged)
    stored = unpack_actions((folder / ACTIONS_FILE).read_bytes())
    (damaged / ACTIONS_FILE).write_bytes(pack_actions(stored[:-1]))
    with pytest.raises(ConfigError, match=r"actions.npz': it has 7 episodes, episodes.csv 8"):
        find_failures(damaged)
    (damaged / ACTIONS_FILE).write_bytes(pack_actions([-actions for actions in stored]))
    with pytest.raises(ConfigError, match="these are not the actions of the report"):
        find_failures(damaged)


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
    assert main(["report", "failures", str(folder), "--out", str(out / "below.csv")]) == 2
    assert "failures.csv" in capsys.readouterr().err
