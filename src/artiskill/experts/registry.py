"""Which expert solves which task."""

from typing import Any, Protocol

import numpy as np

from artiskill.errors import PolicyError
from artiskill.robots.config import RobotConfig
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.registry import load_reference, task_names, task_spec


class Expert(Protocol):
    """A privileged controller of one task; its class is called with robot and configuration (None: its own).

    Attributes:
        config: its values, a dataclass.
    """

    config: Any

    def reset(self, snapshot: Snapshot, goal: Any) -> None:
        """Begin an episode at its first state (B = 1)."""

    def act(self, snapshot: Snapshot, goal: Any) -> np.ndarray:
        """Return the next action, (R,) in [-1, 1], of the control mode `joint`."""


def make_expert(task: str, robot: RobotConfig, config: Any = None) -> Expert:
    """Return the expert of a task.

    Args:
        task: its name.
        robot: who acts.
        config: of the expert; by default the one that comes with it, which is then read from its file.

    Raises:
        UnknownNameError: there is no such task.
        PolicyError: the task has no expert.
    """
    reference = task_spec(task).expert
    if reference is None:
        with_one = (name for name in task_names() if task_spec(name).expert is not None)
        raise PolicyError(
            f"there is no expert for {task}; tasks with one: {', '.join(with_one)}. Register a "
            "task that resembles one of them with like=, or with expert=: docs/experts.md lists them"
        )
    expert: Expert = load_reference(reference, f"expert of {task}")(robot, config)
    return expert
