"""Scenes that are built beforehand are those that environments use."""

import os
import subprocess
import sys
from functools import partial

import gymnasium as gym
import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.envs.warm import warm_scenes
from artiskill.errors import UnknownNameError
from artiskill.scene.scene import cached_scene

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


# resets and steps in every mode; prints how many functions were compiled for it
_EVERY_MODE = """
import gymnasium as gym, artiskill
from artiskill.envs.wrappers import PointCloudDownsample
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.evaluation.policies import load_policy, policy_of_task
from numba.core import event
compiled = []
class Listener(event.Listener):
    def on_start(self, e): compiled.append(e.data["dispatcher"].py_func.__name__)
    def on_end(self, e): pass
event.register("numba:compile", Listener())
for task in ("OpenCabinetDoor", "OpenCabinetDrawer", "PushChair", "MoveBucket"):
    for mode in ("state", "pointcloud", "rgbd"):
        envs = [gym.make(f"ArtiSkill/{task}-v0", obs_mode=mode)]
        if mode == "pointcloud":
            envs += [PointCloudDownsample(gym.make(f"ArtiSkill/{task}-v0", obs_mode=mode)) for _ in range(1)]
        for env in envs:
            env.reset(seed=0)
            env.step(env.action_space.sample())
    vector = gym.make_vec(f"ArtiSkill/{task}-v0", num_envs=2, obs_mode="rgbd")
    vector.reset(seed=0)
    vector.step(vector.action_space.sample())
    for name in ("expert", "demonstrator", "pretrained"):
        actor = load_policy(policy_of_task(name, task))
        env = EpisodeChoice(task, artiskill.list_objects(task=task)[0]).make_env(actor)
        observation, info = env.reset(seed=0)
        actor.reset(env, observation, info)
        for _ in range(3):
            observation, *_ = env.step(actor.act(env, observation))
print(compiled)
"""


@pytest.mark.slow
def test_after_warm_nothing_is_compiled(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    run = partial(subprocess.run, env=environment, capture_output=True, text=True, check=True)
    warm = run([sys.executable, "-m", "artiskill", "warm"])
    assert str(tmp_path) in warm.stdout
    assert "artiskill: compiling" not in warm.stderr, "it has its own lines"
    used = run([sys.executable, "-c", _EVERY_MODE])
    assert (used.stdout, used.stderr) == ("[]\n", "")


@pytest.mark.slow
def test_the_first_point_cloud_says_that_it_compiles(tmp_path):
    source = "import gymnasium as gym, artiskill\ngym.make('{}', obs_mode='pointcloud').reset(seed=0)"
    command = [sys.executable, "-c", source.format("ArtiSkill/OpenCabinetDrawer-v0")]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    environment.pop("ARTISKILL_PROCESS_TREE", None)
    said = [subprocess.run(command, env=environment, capture_output=True, text=True).stderr for _ in range(2)]
    assert said[0].startswith("artiskill: compiling kernels for this processor, about ")
    assert said[0].count("\n") == 1
    assert said[1] == ""
