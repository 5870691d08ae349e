"""A vector of environments does what single ones do, bit for bit: any mix of objects, threads, modes, resets."""

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from artiskill.assets.catalog import list_objects
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.options import OBSERVATION_MODES
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.tasks.registry import task_names

STEPS = 6  # of an episode: so that several end within a test


def objects_of(task: str) -> list[str]:
    """A few of every split: of several layouts, where the category has several."""
    ids = [*list_objects(split="train", task=task)[:2], *list_objects(split="test", task=task)[:1]]
    held_out = list_objects(split="ood", task=task)
    return [*ids, held_out[0], held_out[-1]]


def both(task: str, num_envs: int, mode: AutoresetMode, num_threads: int, **kwargs: Any) -> tuple[Any, Any]:
    kwargs = {"task": task, "objects": objects_of(task), "config": {"episode_steps": STEPS}} | kwargs
    reference = gym.vector.SyncVectorEnv(
        [lambda: ManipulationEnv(**kwargs) for _ in range(num_envs)], autoreset_mode=mode
    )
    vector = ManipulationVectorEnv(num_envs, **kwargs, num_threads=num_threads, autoreset_mode=mode)
    return vector, reference


def assert_equal(one: Any, other: Any, where: str = "") -> None:
    if isinstance(other, Mapping):
        assert set(one) == set(other), where
        for key in other:
            assert_equal(one[key], other[key], f"{where}/{key}")
    elif isinstance(other, tuple) or (isinstance(other, np.ndarray) and other.dtype == object):
        assert len(one) == len(other), where
        for a, b in zip(one, other, strict=True):
            assert_equal(a, b, where)
    elif isinstance(other, np.ndarray):
        assert one.dtype == other.dtype, where
        np.testing.assert_array_equal(one, other, err_msg=where)
    else:
        assert one == other, where


def run_both(vector: Any, reference: Any, steps: int, seed: int = 0) -> int:
    """Step both with the same actions; the number of episodes that ended."""
    rng, ended = np.random.default_rng(seed), 0
    assert vector.action_space == reference.action_space
    assert vector.observation_space == reference.observation_space
    assert_equal(vector.reset(seed=11), reference.reset(seed=11), "reset")
    for k in range(steps):
        actions = rng.uniform(-1, 1, vector.action_space.shape).astype(np.float32)
        found, wanted = vector.step(actions), reference.step(actions)
        assert_equal(found[0], wanted[0], f"observation {k}")
        for one, other, what in zip(found[1:4], wanted[1:4], ("reward", "terminated", "truncated"), strict=True):
            assert_equal(one, other, f"{what} {k}")
        assert_equal(found[4], wanted[4], f"info {k}")
        done = wanted[2] | wanted[3]
        ended += int(done.sum())
        if done.any() and vector.metadata["autoreset_mode"] is AutoresetMode.DISABLED:
            options = {"reset_mask": done}
            assert_equal(vector.reset(options=options), reference.reset(options=dict(options)), f"reset {k}")
    return ended


@pytest.mark.parametrize("task", task_names())
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_vector_equals_single_environments(task: str, mode: AutoresetMode) -> None:
    vector, reference = both(task, 5, mode, num_threads=2)
    assert run_both(vector, reference, 3 * STEPS) >= 10
    assert len({batch.simulation.scene.layout for batch in vector._episodes.group.batches}) >= 1


@pytest.mark.parametrize("task", task_names())
@pytest.mark.parametrize(("num_envs", "num_threads"), [(1, 1), (3, 1), (8, 2)])
def test_for_any_number_of_environments_and_threads(task: str, num_envs: int, num_threads: int) -> None:
    vector, reference = both(task, num_envs, AutoresetMode.NEXT_STEP, num_threads, reward_mode="sparse")
    run_both(vector, reference, STEPS + 3)


@pytest.mark.parametrize("task", ["OpenCabinetDoor", "MoveBucket"])
def test_operational_space(task: str) -> None:
    vector, reference = both(task, 3, AutoresetMode.NEXT_STEP, 2, control_mode="operational_space")
    run_both(vector, reference, STEPS + 3)


