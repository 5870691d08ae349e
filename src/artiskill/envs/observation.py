"""Observations of all environments: what an observer is, the mode `state`, and the arrays that observers fill."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol

import gymnasium as gym
import numpy as np

from artiskill.envs.episodes import Episodes
from artiskill.errors import ConfigError
from artiskill.scene.scene import Scene
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.state_vector import field_bounds
from artiskill.tasks.task import Goal, Task


@dataclass(frozen=True, eq=False)
class ObservationContext:
    """What an observation is made of; the same context gives the same observation.

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
    """An observation mode that observes one environment at a time."""

    @property
    def space(self) -> gym.Space[Any]:
        """Of the observations."""

    def enter(self, scene: Scene, target: str) -> None:
        """Prepare for episodes with this scene and target link; called whenever either changes."""

    def observe(self, context: ObservationContext, out: Any) -> dict[str, Any]:
        """Write the observation into `out`, an `empty_observation`; return what the mode adds to `info`."""


class StateObserver:
    """The mode `state`: one vector, see `Task.state_fields`; observes all environments of a snapshot at once."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._upper = field_bounds(task.state_fields)
        self._lower = -self._upper
        self.space = gym.spaces.Box(self._lower, self._upper, dtype=np.float32)

    def observe_all(self, snapshot: Snapshot, goal: Goal, out: np.ndarray) -> None:
        """Write (B, D) float32, clipped to the space's bounds."""
        values = self._task.observe_state(snapshot, goal)
        np.minimum(np.maximum(values, self._lower), self._upper, out=out)


MakeObserver = Callable[[Task], Observer | StateObserver]


class ObservationBuffers:
    """Observations of all episodes, and the arrays that they are written into.

    Args:
        episodes: that are observed.
        make_observer: of an observation mode; called for each environment.
        num_threads: threads that render.
        gives_copies: whether `arrays` are the caller's to keep; else each call writes into the same ones.

    Attributes:
        space: of one environment's observations.
        arrays: the observations of the last call, with batch (B,).
        stale: (B,) bool, whose part of `arrays` is out of date: all, once `arrays` are new.
    """

    def __init__(
        self, episodes: Episodes, make_observer: MakeObserver, num_threads: int, gives_copies: bool
    ) -> None:
        self._episodes, self._gives_copies, self.is_closed = episodes, gives_copies, False
        first = make_observer(episodes.task)
        self.space = first.space
        self._state_observer: StateObserver | None = None
        self._observers: list[Observer] = []
        if isinstance(first, StateObserver):
            self._state_observer = first
        else:
            others: list[Any] = [make_observer(episodes.task) for _ in range(1, episodes.count)]
            self._observers = [first, *others]
        self._pool = (
            ThreadPoolExecutor(num_threads, "artiskill-render") if self._observers and num_threads > 1 else None
        )
        self.arrays = empty_observation(self.space, (episodes.count,))
        self.stale = np.ones(episodes.count, dtype=bool)
        for env in range(episodes.count if episodes.begun else 0):
            self.enter(env)

    def enter(self, env: int) -> None:
        """Prepare for another scene or target link of an environment."""
        self.stale[env] = True
        if self._observers:
            self._observers[env].enter(self._episodes.group.scene_of(env), self._episodes.targets[env])

    def renew(self) -> None:
        """Begin a call's observations: what the caller got from the last one stays as it is."""
        if self._gives_copies:
            self.arrays = empty_observation(self.space, (self._episodes.count,))
            self.stale[:] = True

    def observe(self, envs: np.ndarray | None = None) -> dict[int, dict[str, Any]]:
        """Observe environments into their rows of `arrays`.

        Args:
            envs: (B,) bool; None for all.

        Returns:
            What the mode adds to `info`, by environment.
        """
        added: dict[int, dict[str, Any]] = {}
        if self._state_observer is not None:
            self._observe_states(self._state_observer, envs)
        else:
            chosen = range(self._episodes.count) if envs is None else np.flatnonzero(envs).tolist()
            found = (
                map(self._observe_one, chosen) if self._pool is None else self._pool.map(self._observe_one, chosen)
            )
            added = dict(zip(chosen, found, strict=True))
        self.stale[slice(None) if envs is None else envs] = False
        return added

    def _observe_states(self, observer: StateObserver, envs: np.ndarray | None) -> None:
        for batch in self._episodes.group.batches:
            if batch.in_order and envs is None:
                observer.observe_all(batch.snapshot, batch.goal, self.arrays)
                continue
            values = np.empty((len(batch.members), *self.arrays.shape[1:]), dtype=self.arrays.dtype)
            observer.observe_all(batch.snapshot, batch.goal, values)
            slots = batch.taken if envs is None else batch.taken[envs[batch.members[batch.taken]]]
            self.arrays[batch.members[slots]] = values[slots]

    def _observe_one(self, env: int) -> dict[str, Any]:
        episodes = self._episodes
        batch, slot = episodes.group.batch_of(env), int(episodes.group.slot[env])
        level, elapsed = int(episodes.levels[env]), int(episodes.progress.elapsed[env])
        context = ObservationContext(batch.snapshot, batch.goal, slot, level, elapsed)
        return self._observers[env].observe(context, row_of(self.arrays, env))

    def close(self) -> None:
        """Stop the threads that render."""
        self.is_closed = True
        if self._pool is not None:
            self._pool.shutdown()

    def check_open(self) -> None:
        """Raise `ConfigError` after `close`."""
        if self.is_closed:
            raise ConfigError("this vector environment was closed: make another one")


def empty_observation(space: gym.Space[Any], batch: tuple[int, ...] = ()) -> Any:
    """Return arrays to write an observation of a space into, or a batch of them; nested as the space is."""
    if isinstance(space, gym.spaces.Dict):
        return {key: empty_observation(below, batch) for key, below in space.items()}
    assert space.shape is not None, "observations are arrays"
    return np.empty((*batch, *space.shape), dtype=space.dtype)


def row_of(tree: Any, row: int) -> Any:
    """Return one environment's part of a batch of observations, as views."""
    return {key: row_of(value, row) for key, value in tree.items()} if isinstance(tree, dict) else tree[row]


def copied(tree: Any) -> Any:
    """Return a copy of all arrays of an observation."""
    return {key: copied(value) for key, value in tree.items()} if isinstance(tree, dict) else tree.copy()
