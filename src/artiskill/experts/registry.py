"""Which expert solves which task."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np

from artiskill.errors import PolicyError
from artiskill.experts.move_bucket import MoveBucketExpert
from artiskill.experts.open_cabinet import OpenCabinetExpert
from artiskill.experts.push_chair import PushChairExpert
from artiskill.robots.config import RobotConfig
from artiskill.sim.snapshot import Snapshot


class Expert(Protocol):
    """A privileged controller of one task.

    Attributes:
        config: its values, a dataclass.
    """

    config: Any

    def reset(self, snapshot: Snapshot, goal: Any) -> None:
        """Begin an episode at its first state (B = 1)."""

    def act(self, snapshot: Snapshot, goal: Any) -> np.ndarray:
        """Return the next action, (R,) in [-1, 1], of the control mode `joint`."""


_EXPERTS: Mapping[str, Callable[[RobotConfig, Any], Expert]] = {
    "OpenCabinetDrawer": OpenCabinetExpert,
    "OpenCabinetDoor": OpenCabinetExpert,
    "MoveBucket": MoveBucketExpert,
    "PushChair": PushChairExpert,
}


def make_expert(task: str, robot: RobotConfig, config: Any = None) -> Expert:
    """Return the expert of a task.

    Args:
        task: its name.
        robot: who acts.
        config: of the expert; by default the one that comes with the package, which is then read from its file.

    Raises:
        PolicyError: the task has no expert.
    """
    if task not in _EXPERTS:
        raise PolicyError(f"there is no expert for {task}; tasks with one: {', '.join(_EXPERTS)}")
    return _EXPERTS[task](robot, config)
