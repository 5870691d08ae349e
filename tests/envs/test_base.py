"""Environments pickle and copy: made anew, at the same instant, with the same future."""

import copy
import multiprocessing
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.options import OBSERVATION_MODES
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.envs.wrappers import PointCloudDownsample, VectorPointCloudDownsample
from artiskill.errors import DivergedError

TASK, OBJECTS = "OpenCabinetDrawer", ["cabinet-0001", "cabinet-0003", "cabinet-0010"]
SMALL = {"cameras.number": 1, "cameras.width": 64, "cameras.height": 48, "episode_steps": 8}
Copy = Callable[[Any], Any]


def pickled(env: Any) -> Any:
    return pickle.loads(pickle.dumps(env))


WAYS = (pickled, copy.deepcopy)


def bits(tree: Any) -> Any:
    """Everything in an observation or info, for exact comparison."""
    if isinstance(tree, dict):
        return {key: bits(value) for key, value in tree.items()}
    if isinstance(tree, tuple | list):
        return [bits(value) for value in tree]
    if isinstance(tree, np.ndarray) and tree.dtype == object:
        return [bits(value) for value in tree]
    if isinstance(tree, np.ndarray):
        return tree.dtype.str, tree.shape, tree.tobytes()
    return tree


def play(env: Any, steps: int, seed: int = 0) -> list[Any]:
    """All that some steps tell; a single environment starts anew where its episode ends."""
    rng = np.random.default_rng(seed)
    told = []
    for _ in range(steps):
        result = env.step(rng.uniform(-1, 1, env.action_space.shape).astype(np.float32))
        told.append(bits(result))
        if isinstance(result[2], bool) and (result[2] or result[3]):
            told.append(bits(env.reset()))
    return told


def single(obs_mode: str = "state", **kwargs: Any) -> ManipulationEnv:
    return ManipulationEnv(TASK, **{"objects": OBJECTS, "config": SMALL, **kwargs}, obs_mode=obs_mode)


def vector(obs_mode: str = "state", **kwargs: Any) -> ManipulationVectorEnv:
    return ManipulationVectorEnv(
        3, TASK, **{"objects": OBJECTS, "config": SMALL, "num_threads": 2, **kwargs}, obs_mode=obs_mode
    )


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("mode", OBSERVATION_MODES)
def test_a_copy_goes_on_with_the_same_bits(mode: str, way: Copy) -> None:
    env = single(mode)
    env.reset(seed=5)
    play(env, 5)
    other = way(env)
    assert play(other, 12, 1) == play(env, 12, 1), "into episodes whose levels the generator draws"


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("autoreset", ["next_step", "same_step"])
@pytest.mark.parametrize("mode", OBSERVATION_MODES)
def test_a_copied_vector_goes_on_with_the_same_bits(mode: str, autoreset: str, way: Copy) -> None:
    env = vector(mode, autoreset_mode=autoreset)
    env.reset(seed=5)
    play(env, 3)
    env.reset(options={"reset_mask": np.array([False, True, False])})  # out of step with the others
    play(env, 4)
    env.step(np.zeros((3, 13)))
    assert env._done.tolist() == [autoreset == "next_step", False, autoreset == "next_step"]
    other = way(env)
    assert play(other, 12, 1) == play(env, 12, 1)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("task", ["OpenCabinetDoor", "PushChair", "MoveBucket"])
def test_every_task_is_copied(task: str, way: Copy) -> None:
    for env in (
        ManipulationEnv(task, "test", control_mode="operational_space", reward_mode="sparse"),
        ManipulationVectorEnv(2, task, "test", control_mode="operational_space"),
    ):
        env.reset(seed=3)
        play(env, 3)
        other = way(env)
        assert play(other, 3, 1) == play(env, 3, 1)


@pytest.mark.parametrize("way", WAYS)
def test_copies_are_on_their_own(way: Copy) -> None:
    for env in (single(), vector()):
        env.reset(seed=0)
        alone = way(env)
        expected = play(alone, 3)
        other = way(env)
        play(other, 2, 7)
        assert play(env, 3) == expected


@pytest.mark.parametrize("way", WAYS)
def test_an_environment_before_its_first_reset_is_copied(way: Copy) -> None:
    for env in (single(), vector()):
        other = way(env)
        assert bits(other.reset(seed=2)) == bits(env.reset(seed=2))


@pytest.mark.parametrize("way", WAYS)
def test_generators_travel(way: Copy) -> None:
    env = single("rgbd")
    for space in (env.action_space, env.observation_space):
        space.seed(4)
        space.sample()
    env.reset(seed=0)
    env.reset()
    other = way(env)
    assert bits(other.action_space.sample()) == bits(env.action_space.sample())
    assert bits(other.observation_space.sample()) == bits(env.observation_space.sample())
    assert other.reset()[1]["level"] == env.reset()[1]["level"]
    assert other.np_random.random() == env.np_random.random()

    many = vector()
    many.action_space.seed(4)
    many.reset(seed=0)
    other = way(many)
    assert bits(other.action_space.sample()) == bits(many.action_space.sample())
    assert other.reset()[1]["level"].tolist() == many.reset()[1]["level"].tolist()


