"""How an environment observes: what every mode has in common, and the mode `state`."""

from dataclasses import dataclass
from typing import Any, Protocol

import gymnasium as gym
import numpy as np

from artiskill.scene.scene import Scene
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.fields import field_bounds
from artiskill.tasks.task import Goal, Task


@dataclass(frozen=True, eq=False)
class Instant:
    """What an observation is made of; the same instant gives the same observation.

    Attributes:
        snapshot: with B = 1.
        goal: of the episode, with B = 1.
        level: of the episode.
        elapsed: environment steps since the episode's start.
    """

    snapshot: Snapshot
    goal: Goal
    level: int
    elapsed: int


class Observer(Protocol):
    """One observation mode of one environment."""

    @property
    def space(self) -> gym.Space[Any]:
        """Of the observations."""

    def enter(self, scene: Scene, target: str) -> None:
        """Get ready for episodes with this scene and target link; called whenever either changes."""

    def observe(self, instant: Instant) -> tuple[Any, dict[str, Any]]:
        """The observation, an element of `space`, and what the mode adds to `info`; the caller may keep both."""


class StateObserver:
    """The mode `state`: one vector, see `Task.state_fields`."""

    def __init__(self, task: Task) -> None:
        """Compute the space."""
        self._task = task
        self._upper = field_bounds(task.state_fields)
        self._lower = -self._upper
        self.space = gym.spaces.Box(self._lower, self._upper, dtype=np.float32)

    def enter(self, scene: Scene, target: str) -> None:
        """Nothing depends on the scene."""

    def observe(self, instant: Instant) -> tuple[np.ndarray, dict[str, Any]]:
        """(D,) float32, clipped to the space's bounds."""
        values = self._task.observe_state(instant.snapshot, instant.goal)[0]
        return np.minimum(np.maximum(values, self._lower), self._upper), {}
