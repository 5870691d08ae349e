"""Scenes that are built beforehand are those that environments use."""

import gymnasium as gym
import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.vector.env import ManipulationVectorEnv
from artiskill.envs.warm import warm_scenes
from artiskill.errors import UnknownNameError
from artiskill.scene.cache import cached_scene

TASK = "OpenCabinetDrawer"


def test_environments_find_what_was_built() -> None:
    assert warm_scenes(TASK, ["cabinet-0003", "cabinet-0005"]) == 2
    built = cached_scene.cache_info().misses
    env = ManipulationVectorEnv(4, task=TASK, objects=["cabinet-0003", "cabinet-0005"])
    env.reset(seed=0)
    ManipulationEnv(TASK, objects="cabinet-0003").reset(seed=0)
    assert cached_scene.cache_info().misses == built
    with pytest.raises(UnknownNameError):
        warm_scenes(TASK, "trian")


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_other_processes_do_the_same(context: str) -> None:
    warm_scenes(TASK, "cabinet-0003")
    env = ManipulationVectorEnv(1, task=TASK, objects="cabinet-0003")
    others = gym.vector.AsyncVectorEnv([lambda: ManipulationEnv(TASK, objects="cabinet-0003")], context=context)
    actions = np.ones(env.action_space.shape, np.float32)
    np.testing.assert_array_equal(others.reset(seed=3)[0], env.reset(seed=3)[0])
    np.testing.assert_array_equal(others.step(actions)[0], env.step(actions)[0])
    others.close()
