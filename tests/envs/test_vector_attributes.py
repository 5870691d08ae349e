"""What a vector says about its environments, against Gymnasium's own vector of single ones."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.errors import AssetError, ConfigError, ResetNeededError, UnknownNameError

TASK = "OpenCabinetDrawer"


@pytest.fixture
def env() -> ManipulationVectorEnv:
    return ManipulationVectorEnv(3, TASK, objects="test")


@pytest.mark.parametrize("name", ["object", "level", "target", "action_space", "observation_space", "obs_mode"])
def test_plain_ones_are_those_of_single_environments(env: ManipulationVectorEnv, name: str) -> None:
    singles = gym.make_vec(f"ArtiSkill/{TASK}-v0", 3, vectorization_mode="sync", objects="test")
    infos = [one.reset(seed=4)[1] for one in (env, singles)]
    if name in infos[1]:
        assert list(env.get_attr(name)) == infos[1][name].tolist()
    else:
        assert env.get_attr(name) == singles.get_attr(name)


def test_privileged_ones_are_those_of_single_environments(env: ManipulationVectorEnv) -> None:
    singles = gym.make_vec(f"ArtiSkill/{TASK}-v0", 3, vectorization_mode="sync", objects="test")
    for one in (env, singles):
        one.reset(seed=4)
        one.step(np.full((3, 13), 0.3, np.float32))
    assert env.get_attr("scene") == singles.get_attr("scene")
    for ours, theirs in zip(env.get_attr("snapshot"), singles.get_attr("snapshot"), strict=True):
        np.testing.assert_array_equal(ours.robot_qpos, theirs.robot_qpos)
        np.testing.assert_array_equal(ours.link_speed_m_s, theirs.link_speed_m_s)
    for ours, theirs in zip(env.get_attr("goal"), singles.get_attr("goal"), strict=True):
        np.testing.assert_array_equal(ours.joint, theirs.joint)
        np.testing.assert_array_equal(ours.open_qpos, theirs.open_qpos)


def test_nothing_of_an_episode_is_known_before_there_is_one(env: ManipulationVectorEnv) -> None:
    for name in ("level", "object", "snapshot"):
        with pytest.raises(ResetNeededError, match=name):
            env.get_attr(name)
    assert len(env.get_attr("objects")[0]) == 10


def test_environments_can_draw_from_elsewhere(env: ManipulationVectorEnv) -> None:
    env.reset(seed=0)
    env.set_attr("objects", "cabinet-0003")
    assert env.get_attr("object") != ("cabinet-0003",) * 3, "episodes go on"
    env.reset()
    assert env.get_attr("object") == ("cabinet-0003",) * 3
    env.set_attr("objects", ["cabinet-0002", "cabinet-0003", ["cabinet-0012"]])
    env.reset()
    assert env.get_attr("object") == ("cabinet-0002", "cabinet-0003", "cabinet-0012")
    assert env.get_attr("objects") == (("cabinet-0002",), ("cabinet-0003",), ("cabinet-0012",))


@pytest.mark.parametrize(
    ("name", "values", "error", "says"),
    [
        ("reward_mode", "sparse", ConfigError, "cannot be set, only objects"),
        ("objects", ["cabinet-0002"], ConfigError, "list of 3"),
        ("objects", "cabinet-9999", UnknownNameError, "cabinet-9999"),
        ("objects", ["cabinet-0002", "cabinet-0003", "chair-0001"], AssetError, "chair-0001"),
    ],
)
def test_what_cannot_be_set(
    env: ManipulationVectorEnv, name: str, values: Any, error: type[Exception], says: str
) -> None:
    before = env.get_attr("objects")
    with pytest.raises(error, match=says):
        env.set_attr(name, values)
    assert env.get_attr("objects") == before
