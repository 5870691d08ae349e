"""LeRobot's side of an environment, without LeRobot: names, spaces, automatic resets, success."""

import warnings
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from artiskill.compat.lerobot import LeRobotEnv, make_envs
from artiskill.demos.lerobot import mask_picture
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import DivergedError
from artiskill.evaluation.report import Report

from .conftest import LEVELS, OBJECTS, TASK

SMALL = {"cameras.width": 32, "cameras.height": 16}
MODES = ("rgbd", "pointcloud", "state")


@pytest.mark.parametrize("task", ["OpenCabinetDrawer", "MoveBucket"])
@pytest.mark.parametrize("obs_mode", MODES)
def test_it_is_a_gymnasium_environment(obs_mode: str, task: str) -> None:
    env = LeRobotEnv(task, "train", obs_mode=obs_mode, config=SMALL)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of normalised observations
        check_env(env, skip_render_check=True)
    assert (env.task, env._max_episode_steps, env.metadata["render_fps"]) == (task, 200, 20)
    assert env.task_description.endswith(".")
    env.close()


def test_arrays_are_those_of_the_environment() -> None:
    own = ManipulationEnv(TASK, OBJECTS, obs_mode="rgbd", config=SMALL)
    env = LeRobotEnv(TASK, OBJECTS, config=SMALL)
    real, info = own.reset(seed=4)
    found, told = env.reset(seed=4)
    assert told == {"is_success": False} | {key: info[key] for key in ("object", "target", "level")}
    np.testing.assert_array_equal(found["agent_pos"], real["agent"])
    np.testing.assert_array_equal(found["depth"], real["rgbd"]["depth"])
    for k, name in enumerate(("front", "left", "right")):
        np.testing.assert_array_equal(found["pixels"][name], real["rgbd"]["rgb"][..., 3 * k : 3 * k + 3])
        masks = real["rgbd"]["seg"][..., 3 * k : 3 * k + 3]
        np.testing.assert_array_equal(found["pixels"][f"{name}_masks"] == 255, masks)
    assert any(found["pixels"][f"{name}_masks"][..., :2].any() for name in ("front", "left", "right"))
    one_mask = mask_picture(np.ones((2, 2, 1), bool))
    assert one_mask.tolist() == [[[255, 0, 0]] * 2] * 2
    assert env.render().shape == (480, 640, 3)


def test_fewer_points() -> None:
    env = LeRobotEnv(
        TASK, OBJECTS, obs_mode="pointcloud", sampling={"num_points": 64, "frame": "robot"}, config=SMALL
    )
    observation, _ = env.reset(seed=0)
    assert observation["pointcloud.xyz"].shape == (64, 3)
    assert env.observation_space.contains(observation)


@pytest.fixture
def vectors() -> Iterator[dict[int, gym.vector.VectorEnv[Any, Any, Any]]]:
    envs = make_envs(LEVELS, task=TASK, objects=OBJECTS, obs_mode="state", config={"episode_steps": 60})
    assert list(envs) == [TASK]
    yield envs[TASK]
    for env in envs[TASK].values():
        env.close()


def test_success_is_that_of_an_evaluation(
    vectors: dict[int, gym.vector.VectorEnv[Any, Any, Any]], report: Report
) -> None:
    """Side by side, with automatic resets in the same step, as LeRobot's `rollout` counts."""
    outcomes = []
    for number, env in vectors.items():
        episodes = report.episodes[LEVELS * number : LEVELS * (number + 1)]
        env.reset(seed=list(range(LEVELS)))
        assert env.call("task_description") == ("Open the marked drawer of the cabinet.",) * LEVELS
        assert env.call("_max_episode_steps") == (60,) * LEVELS
        done = np.zeros(LEVELS, bool)
        success, length = np.zeros(LEVELS, bool), np.zeros(LEVELS, int)
        for step in range(60):
            rows = [e.actions[min(step, len(e.actions) - 1)] for e in episodes]
            _, _, terminated, truncated, info = env.step(np.array(rows))
            ended = (terminated | truncated) & ~done
            if ended.any():
                assert info["final_info"]["_is_success"][ended].all()
                success |= ended & info["final_info"]["is_success"]
                length[ended] = step + 1
            done |= ended
        outcomes += list(zip(success.tolist(), length.tolist(), strict=True))
    assert outcomes == [(episode.success, episode.length) for episode in report.episodes]
    assert any(success for success, _ in outcomes)


def test_diverging_physics_ends_an_episode(monkeypatch: pytest.MonkeyPatch) -> None:
    env = LeRobotEnv(TASK, OBJECTS, obs_mode="state")
    first, _ = env.reset(seed=0)

    def diverge(self: ManipulationEnv, action: np.ndarray) -> Any:
        raise DivergedError({0: ("cabinet-0002", "a bad number")})

    monkeypatch.setattr(ManipulationEnv, "step", diverge)
    observation, reward, terminated, truncated, info = env.step(np.zeros(13, np.float32))
    assert observation is first
    assert (reward, terminated, truncated, info["is_success"]) == (0.0, False, True, False)
