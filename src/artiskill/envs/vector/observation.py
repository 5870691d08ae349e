"""Observations of all environments of a vector at once: one call for `state`, threads for what cameras see."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Protocol

import gymnasium as gym
import numpy as np

from artiskill.envs.observation import ObservationContext, Observer, StateObserver
from artiskill.envs.vector.fleet import Fleet
from artiskill.scene.scene import Scene
from artiskill.tasks.task import Task


class VectorObserver(Protocol):
    """One observation mode of a vector."""

    @property
    def space(self) -> gym.Space[Any]:
        """Of one environment's observations."""

    def enter(self, env: int, scene: Scene, target: str) -> None:
        """An environment has another scene or target link."""

    def observe(
        self, fleet: Fleet, envs: np.ndarray, levels: np.ndarray, elapsed: np.ndarray, out: Any
    ) -> dict[int, dict[str, Any]]:
        """Write observations of some environments into their rows of `out`.

        Args:
            fleet: all environments.
            envs: sorted indices of those that are observed.
            levels: (B,) of the episodes.
            elapsed: (B,) environment steps since their start.
            out: an `empty_observation` with batch (B,).

        Returns:
            What the mode adds to `info`, by environment.
        """

    def close(self) -> None:
        """Stop threads, if it has any."""


class VectorStateObserver:
    """The mode `state`."""

    def __init__(self, task: Task) -> None:
        """Compute the space."""
        self._single = StateObserver(task)
        self.space = self._single.space

    def enter(self, env: int, scene: Scene, target: str) -> None:
        """Nothing depends on the scene."""

    def observe(
        self, fleet: Fleet, envs: np.ndarray, levels: np.ndarray, elapsed: np.ndarray, out: np.ndarray
    ) -> dict[int, dict[str, Any]]:
        """See `VectorObserver`."""
        wanted = np.zeros(len(out), dtype=bool)
        wanted[envs] = True
        for squad, taken, members in fleet:
            values = np.empty((len(squad.members), *out.shape[1:]), dtype=out.dtype)
            self._single.observe_all(squad.snapshot, squad.goal, values)
            chosen = wanted[members]
            out[members[chosen]] = values[taken[chosen]]
        return {}

    def close(self) -> None:
        """See `VectorObserver`."""


class VectorVisionObserver:
    """A mode with pictures: an observer for each environment, the work shared by threads."""

    def __init__(self, make_observer: Callable[[], Observer], num_envs: int, num_threads: int) -> None:
        """Make the observers."""
        self._observers = [make_observer() for _ in range(num_envs)]
        self.space = self._observers[0].space
        self._pool = ThreadPoolExecutor(num_threads, "artiskill-eyes") if num_threads > 1 else None

    def enter(self, env: int, scene: Scene, target: str) -> None:
        """See `VectorObserver`."""
        self._observers[env].enter(scene, target)

    def observe(
        self, fleet: Fleet, envs: np.ndarray, levels: np.ndarray, elapsed: np.ndarray, out: dict[str, Any]
    ) -> dict[int, dict[str, Any]]:
        """See `VectorObserver`."""

        def see(env: int) -> dict[str, Any]:
            squad = fleet.squad_of(env)
            instant = ObservationContext(
                squad.snapshot, squad.goal, int(fleet.slot[env]), int(levels[env]), int(elapsed[env])
            )
            return self._observers[env].observe(instant, row_of(out, env))

        order: Sequence[int] = envs.tolist()
        found = self._pool.map(see, order) if self._pool is not None else map(see, order)
        return dict(zip(order, found, strict=True))

    def close(self) -> None:
        """See `VectorObserver`."""
        if self._pool is not None:
            self._pool.shutdown()


def row_of(tree: Any, row: int) -> Any:
    """One environment's part of a batch of observations, as views."""
    return {key: row_of(value, row) for key, value in tree.items()} if isinstance(tree, dict) else tree[row]


def copied(tree: Any) -> Any:
    """A copy of all arrays of an observation."""
    return {key: copied(value) for key, value in tree.items()} if isinstance(tree, dict) else tree.copy()
