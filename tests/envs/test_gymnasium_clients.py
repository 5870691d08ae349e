"""Gymnasium's own wrappers and vectors take the environments as they are."""

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import wrappers
from gymnasium.wrappers import vector as vector_wrappers

from artiskill.envs.options import OBSERVATION_MODES

ID, OBJECT = "ArtiSkill/OpenCabinetDrawer-v0", "cabinet-0010"
SMALL = {"cameras.number": 1, "cameras.width": 64, "cameras.height": 48, "episode_steps": 4}


def make(**kwargs: Any) -> gym.Env:
    return gym.make(ID, **{"objects": OBJECT, "config": SMALL, **kwargs})


def make_vec(**kwargs: Any) -> gym.vector.VectorEnv:
    return gym.make_vec(ID, num_envs=2, **{"objects": OBJECT, "config": SMALL, "num_threads": 1, **kwargs})


def play(env: Any, steps: int = 6) -> list[Any]:
    """Results of steps with fixed actions; a single environment starts anew where its episode ends."""
    rng = np.random.default_rng(0)
    env.reset(seed=0)
    results = []
    for _ in range(steps):
        results.append(env.step(rng.uniform(-1, 1, env.action_space.shape).astype(env.action_space.dtype)))
        if not isinstance(env, gym.vector.VectorEnv) and (results[-1][2] or results[-1][3]):
            env.reset()
    env.close()
    return results


def test_record_episode_statistics() -> None:
    results = play(wrappers.RecordEpisodeStatistics(make()))
    told = [info["episode"] for *_, info in results if "episode" in info]
    assert [one["l"] for one in told] == [4]
    assert told[0]["r"] == pytest.approx(sum(reward for _, reward, *_ in results[:4]))


def test_time_limit() -> None:
    assert [truncated for *_, truncated, _ in play(wrappers.TimeLimit(make(), 3))] == [False, False, True] * 2


def test_record_video(tmp_path: Path) -> None:
    pytest.importorskip("moviepy", reason="needs moviepy: make test-rl")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of things that are its own
        env = wrappers.RecordVideo(make(render_mode="rgb_array"), str(tmp_path), episode_trigger=lambda _: True)
        play(env)
        many = vector_wrappers.RecordVideo(make_vec(render_mode="rgb_array"), str(tmp_path / "many"))
        play(many)
    assert len(list(tmp_path.glob("*.mp4"))) == 2
    assert list((tmp_path / "many").glob("*.mp4"))


VECTOR_WRAPPERS: dict[str, Callable[[gym.vector.VectorEnv], Any]] = {
    "ClipAction": vector_wrappers.ClipAction,
    "ClipReward": lambda env: vector_wrappers.ClipReward(env, -1.0, 1.0),
    "FlattenObservation": vector_wrappers.FlattenObservation,
    "NormalizeObservation": vector_wrappers.NormalizeObservation,
    "NormalizeReward": vector_wrappers.NormalizeReward,
    "RecordEpisodeStatistics": vector_wrappers.RecordEpisodeStatistics,
    "TransformObservation": lambda env: vector_wrappers.TransformObservation(env, lambda seen: seen * 2),
    "DictInfoToList": vector_wrappers.DictInfoToList,
}


@pytest.mark.parametrize("name", VECTOR_WRAPPERS)
def test_vector_wrappers(name: str) -> None:
    plain, wrapped = play(make_vec()), play(VECTOR_WRAPPERS[name](make_vec()))
    for ours, theirs in zip(plain, wrapped, strict=True):
        np.testing.assert_array_equal(ours[3], theirs[3])
    told = wrapped[3][4]
    if name == "DictInfoToList":
        assert [one["object"] for one in told] == [OBJECT] * 2
        assert told[0]["flags"].keys() == {"open_enough", "cabinet_static"}
    if name == "RecordEpisodeStatistics":
        assert told["episode"]["l"].tolist() == [4, 4]
        np.testing.assert_allclose(told["episode"]["r"], sum(rewards for _, rewards, *_ in plain[:4]))


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")  # Python 3.12 and later, where there are threads
@pytest.mark.parametrize(
    ("mode", "context"), [*((mode, "fork") for mode in OBSERVATION_MODES), ("pointcloud", "spawn")]
)
def test_async_vector_env(mode: str, context: str) -> None:
    plain = play(make_vec(obs_mode=mode))
    env = gym.vector.AsyncVectorEnv([lambda: make(obs_mode=mode)] * 2, context=context)
    for ours, theirs in zip(plain, play(env), strict=True):
        np.testing.assert_array_equal(ours[1], theirs[1])
        seen = (x[0] if mode == "state" else x[0]["agent"] for x in (ours, theirs))
        np.testing.assert_array_equal(*seen)
