"""How an environment observes: what every mode has in common, and the mode `state`."""

from dataclasses import dataclass
from typing import Any, Protocol

import gymnasium as gym
import numpy as np

from artiskill.scene.scene import Scene
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.state_vector import field_bounds
from artiskill.tasks.task import Goal, Task


@dataclass(frozen=True, eq=False)
class ObservationContext:
    """What an observation is made of; the same instant gives the same observation.

    Attributes:
        snapshot: of B environments.
        goal: of their episodes.
        row: which of the B is observed.
        level: of its episode.
        elapsed: environment steps since the episode's start.
    """

    snapshot: Snapshot
    goal: Goal
    row: int
    level: int
    elapsed: int


class Observer(Protocol):
    """One observation mode of one environment."""

    @property
    def space(self) -> gym.Space[Any]:
        """Of the observations."""

    def enter(self, scene: Scene, target: str) -> None:
        """Get ready for episodes with this scene and target link; called whenever either changes."""

    def observe(self, instant: ObservationContext, out: Any) -> dict[str, Any]:
        """Write the observation into `out`, an `empty_observation`; return what the mode adds to `info`."""


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

    def observe(self, instant: ObservationContext, out: np.ndarray) -> dict[str, Any]:
        """(D,) float32, clipped to the space's bounds."""
        assert len(instant.snapshot.time_s) == 1, "of a batch, all environments are observed at once"
        self.observe_all(instant.snapshot, instant.goal, out[None])
        return {}

    def observe_all(self, snapshot: Snapshot, goal: Goal, out: np.ndarray) -> None:
        """(B, D) float32 of all environments of a snapshot."""
        values = self._task.observe_state(snapshot, goal)
        np.minimum(np.maximum(values, self._lower), self._upper, out=out)


def empty_observation(space: gym.Space[Any], batch: tuple[int, ...] = ()) -> Any:
    """Arrays to write an observation of a space into, or a batch of them; nested as the space is."""
    if isinstance(space, gym.spaces.Dict):
        return {key: empty_observation(below, batch) for key, below in space.items()}
    assert space.shape is not None, "observations are arrays"
    return np.empty((*batch, *space.shape), dtype=space.dtype)
