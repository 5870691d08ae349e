"""What tests of several tasks share: snapshots after some steps, and their conversion to another array library."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.scene.scene import build_scene
from artiskill.sim.simulation import Simulation
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.task import Task

Play = Callable[[Task, str, int], tuple[Snapshot, Any]]


def play(task: Task, object_id: str, steps: int) -> tuple[Snapshot, Any]:
    """The instant after random steps of level 0, with B = 1, and the goal."""
    obj = load_object(object_id)
    simulation = Simulation(build_scene(task.robot, obj, task.physics, task.props))
    simulation.reset([task.sample_initial_state(obj, level_generator(0, RngStream.INITIAL_STATE))])
    rng = np.random.default_rng(0)
    for _ in range(steps):
        simulation.step(rng.uniform(-0.5, 0.5, (1, 22)))
    return simulation.snapshot(), task.make_goal(obj, obj.links[0].name)


def answers(task: Task, snapshot: Snapshot, goal: Any) -> dict[str, Any]:
    """All that a task says of an instant."""
    flags = task.flags(snapshot, goal)
    terms = task.reward_terms(snapshot, goal, flags)
    return {**flags, **terms, "state": task.observe_state(snapshot, goal)}


def converted(value: Any, asarray: Callable[[np.ndarray], Any]) -> Any:
    """A snapshot or goal whose arrays come from another library."""
    arrays = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    return type(value)(**{k: asarray(v.copy()) if isinstance(v, np.ndarray) else v for k, v in arrays.items()})


@pytest.fixture(name="play", scope="session")
def play_fixture() -> Play:
    return play


@pytest.fixture(scope="session")
def assert_torch_agrees() -> Callable[[Task, Snapshot, Any], None]:
    """Checks that a task answers the same on torch tensors; skips where torch is not installed."""

    def check(task: Task, snapshot: Snapshot, goal: Any) -> None:
        torch = pytest.importorskip("torch", reason="torch tensors are tried where torch is installed")
        ours = answers(task, snapshot, goal)
        theirs = answers(task, *(converted(value, torch.asarray) for value in (snapshot, goal)))
        for name, value in ours.items():
            assert isinstance(theirs[name], torch.Tensor), name
            np.testing.assert_allclose(theirs[name].numpy(), value, atol=1e-7, err_msg=name)

    return check
