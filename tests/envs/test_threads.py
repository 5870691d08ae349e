"""Threads that draw one object at the same time: the bits of one thread, and of environments alone."""

import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from artiskill.envs.core import row_of
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.envs.wrappers import PointCloudDownsample, VectorPointCloudDownsample

ENVS, LEVELS, STEPS = 4, (3, 1, 4, 9), 2
TASKS = {"OpenCabinetDrawer": "cabinet-0003", "MoveBucket": "bucket-0004"}
SAMPLED = "sampled"  # a cloud of few points
CAMERAS = {"cameras.width": 60, "cameras.height": 24}


@pytest.fixture(autouse=True)
def threads_take_turns_often() -> Iterator[None]:
    """What two threads share shows the sooner, on few cores too."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(usual)


def settings(task: str, mode: str, quality: str) -> dict[str, Any]:
    return {
        "task": task,
        "objects": TASKS[task],
        "obs_mode": "pointcloud" if mode == SAMPLED else mode,
        "config": {**CAMERAS, "render.quality": quality},
    }


def leaves(tree: Any) -> list[np.ndarray]:
    return [leaf for value in tree.values() for leaf in leaves(value)] if isinstance(tree, dict) else [tree]


def differences(one: Any, other: Any) -> int:
    """How many bytes of two observations differ."""
    pairs = list(zip(leaves(one), leaves(other), strict=True))
    assert all(a.shape == b.shape and a.dtype == b.dtype for a, b in pairs)
    return sum(
        int((np.ascontiguousarray(a).view(np.uint8) != np.ascontiguousarray(b).view(np.uint8)).sum())
        for a, b in pairs
    )


def actions(shape: tuple[int, ...]) -> list[np.ndarray]:
    rng = np.random.default_rng(7)
    return [rng.uniform(-1.0, 1.0, (ENVS, *shape)).astype(np.float32) for _ in range(STEPS)]


def of_vector(mode: str, threads: int, **kwargs: Any) -> list[Any]:
    """Observations of a vector's reset and steps."""
    env: Any = ManipulationVectorEnv(ENVS, num_threads=threads, **kwargs)
    if mode == SAMPLED:
        env = VectorPointCloudDownsample(env, num_points=200)
    seen = [env.reset(options={"level": np.array(LEVELS)})[0]]
    seen += [env.step(action)[0] for action in actions(env.single_action_space.shape)]
    env.close()
    return seen


def of_single(mode: str, row: int, **kwargs: Any) -> list[Any]:
    """The same of one environment."""
    env: Any = ManipulationEnv(**kwargs)
    if mode == SAMPLED:
        env = PointCloudDownsample(env, num_points=200)
    seen = [env.reset(options={"level": LEVELS[row]})[0]]
    return seen + [env.step(action[row])[0] for action in actions(env.action_space.shape)]


@pytest.mark.parametrize("quality", ["fast", "picture"])
@pytest.mark.parametrize("mode", ["state", "rgbd", "pointcloud", SAMPLED])
@pytest.mark.parametrize("task", TASKS)
def test_threads_change_no_bit(task: str, mode: str, quality: str) -> None:
    """Environments alone, one after the other and each in a thread; a vector by one, two and three threads."""
    kwargs = settings(task, mode, quality)
    alone = [of_single(mode, row, **kwargs) for row in range(ENVS)]
    with ThreadPoolExecutor(ENVS) as pool:
        at_once = list(pool.map(lambda row: of_single(mode, row, **kwargs), range(ENVS)))
    for time in range(STEPS + 1):
        wrong = [differences(at_once[row][time], alone[row][time]) for row in range(ENVS)]
        assert wrong == [0] * ENVS, f"each in a thread, step {time}: bytes that differ, by environment"
    for threads in (1, 2, 3):
        for time, seen in enumerate(of_vector(mode, threads, **kwargs)):
            wrong = [differences(row_of(seen, row), alone[row][time]) for row in range(ENVS)]
            assert wrong == [0] * ENVS, f"{threads} threads, step {time}: bytes that differ, by environment"