@pytest.mark.parametrize("way", WAYS)
def test_objects_of_ones_own_travel(way: Copy) -> None:
    mine = replace(load_object("generated:cabinet:8"), id="mine")
    other_one = replace(load_object("generated:cabinet:9"), id="other")
    env = single(objects=mine)
    many = vector(env_objects=["cabinet-0001", mine, ["cabinet-0003", mine]])
    for one in (env, many):
        one.reset(seed=1)
        state = one.save_state() if one is env else one.save_state(1)
        one.reset(options={"object": other_one})  # named by nothing but the environment's memory
        other = way(one)
        assert play(other, 12) == play(one, 12)
        other.restore_state(*((state,) if one is env else (1, state)))


def test_deep_copies_share_objects() -> None:
    mine = replace(load_object("generated:cabinet:8"), id="mine")
    env = single(objects=mine)
    env.reset(seed=0)
    assert copy.deepcopy(env).scene is env.scene


@pytest.mark.parametrize("way", WAYS)
def test_what_a_vector_was_told_later_travels(way: Copy) -> None:
    env = vector(copy=False, autoreset_mode="disabled")
    env.reset(seed=0)
    env.set_attr("objects", ["cabinet-0001", "test", "cabinet-0010"])
    other = way(env)
    assert not other.gives_copies
    assert other.num_threads == env.num_threads
    assert other.get_attr("objects") == env.get_attr("objects")
    assert bits(other.reset(seed=4)) == bits(env.reset(seed=4))


@pytest.mark.parametrize("way", WAYS)
def test_wrapped_environments_are_copied(way: Copy) -> None:
    made = gym.make(f"ArtiSkill/{TASK}-v0", objects=OBJECTS, config=SMALL, obs_mode="pointcloud")
    env = gym.wrappers.RecordEpisodeStatistics(PointCloudDownsample(made, num_points=32, frame="robot"))
    many = VectorPointCloudDownsample(vector("pointcloud"), num_points=32, method="uniform")
    for one in (env, many):
        one.reset(seed=0)
        play(one, 3)
        other = way(one)
        assert other.spec == one.spec
        results = play(other, 4, 1), play(one, 4, 1)
        assert without_times(results[0]) == without_times(results[1])


def without_times(results: list[Any]) -> list[Any]:
    """Without how long an episode took, which `RecordEpisodeStatistics` tells."""
    return [
        [{k: v for k, v in x.items() if k != "episode"} if isinstance(x, dict) else x for x in r] for r in results
    ]


def _go_on(sent: bytes, answer: Any) -> None:
    answer.send(play(pickle.loads(sent), 3))


def test_another_process_goes_on_with_the_same_bits() -> None:
    env = single()
    env.reset(seed=0)
    play(env, 2)
    here, there = multiprocessing.Pipe()
    worker = multiprocessing.get_context("spawn").Process(target=_go_on, args=(pickle.dumps(env), there))
    worker.start()
    there.close()
    assert here.recv() == play(env, 3)
    worker.join()


class Counting(ManipulationEnv):
    """A subclass with a constructor of its own."""

    def __init__(self, start: int) -> None:
        self.before = [start]
        super().__init__(TASK, OBJECTS)
        self.after = {"start": start}


@pytest.mark.parametrize("way", WAYS)
def test_subclasses_are_copied_with_what_they_add(way: Copy) -> None:
    env = Counting(3)
    env.reset(seed=0)
    other = way(env)
    assert (type(other), other.before, other.after) == (Counting, [3], {"start": 3})
    assert other.before is not env.before
    assert play(other, 2) == play(env, 2)


def test_a_shallow_copy_has_an_episode_of_its_own() -> None:
    env = single()
    env.reset(seed=0)
    other = copy.copy(env)
    assert play(other, 3) == play(env, 3)


def test_changed_configuration_stays_what_it_was() -> None:
    config = dict(SMALL)
    env = single(config=config)
    config["episode_steps"] = 99
    assert pickled(env).task.episode_steps == SMALL["episode_steps"]


def test_pickles_are_light() -> None:
    env = single("pointcloud", config={})
    env.reset(seed=0)
    assert len(pickle.dumps(env)) < 50_000


@pytest.mark.parametrize("way", WAYS)
def test_a_closed_vector_stays_closed(way: Copy) -> None:
    env = vector()
    env.reset(seed=0)
    env.close()
    with pytest.raises(ValueError, match="was closed"):
        way(env).step(np.zeros((3, 13)))


@pytest.mark.parametrize("way", WAYS)
def test_physics_that_ran_away_is_not_copied(way: Copy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # the engine leaves a log where it runs
    env, many = ManipulationEnv("PushChair", "chair-0002"), ManipulationVectorEnv(2, "PushChair", "chair-0002")
    for one, which in ((env, ()), (many, (1,))):
        one.reset(seed=0)
        state = one.save_state(*which)
        rows = state.simulation.rows.copy()
        rows[0, 40:60] = 1e10
        one.restore_state(*which, replace(state, simulation=replace(state.simulation, rows=rows)))
        with pytest.raises(DivergedError):
            one.step(np.zeros(one.action_space.shape))
        with pytest.raises(DivergedError, match=rf"environments \[{len(which)}\].*reset them"):
            way(one)
        one.restore_state(*which, state)
        assert play(way(one), 2) == play(one, 2)
