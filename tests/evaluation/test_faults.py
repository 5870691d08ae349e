"""Episodes whose physics runs away: they count as failed, by kind, and the others are what they were."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.cli.table import print_report
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import PolicyError
from artiskill.evaluation.evaluate import evaluate, run_episode
from artiskill.evaluation.policies import StillActor, load_policy
from artiskill.evaluation.recording import EpisodeRecorder
from artiskill.evaluation.report import write_report
from artiskill.evaluation.scene_pictures import PictureStyle
from artiskill.evaluation.statistics import EpisodeResult

TASK, OBJECT = "OpenCabinetDrawer", "cabinet-0005"
# too long a step for this integrator: whoever moves in it makes the physics run away
FRAGILE = {"physics.integrator": "rk4", "physics.timestep_s": 0.01, "episode_steps": 4}
WILD_LEVEL, WILD_STEP = 1, 2


class WildAtOneLevel:
    obs_mode = "state"

    def reset(self, observation: np.ndarray, info: dict[str, Any]) -> None:
        self.level, self.step = info["level"], 0

    def act(self, observation: np.ndarray) -> np.ndarray:
        is_wild = self.level == WILD_LEVEL and self.step >= WILD_STEP
        self.step += 1
        return np.tile((1.0, -1.0), 7)[:13] * is_wild


def test_an_episode_that_diverges_counts_as_failed_by_kind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    report = evaluate(TASK, WildAtOneLevel(), OBJECT, 3, config=FRAGILE)
    failed = report.episodes[WILD_LEVEL]
    assert [episode.fault.partition(":")[0] for episode in report.episodes] == ["", "DivergedError", ""]
    assert "BADQ" in failed.fault
    assert (failed.success, set(failed.flags.values())) == (False, {False})
    assert WILD_STEP <= failed.length < FRAGILE["episode_steps"]
    assert report.total.faults == report.rows[0].stats.faults == {"DivergedError": 1}
    assert report.total.episodes == 3
    assert list(tmp_path.iterdir()) == []
    # what was played after it does not depend on it
    assert evaluate(TASK, WildAtOneLevel(), OBJECT, 1, 2, config=FRAGILE).episodes == report.episodes[2:]

    folder = write_report(report, "out")
    data = json.loads((folder / "report.json").read_text())
    assert data["faults"] == data["objects"][0]["faults"] == {"DivergedError": 1}
    with (folder / "episodes.csv").open(newline="") as file:
        assert [row["fault"] for row in csv.DictReader(file)] == ["", failed.fault, ""]
    with (folder / "report.csv").open(newline="") as file:
        assert [row["faults"] for row in csv.DictReader(file)] == ["1"]
    says = "Episodes that a fault ended, which count as failed: 1 by DivergedError."
    assert says in (folder / "report.md").read_text()
    print_report(report)
    assert says in capsys.readouterr().out


def test_a_report_without_faults_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    report = evaluate(TASK, "still", OBJECT, 1, config={"episode_steps": 2})
    assert report.to_mapping()["faults"] == {}
    print_report(report)
    assert "fault" not in capsys.readouterr().out


class Shaky(StillActor):
    """A privileged policy whose arithmetic fails."""

    def act(self, env: ManipulationEnv, observation: Any) -> np.ndarray:
        if len(self.seen) == WILD_STEP:
            raise np.linalg.LinAlgError("SVD did not converge")
        self.seen.append(observation)
        return super().act(env, observation)

    def __init__(self) -> None:
        self.seen: list[Any] = []


def test_an_experts_arithmetic_is_a_fault_and_a_solutions_is_its_own() -> None:
    env, looked = ManipulationEnv(TASK, OBJECT), list[tuple[int, bool]]()

    def watch(env: ManipulationEnv, steps: int, done: bool) -> None:
        looked.append((steps, done))

    result: EpisodeResult = run_episode(env, Shaky(), 0, watch)
    assert (result.fault, result.length) == ("LinAlgError: SVD did not converge", WILD_STEP)
    assert looked == [(0, False), (1, False), (2, False), (2, True)], "who films it hears of the end"

    def policy(observation: np.ndarray) -> np.ndarray:
        raise np.linalg.LinAlgError("SVD did not converge")

    with pytest.raises(
        PolicyError, match=r"LinAlgError: SVD did not converge \(object cabinet-0005, level 0, step 0"
    ):
        evaluate(TASK, policy, OBJECT, 1)


def test_an_episode_that_diverges_can_be_filmed() -> None:
    env = ManipulationEnv(TASK, OBJECT, config=FRAGILE)
    film = EpisodeRecorder(PictureStyle(width=96, height=72))
    actor = load_policy(WildAtOneLevel())
    assert run_episode(env, actor, WILD_LEVEL, film.record).fault
    frames = film.draw()
    assert all(np.isfinite(instant.snapshot.body_position_w).all() for instant in film.moments)
    assert (frames[-1].shape, len(frames)) == ((72, 96, 3), len(film.moments) + 10)
