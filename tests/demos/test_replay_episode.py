"""Leading the robot back to the recorded way, seen in an environment whose mode can express all that is asked."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from artiskill.demos.replay_episode import Retarget
from artiskill.envs.control import Control
from artiskill.envs.manipulation import ManipulationEnv

STEPS = 3
FINGERS = [11, 12]
OFF = np.array([0.02, -0.01, 0.015, 0.01, *[0.01, -0.012, 0.008, 0.01, -0.009, 0.011, 0.02], 0.005, 0.005])


@pytest.fixture(scope="module")
def env() -> ManipulationEnv:
    env = ManipulationEnv("OpenCabinetDrawer", "cabinet-0002")
    env.reset(options={"level": 1})
    assert abs(np.sin(env.snapshot.robot_qpos[0, 2])) > 0.02  # else the base's frame is the world's
    return env


def played(env: ManipulationEnv, off: np.ndarray, action: float = 0.0) -> tuple[Retarget, np.ndarray]:
    """A player of actions that all are the same, recorded so far off; the drive targets that it asks for first."""
    source = Control(env.task.robot, "joint")
    way = np.tile(env.snapshot.robot_qpos[0] + off, (STEPS + 1, 1)).astype(np.float32)
    trajectory: Any = SimpleNamespace(actions=np.full((STEPS, 13), action, np.float32), states={"robot_qpos": way})
    player = Retarget(trajectory, source)
    player.begin(env)
    found = player.act(env)
    assert found is not None
    return player, source.to_targets(found[None].astype(np.float64), env.snapshot)[0]


def test_it_goes_half_the_way_back_in_a_step(env: ManipulationEnv) -> None:
    player, targets = played(env, OFF)
    yaw, velocity = env.snapshot.robot_qpos[0, 2], OFF * 0.5 / env.snapshot.step_s
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    np.testing.assert_allclose(turn @ targets[:2], velocity[:2], atol=1e-4)  # it is driven in its own frame
    np.testing.assert_allclose(targets[2:11], velocity[2:11], atol=1e-4)
    assert player.clipped == 0


def test_fingers_are_driven_where_they_were(env: ManipulationEnv) -> None:
    (_, near), (_, off) = played(env, np.zeros(13), 0.25), played(env, OFF, 0.25)
    np.testing.assert_array_equal(near[FINGERS], off[FINGERS])
    assert np.abs(near[:11] - off[:11]).min() > 0.01


def test_what_is_too_fast_is_counted(env: ManipulationEnv) -> None:
    player, targets = played(env, OFF * 50)
    assert player.clipped == 1
    assert np.abs(targets[:11]).max() < np.abs(OFF * 50 * 0.5 / env.snapshot.step_s).max()


def test_it_comes_to_rest_where_the_recording_did(env: ManipulationEnv) -> None:
    player, _ = played(env, np.zeros(13), 0.25)
    actions = [player.act(env) for _ in range(STEPS - 1 + 21)]
    assert actions[-1] is None
    np.testing.assert_allclose(actions[STEPS - 2], 0.25, atol=1e-6)
    for action in actions[STEPS - 1 : -1]:
        assert action is not None
        np.testing.assert_allclose(action[:11], 0.0, atol=1e-6)
        np.testing.assert_allclose(action[FINGERS], 0.25, atol=1e-6)
