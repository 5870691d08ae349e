"""The adapter for Stable-Baselines3."""

import warnings
from typing import Any

import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.stable_baselines import as_sb3
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.envs.wrappers import VectorFlattenDict
from artiskill.errors import ConfigError

TASK = "OpenCabinetDrawer"
SMALL = {"cameras.number": 1, "cameras.width": 64, "cameras.height": 48, "episode_steps": 3}


@pytest.fixture(autouse=True)
def library() -> Any:
    """Its import warns of things that are its own."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return pytest.importorskip("stable_baselines3", reason="needs pip install 'artiskill[rl]'")


def make(**kwargs: Any) -> ManipulationVectorEnv:
    defaults = {"task": TASK, "objects": "test", "autoreset_mode": "same_step", "config": SMALL}
    return ManipulationVectorEnv(3, **defaults | kwargs)


def test_it_does_what_the_library_does_around_single_environments() -> None:
    from stable_baselines3.common.vec_env import DummyVecEnv

    ours = as_sb3(make())
    theirs = DummyVecEnv([lambda: ManipulationEnv(TASK, objects="test", config=SMALL)] * 3)
    ours.seed(5)
    theirs.seed(5)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    rng = np.random.default_rng(0)
    for _ in range(7):
        actions = rng.uniform(-1, 1, (3, 13)).astype(np.float32)
        (o1, r1, d1, i1), (o2, r2, d2, i2) = ours.step(actions), theirs.step(actions)
        np.testing.assert_array_equal(o1, o2)
        np.testing.assert_array_equal(r1, r2)
        np.testing.assert_array_equal(d1, d2)
        for one, other in zip(i1, i2, strict=True):
            assert ("terminal_observation" in one) == ("terminal_observation" in other)
            if "terminal_observation" in other:
                np.testing.assert_array_equal(one["terminal_observation"], other["terminal_observation"])
                for key in ("TimeLimit.truncated", "object", "level", "target", "success", "flags"):
                    assert one[key] == other[key]


def test_ppo_learns_on_it_without_complaint() -> None:
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor

    model = PPO("MlpPolicy", VecMonitor(as_sb3(make())), n_steps=8, batch_size=24, device="cpu")
    model.learn(48)
    assert model.num_timesteps == 48


def test_pictures_too() -> None:
    from stable_baselines3 import PPO

    env = as_sb3(VectorFlattenDict(make(obs_mode="rgbd", config=SMALL)))
    PPO("MultiInputPolicy", env, n_steps=4, batch_size=12, device="cpu").learn(12)


@pytest.mark.parametrize("copy", [True, False])
def test_what_is_learned_from_is_what_was_seen(copy: bool) -> None:
    from stable_baselines3 import SAC

    model = SAC("MlpPolicy", as_sb3(make(copy=copy)), learning_starts=100, seed=0, device="cpu")
    model.learn(21)
    buffer = model.replay_buffer
    assert (buffer.observations[:7] != buffer.next_observations[:7]).any(axis=-1).all()
    going_on = ~buffer.dones[:6].astype(bool)
    np.testing.assert_array_equal(buffer.next_observations[:6][going_on], buffer.observations[1:7][going_on])


def test_options_and_seeds_as_the_library_sets_them() -> None:
    env = as_sb3(make())
    env.set_options([{"object": "cabinet-0005", "level": 3}, {"object": "cabinet-0005"}, {}])
    env.seed(2**31 + 4)  # the library's seeds have 32 bits
    env.reset()
    assert env.get_attr("object")[:2] == ["cabinet-0005"] * 2
    assert env.get_attr("level") == [3, 5, 6]
    env.seed()
    env.reset()
    env.set_attr("objects", "cabinet-0003", indices=[1])
    env.reset()
    assert env.get_attr("object", indices=1) == ["cabinet-0003"]


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"as_sb3 needs a vector environment.*ManipulationEnv"):
        as_sb3(ManipulationEnv(TASK))
    with pytest.raises(ConfigError, match="same_step"):
        as_sb3(make(autoreset_mode="next_step"))
    with pytest.raises(ConfigError, match="VectorFlattenDict"):
        as_sb3(make(obs_mode="rgbd"))
    env = as_sb3(make())
    env.reset()
    assert len(env.get_attr("level")) == 3
    assert len(env.env_method("save_state", indices=[1])) == 1
    with pytest.raises(ConfigError, match="cannot be set"):
        env.set_attr("level", 4)
