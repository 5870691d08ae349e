"""The batched core of both environments: B episodes of one task, stepped, evaluated and observed at once.

`ManipulationEnv` is a view of it with B = 1, `ManipulationVectorEnv` with any B.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import gymnasium as gym
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.envs.batches import Batch, BatchGroup
from artiskill.envs.control import Control
from artiskill.envs.sampling import EpisodeSampler
from artiskill.errors import Cause, ConfigError, DivergedError, ResetNeededError
from artiskill.geometry.arrays import columns
from artiskill.scene.scene import Scene, cached_scene
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.state_vector import field_bounds
from artiskill.tasks.task import Goal, Task

_GOALS = 512  # that are kept: of the last objects and targets


class Episodes:
    """B episodes of a task.

    A flag counts once it has held for `task.hold_steps` consecutive steps; an episode is solved in the step in
    which all flags count at the same time.

    Args:
        task: what is asked.
        control: what actions mean.
        samplers: what draws each environment's objects.
        num_threads: threads that step.
        end_at_success: whether an episode is over once it is solved.

    Attributes:
        end_at_success: whether an episode is over once it is solved.
        samplers: of each environment.
        group: the batches that environments are in.
        levels: (B,) int64.
        objects: (B,) ids, None before the first episode.
        targets: (B,) names of links.
        elapsed: (B,) environment steps since the episode's first state.
        streaks: (B, F) consecutive steps that each flag has held up to now.
        flags: name -> (B,) bool, the conditions after the last step.
        terms: name -> (B,) unweighted reward terms after the last step.
    """

    def __init__(
        self,
        task: Task,
        control: Control,
        samplers: Sequence[EpisodeSampler],
        num_threads: int,
        end_at_success: bool = True,
    ) -> None:
        self.task, self.control, self.samplers = task, control, list(samplers)
        self.end_at_success = end_at_success
        self.count = len(samplers)
        self.group = BatchGroup(self.count, num_threads)
        self.levels = np.zeros(self.count, dtype=np.int64)
        self.objects, self.targets = (np.full(self.count, None, dtype=object) for _ in range(2))
        self.elapsed = np.zeros(self.count, dtype=np.int64)
        self.streaks = np.zeros((self.count, len(task.flag_names)), dtype=np.int64)
        self.flags: dict[str, np.ndarray] = {}
        self.terms: dict[str, np.ndarray] = {}
        self._goal_of = lru_cache(_GOALS)(task.make_goal)
        self._is_checked = False  # what the task's functions return

    @property
    def begun(self) -> bool:
        """Whether there has been a first reset."""
        return self.objects[0] is not None

    def check_begun(self, what: str) -> None:
        """Raise `ResetNeededError` before the first reset."""
        if not self.begun:
            raise ResetNeededError(f"call reset() before {what}")

    def start(
        self, envs: Sequence[int], levels: Sequence[int], objects: Sequence[Any], targets: Sequence[str | None]
    ) -> list[int]:
        """Start episodes; objects and targets that are None are drawn by the levels.

        Returns:
            The environments whose scene or target has changed.

        Raises:
            UnknownNameError: an unknown object or target link; then no episode is started.
            AssetError: an object that does not fit the task; then no episode is started.
        """
        drawn = [
            self.samplers[env].draw(level, obj, target)
            for env, level, obj, target in zip(envs, levels, objects, targets, strict=True)
        ]
        states = [
            self.task.sample_initial_state(obj, level_generator(level, RngStream.INITIAL_STATE))
            for (obj, _), level in zip(drawn, levels, strict=True)
        ]
        scenes = [self.scene_with(obj, env) for (obj, _), env in zip(drawn, envs, strict=True)]
        placed, changed = self.place(envs, levels, scenes, [target for _, target in drawn])
        for batch, indices, slots in placed:
            batch.simulation.reset([states[k] for k in indices], slots, [scenes[k] for k in indices])
            batch.refresh()
        self.elapsed[envs], self.streaks[envs] = 0, 0
        return changed

    def scene_with(self, obj: ArticulatedObject, env: int) -> Scene:
        """Return the task's scene with an object: the environment's own, if that has this object."""
        if self.begun and self.group.scene_of(env).object is obj:
            return self.group.scene_of(env)
        return cached_scene(self.task.robot, obj, self.task.physics, self.task.props)

    def place(
        self, envs: Sequence[int], levels: Sequence[int], scenes: Sequence[Scene], targets: Sequence[str]
    ) -> tuple[list[tuple[Batch, list[int], list[int]]], list[int]]:
        """Give environments a level, a scene and a target; the caller then resets or restores their simulations.

        Returns:
            What `BatchGroup.place` returns, and the environments whose scene or target has changed.
        """
        named = list(zip(envs, levels, scenes, targets, strict=True))
        goals = [self._goal_of(scene.object, target) for _, _, scene, target in named]
        changed = [
            env
            for env, _, scene, target in named
            if not self.begun or self.group.scene_of(env) is not scene or self.targets[env] != target
        ]
        placed = self.group.place(envs, scenes, goals)
        for env, level, scene, target in named:
            self.levels[env], self.objects[env], self.targets[env] = level, scene.object.id, target
        return placed, changed

    def step(self, actions: np.ndarray, resting: np.ndarray | None = None) -> dict[int, Cause]:
        """Step the physics of all environments, or of those that do not rest.

        Args:
            actions: (B, A).
            resting: (B,) bool; None if none rests.

        Returns:
            Environments whose physics diverged, and why; all others have stepped.
        """
        diverged: dict[int, Cause] = {}
        for batch in self.group.batches:
            rows, slots = actions, None
            if not batch.in_order:
                rows = np.zeros((len(batch.members), actions.shape[1]))
                rows[batch.taken] = actions[batch.members[batch.taken]]
            if not batch.in_order or resting is not None:
                slots = batch.taken if resting is None else batch.taken[~resting[batch.members[batch.taken]]]
                if not slots.size:
                    continue
            targets = self.control.to_targets(rows, batch.snapshot)
            try:
                batch.simulation.step(targets, slots)
            except DivergedError as error:
                diverged |= {int(batch.members[slot]): cause for slot, cause in error.causes.items()}
            batch.snapshot = batch.simulation.snapshot()
        return diverged

    def evaluate(self) -> None:
        """Compute flags and reward terms of the present snapshots.

        Raises:
            ConfigError: the first time, that the task's functions return something else than they should.
        """
        self.flags, self.terms = {}, {}
        evaluate = self.task.evaluate if self._is_checked else self.task.evaluate_checked
        for batch in self.group.batches:
            flags, terms = evaluate(batch.snapshot, batch.goal)
            if batch.in_order:
                self.flags, self.terms = flags, terms
            else:
                _scatter(flags, batch, self.count, self.flags)
                _scatter(terms, batch, self.count, self.terms)
        self._is_checked = True

    def advance(self, active: np.ndarray | None = None) -> None:
        """Count one step with the present flags, of all environments or of the active ones, (B,) bool."""
        held = columns([self.flags[name] for name in self.task.flag_names])
        if active is None:
            self.elapsed += 1
            self.streaks += 1
            self.streaks *= held
        else:
            self.elapsed += active
            self.streaks += active[:, None]
            self.streaks *= held | ~active[:, None]

    @property
    def counted(self) -> np.ndarray:
        """Which flags count, (B, F) bool."""
        return self.streaks >= self.task.hold_steps

    def outcome(
        self, is_dense: bool, resting: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rewards, terminations and truncations of a step, (B,) each; 0 and False where episodes rest."""
        success: np.ndarray = np.logical_and.reduce(self.counted, axis=1)
        rewards = self._dense_rewards() if is_dense else success.astype(np.float64)
        terminated = success if self.end_at_success else np.zeros_like(success)
        truncated = (self.elapsed >= self.task.episode_steps) & ~terminated
        if resting is not None:
            rewards[resting] = 0.0
            return rewards, terminated & ~resting, truncated & ~resting
        return rewards, terminated, truncated

    def _dense_rewards(self) -> np.ndarray:
        if self.count == 1:  # a number takes a fraction of the time of an array of one, and has the same bits
            return np.array([self.task.dense_reward({name: term.item() for name, term in self.terms.items()})])
        rewards: np.ndarray = self.task.dense_reward(self.terms)
        return rewards

    def info(self) -> dict[str, Any]:
        """Return what `info` says of all episodes in every mode, as arrays (B,)."""
        counted = self.counted
        return {
            "object": self.objects.copy(),
            "level": self.levels.copy(),
            "target": self.targets.copy(),
            "success": counted.all(axis=1),
            "flags": {name: counted[:, k].copy() for k, name in enumerate(self.task.flag_names)},
            "reward_terms": self.terms,
        }

    def info_of(self, env: int) -> dict[str, Any]:
        """Return what `info` says of one episode, as plain values."""
        counted = self.counted[env].tolist()
        return {
            "object": self.objects[env],
            "level": int(self.levels[env]),
            "target": self.targets[env],
            "success": all(counted),
            "flags": dict(zip(self.task.flag_names, counted, strict=True)),
            "reward_terms": {name: term.item(env) for name, term in self.terms.items()},
        }


def _scatter(values: Mapping[str, np.ndarray], batch: Batch, count: int, out: dict[str, np.ndarray]) -> None:
    """Write arrays of a batch's slots into arrays of all environments, (B,)."""
    for name, array in values.items():
        out.setdefault(name, np.empty(count, array.dtype))[batch.members[batch.taken]] = array[batch.taken]


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
        self.arrays: Any = empty_observation(self.space, (episodes.count,))
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
            self.arrays = None  # first: memory that the caller has freed is used again while it is in the cache
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
        level, elapsed = int(episodes.levels[env]), int(episodes.elapsed[env])
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
