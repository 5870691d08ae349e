"""Demonstrations and episodes of reports, step by step, against the environments that played them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import PACK
from artiskill.demos.recording import digest_of
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError, DemoError
from artiskill.evaluation.action_replay import unpack_actions
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.policies import ExpertActor
from artiskill.evaluation.report import ACTIONS_FILE, write_report
from artiskill.evaluation.statistics import EpisodeResult
from artiskill.evaluation.stored_report import read_report
from artiskill.viewer.pickers import ReportPicker
from artiskill.viewer.playback import SOLVED
from artiskill.viewer.recorded import RecordedEpisode, ReportedEpisode, recorded_episode


@pytest.fixture(scope="module")
def demos() -> DemoFile:
    pytest.importorskip("h5py")
    return DemoFile(PACK / "OpenCabinetDrawer" / "cabinet-0002.h5")


def test_a_demonstration_has_its_exact_states_at_any_step(demos: DemoFile, rng: np.random.Generator) -> None:
    trajectory, env = demos.trajectory(0), demos.make_env()
    episode = RecordedEpisode(trajectory, demos.make_env(), "one")
    wanted = {
        step: env.restore_state(state) and env.snapshot for step, state in enumerate(trajectory.env_states(env))
    }
    assert len(episode) == len(trajectory) + 1 == len(wanted)
    for step in rng.permutation(len(episode)).tolist():
        found = episode.moment(step)
        for name in ("body_position_w", "body_quaternion_w", "robot_qvel", "previous_link_position_w"):
            np.testing.assert_array_equal(getattr(found.context.snapshot, name), getattr(wanted[step], name))
        assert found.context.elapsed == step
        assert found.reward == (trajectory.rewards[step - 1] if step else 0.0)
    assert found is episode.moment(step)
    assert episode.moment(len(trajectory)).end == SOLVED
    assert episode.moment(len(trajectory) - 1).end == ""
    assert digest_of(trajectory.env_state(len(trajectory), env).simulation) == trajectory.recording.digests[-1]


def test_a_demonstration_that_comes_out_otherwise(demos: DemoFile) -> None:
    trajectory = demos.trajectory(0)
    trajectory.recording.actions[3] = 0.5
    with pytest.raises(DemoError, match="step 4 is another one"):
        RecordedEpisode(trajectory, demos.make_env(), "one")


def test_which_demonstrations_there_are(demos: DemoFile) -> None:
    assert "demonstration 1 of" in recorded_episode(demos, 1).title
    with pytest.raises(IndexError):
        recorded_episode(demos, len(demos))


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two objects, two levels each; one object is solved, the other hopeless."""
    folder = tmp_path_factory.mktemp("report")
    config = {"episode_steps": 70}
    played = evaluate("OpenCabinetDrawer", "expert", ["cabinet-0002", "cabinet-0003"], 2, 3, config=config)
    return write_report(played, folder)


def test_an_episode_of_a_report_is_the_evaluated_one(report: Path) -> None:
    picker = ReportPicker(report, 1)
    timeline, env = picker.load(), ManipulationEnv("OpenCabinetDrawer", objects=["cabinet-0002"])
    observation, info = env.reset(options={"level": 4})
    actor = ExpertActor()
    actor.reset(env, observation, info)
    done, step = False, 0
    while not done:
        found = timeline.moment(step)
        np.testing.assert_array_equal(found.state.simulation.rows, env.save_state().simulation.rows)
        assert (found.end, found.context.elapsed) == ("", step)
        observation, reward, terminated, truncated, info = env.step(actor.act(env, observation))
        done, step = terminated or truncated, step + 1
        assert timeline.moment(step).reward == reward
    assert len(timeline) == step + 1
    assert timeline.moment(step).end == SOLVED
    assert timeline.title == f"OpenCabinetDrawer: cabinet-0002, {info['target']}, level 4, expert"


def test_a_report_of_other_physics_is_refused(report: Path) -> None:
    stored = read_report(report)
    result = replace(stored.episodes()[0], digest="0" * 16)
    env = ManipulationEnv("OpenCabinetDrawer", objects=["cabinet-0002"])
    actions = unpack_actions(stored.files[ACTIONS_FILE])[0]
    with pytest.raises(ConfigError, match="level 3: the episode ends otherwise than the report says"):
        ReportedEpisode(env, actions, result, "expert")


def test_an_episode_that_a_fault_ended() -> None:
    env = ManipulationEnv("OpenCabinetDrawer", objects=["cabinet-0002"])
    result = EpisodeResult("cabinet-0002", "link_0", 3, False, 2, {}, "PolicyError: no idea", 0.0, "", np.zeros(0))
    timeline = ReportedEpisode(env, np.zeros((2, env.control.size)), result, "mine.py")
    assert len(timeline) == 3
    assert timeline.moment(2).end == "PolicyError: no idea"


def test_a_report_has_so_many_episodes(report: Path) -> None:
    with pytest.raises(ConfigError, match="the episodes 0 to 3, not 4"):
        ReportPicker(report, 4)
