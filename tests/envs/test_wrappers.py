"""Wrappers of vectors give what those of single environments give."""

import gymnasium as gym
import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.envs.wrappers import (
    FlattenDict,
    PointCloudDownsample,
    VectorFlattenDict,
    VectorPointCloudDownsample,
)
from artiskill.errors import ConfigError

TASK = "OpenCabinetDrawer"


def make(mode: str = "pointcloud", **kwargs: object) -> ManipulationVectorEnv:
    return ManipulationVectorEnv(2, task=TASK, objects="test", obs_mode=mode, **kwargs)  # type: ignore[arg-type]


@pytest.mark.parametrize("frame", ["world", "end_effector"])
def test_down_sampled_points_are_those_of_single_environments(frame: str) -> None:
    vector = VectorPointCloudDownsample(make(), num_points=300, frame=frame)
    observations, _ = vector.reset(seed=3)
    action = np.ones(vector.action_space.shape, np.float32)
    stepped, *_ = vector.step(action)
    for k in range(2):
        single = PointCloudDownsample(
            ManipulationEnv(TASK, objects="test", obs_mode="pointcloud"), num_points=300, frame=frame
        )
        first, second = single.reset(seed=3 + k)[0], single.step(action[k])[0]
        for name in ("xyz", "rgb", "seg"):
            np.testing.assert_array_equal(observations["pointcloud"][name][k], first["pointcloud"][name])
            np.testing.assert_array_equal(stepped["pointcloud"][name][k], second["pointcloud"][name])
    assert vector.observation_space.contains(stepped)


def test_flattened_observations_are_those_of_single_environments() -> None:
    config = {"episode_steps": 1}
    vector = VectorFlattenDict(make("rgbd", autoreset_mode="same_step", config=config))
    single = FlattenDict(ManipulationEnv(TASK, objects="test", obs_mode="rgbd", config=config))
    observations, _ = vector.reset(seed=1)
    one, _ = single.reset(seed=1)
    assert vector.single_observation_space == single.observation_space
    assert vector.observation_space.contains(observations)
    for key, value in one.items():
        np.testing.assert_array_equal(observations[key][0], value)
    action = np.zeros(vector.action_space.shape, np.float32)
    *_, infos = vector.step(action)
    last, *_ = single.step(action[0])
    for key, value in last.items():
        np.testing.assert_array_equal(infos["final_obs"][0][key], value)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ConfigError, match="pointcloud"):
        VectorPointCloudDownsample(make("state"))
    with pytest.raises(ConfigError, match="down-sampled already"):
        VectorPointCloudDownsample(VectorPointCloudDownsample(make()))
    with pytest.raises(ConfigError, match="dictionary"):
        VectorFlattenDict(make("state"))
    sync = gym.vector.SyncVectorEnv([lambda: ManipulationEnv(TASK, obs_mode="pointcloud")])
    with pytest.raises(ConfigError, match="needs a ManipulationVectorEnv"):
        VectorPointCloudDownsample(sync)
