"""Stable-Baselines3 takes the environments as they are, or, where they see, in `FlattenDict`."""

import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.options import OBSERVATION_MODES
from artiskill.envs.wrappers import FlattenDict, PointCloudDownsample
from artiskill.errors import ConfigError
from artiskill.tasks.registry import task_names

OBJECT = "cabinet-0010"
SMALL = {"cameras.number": 1, "cameras.width": 64, "cameras.height": 48}
VISUAL_MODES = tuple(mode for mode in OBSERVATION_MODES if mode != "state")


def make(obs_mode: str, **kwargs: Any) -> ManipulationEnv:
    return ManipulationEnv(objects=OBJECT, obs_mode=obs_mode, **kwargs)


def sb3() -> Any:
    """The library, whose import warns of things that are its own."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return pytest.importorskip("stable_baselines3", reason="needs pip install 'artiskill[rl]'")


@pytest.mark.parametrize("mode", VISUAL_MODES)
def test_flat_observations_hold_the_same_numbers(mode: str) -> None:
    env = make(mode)
    flat = FlattenDict(env)
    nested, _ = env.reset(seed=0)
    seen, _ = flat.reset(seed=0)
    assert flat.observation_space.contains(seen)
    assert set(seen) == {*nested[mode], "agent"}
    for key, value in {**nested[mode], "agent": nested["agent"]}.items():
        assert seen[key].dtype == value.dtype
        np.testing.assert_array_equal(seen[key].reshape(value.shape), value)
    assert {key: seen[key].ndim for key in seen if seen[key].ndim > 1} == ({"rgb": 3} if mode == "rgbd" else {})


def test_flattening_needs_distinct_keys_in_a_dictionary() -> None:
    with pytest.raises(ConfigError, match="dictionary"):
        FlattenDict(make("state"))
    box = gym.spaces.Box(0, 1, (2,))
    env = make("rgbd")
    env.observation_space = gym.spaces.Dict({"a": gym.spaces.Dict({"x": box}), "b": gym.spaces.Dict({"x": box})})
    with pytest.raises(ConfigError, match="'x' occurs twice"):
        FlattenDict(env)


@pytest.mark.parametrize("mode", OBSERVATION_MODES)
@pytest.mark.parametrize("task", task_names())
def test_checker_is_silent(task: str, mode: str) -> None:
    sb3()
    from stable_baselines3.common.env_checker import check_env

    env = gym.make(f"ArtiSkill/{task}-v0", objects="test", obs_mode=mode, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env if mode == "state" else FlattenDict(env), skip_render_check=False)


def test_checker_is_silent_for_fewer_points() -> None:
    sb3()
    from stable_baselines3.common.env_checker import check_env

    check_env(FlattenDict(PointCloudDownsample(make("pointcloud"), num_points=64)))


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")  # Python 3.12 and later, where there are threads
@pytest.mark.parametrize("start_method", ["fork", "spawn"])
def test_workers_of_other_processes_play(start_method: str) -> None:
    sb3()
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

    makers = [lambda: make("state", config=SMALL | {"episode_steps": 4}, render_mode="rgb_array")] * 2
    alone, workers = DummyVecEnv(makers), SubprocVecEnv(makers, start_method=start_method)
    actions = np.linspace(-1, 1, 26, dtype=np.float32).reshape(2, 13)
    for env in (alone, workers):
        env.seed(3)
    np.testing.assert_array_equal(alone.reset(), workers.reset())
    for _ in range(6):
        (seen, rewards, done, infos), theirs = alone.step(actions), workers.step(actions)
        for mine, other in zip((seen, rewards, done), theirs[:3], strict=True):
            np.testing.assert_array_equal(
                mine, other.astype(mine.dtype)
            )  # one of the two keeps rewards in float64
        assert [info["level"] for info in infos] == [info["level"] for info in theirs[3]]
    states = workers.env_method("save_state")
    alone.env_method("restore_state", states[1], indices=0)
    np.testing.assert_array_equal(alone.get_images()[0], workers.get_images()[1])
    workers.close()


@pytest.mark.slow
@pytest.mark.parametrize("mode", OBSERVATION_MODES)
def test_a_policy_trains_in_every_mode(mode: str) -> None:
    library = sb3()
    env: gym.Env = make(mode, config=SMALL)
    policy = "MlpPolicy" if mode == "state" else "MultiInputPolicy"
    model = library.PPO(
        policy, env if mode == "state" else FlattenDict(env), n_steps=16, batch_size=16, device="cpu"
    )
    assert model.learn(32).num_timesteps == 32