@pytest.mark.parametrize("obs_mode", [mode for mode in OBSERVATION_MODES if mode != "state"])
@pytest.mark.parametrize("task", ["OpenCabinetDrawer", "PushChair"])
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_what_cameras_see(task: str, obs_mode: str, mode: AutoresetMode) -> None:
    vector, reference = both(task, 3, mode, 2, obs_mode=obs_mode, config={"episode_steps": 2})
    assert run_both(vector, reference, 4) >= 3


@pytest.mark.slow
@pytest.mark.parametrize("task", task_names())
@pytest.mark.parametrize("num_threads", [1, 2])
def test_every_object_of_a_task_in_one_vector(task: str, num_threads: int) -> None:
    ids = [*list_objects(split="all", task=task), *list_objects(split="ood", task=task)]
    options: dict[str, Any] = {"object": ids, "level": list(range(len(ids)))}
    vector = ManipulationVectorEnv(len(ids), task=task, objects=ids, num_threads=num_threads)
    observation, _ = vector.reset(options=options)
    rng = np.random.default_rng(3)
    actions = rng.uniform(-1, 1, (10, *vector.action_space.shape)).astype(np.float32)
    seen = [vector.step(a)[:2] for a in actions]
    for k, object_id in enumerate(ids):
        single = ManipulationEnv(task, objects=ids)
        np.testing.assert_array_equal(single.reset(options={"object": object_id, "level": k})[0], observation[k])
        for action, (observations, rewards) in zip(actions, seen, strict=True):
            one, reward, *_ = single.step(action[k])
            np.testing.assert_array_equal(one, observations[k])
            assert reward == rewards[k]


@pytest.mark.parametrize("task", task_names())
def test_the_order_of_resets_does_not_matter(task: str) -> None:
    """Environments that are reset one by one, moving between layouts, go on as if they had always been so."""
    ids = objects_of(task)
    vector = ManipulationVectorEnv(4, task=task, objects=ids, num_threads=2)
    vector.reset(seed=0)
    for env, object_id in ((2, ids[-1]), (0, ids[0]), (3, ids[-1]), (2, ids[0]), (1, ids[-2])):
        mask = np.arange(4) == env
        vector.reset(options={"reset_mask": mask, "object": object_id, "level": 40 + env})
    final = {2: ids[0], 0: ids[0], 3: ids[-1], 1: ids[-2]}
    actions = np.random.default_rng(1).uniform(-1, 1, (5, *vector.action_space.shape)).astype(np.float32)
    seen = [vector.step(a)[0] for a in actions]
    for env, object_id in final.items():
        single = ManipulationEnv(task, objects=ids)
        single.reset(options={"object": object_id, "level": 40 + env})
        for action, observations in zip(actions, seen, strict=True):
            np.testing.assert_array_equal(single.step(action[env])[0], observations[env])


@pytest.mark.parametrize("task", task_names())
def test_states_travel_between_vector_and_single(task: str) -> None:
    ids = objects_of(task)
    vector, single = ManipulationVectorEnv(3, task=task, objects=ids), ManipulationEnv(task, objects=ids)
    vector.reset(seed=3)
    actions = np.random.default_rng(2).uniform(-1, 1, (8, *vector.action_space.shape)).astype(np.float32)
    for action in actions[:4]:
        vector.step(action)
    saved = vector.call("save_state")
    onward = [vector.step(action)[:2] for action in actions[4:]]
    for env in range(3):
        single.restore_state(saved[env])
        for action, (observations, rewards) in zip(actions[4:], onward, strict=True):
            observation, reward, *_ = single.step(action[env])
            np.testing.assert_array_equal(observation, observations[env])
            assert reward == rewards[env]
    vector.reset(seed=90)
    for env in range(3):
        vector.restore_state(2 - env, saved[env])
    for action, (observations, _) in zip(actions[4:], onward, strict=True):
        np.testing.assert_array_equal(vector.step(action[::-1])[0], observations[::-1])
