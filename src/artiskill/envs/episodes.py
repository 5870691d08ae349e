"""`Episodes`: the batched core of both environments, B episodes of one task.

It draws what an episode is about, steps and evaluates all episodes at once, and saves and restores them. The
environments are views of it: `ManipulationEnv` with B = 1, `ManipulationVectorEnv` with any B.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.envs.batches import FREE, Batch, BatchGroup
from artiskill.envs.control import Control
from artiskill.envs.sampling import EpisodeSampler
from artiskill.envs.state import EnvState, check_episode
from artiskill.errors import Cause, DivergedError, ResetNeededError
from artiskill.geometry.arrays import columns
from artiskill.scene.scene import Scene, cached_scene
from artiskill.sim.states import check_state
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.task import Task

_GOALS = 512  # that are kept: of the last objects and targets


class Episodes:
    """B episodes of a task.

    Args:
        task: what is asked.
        control: what actions mean.
        samplers: what draws each environment's objects.
        num_threads: threads that step.

    Attributes:
        samplers: of each environment.
        group: the batches that environments are in.
        progress: steps and flags of the episodes so far.
        levels: (B,) int64.
        objects: (B,) ids, None before the first episode.
        targets: (B,) names of links.
        flags: name -> (B,) bool, the conditions after the last step.
        terms: name -> (B,) unweighted reward terms after the last step.
    """

    def __init__(self, task: Task, control: Control, samplers: Sequence[EpisodeSampler], num_threads: int) -> None:
        self.task, self.control, self.samplers = task, control, list(samplers)
        self.count = len(samplers)
        self.group = BatchGroup(self.count, num_threads)
        self.progress = EpisodeProgress(self.count, task.flag_names, task.hold_steps)
        self.levels = np.zeros(self.count, dtype=np.int64)
        self.objects, self.targets = (np.full(self.count, None, dtype=object) for _ in range(2))
        self.flags: dict[str, np.ndarray] = {}
        self.terms: dict[str, np.ndarray] = {}
        self._goal_of = lru_cache(_GOALS)(task.make_goal)

    @property
    def begun(self) -> bool:
        """Whether there has been a first reset."""
        return self.objects[0] is not None

    def check_begun(self, what: str) -> None:
        """Raise `ResetNeededError` before the first reset."""
        if not self.begun:
            raise ResetNeededError(f"call reset() before {what}")

    # -- start and step ------------------------------------------------------------------------------------------

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
        scenes = [self._scene_with(obj, env) for (obj, _), env in zip(drawn, envs, strict=True)]
        names = [target for _, target in drawn]
        changed = self._changed(envs, scenes, names)
        goals = [self._goal_of(obj, target) for obj, target in drawn]
        for batch, chosen in self.group.place(envs, scenes, goals):
            slots = [int(self.group.slot[envs[k]]) for k in chosen]
            batch.simulation.reset([states[k] for k in chosen], slots, [scenes[k] for k in chosen])
            batch.refresh()
        self._name(envs, levels, scenes, names)
        self.progress.restart(envs)
        return changed

    def step(self, actions: np.ndarray, resting: np.ndarray | None = None) -> dict[int, Cause]:
        """Step the physics of all environments, or of those that do not rest.

        Args:
            actions: (B, A).
            resting: (B,) bool; None where nobody rests.

        Returns:
            Environments whose physics diverged, and why; all others have stepped.
        """
        diverged: dict[int, Cause] = {}
        for batch in self.group.batches:
            active = None if batch.in_order and resting is None else _active_slots(batch, resting)
            if active is not None and not active.any():
                continue
            rows = actions if batch.in_order else np.zeros((len(batch.members), actions.shape[1]))
            if not batch.in_order:
                rows[batch.taken] = actions[batch.members[batch.taken]]
            targets = self.control.to_targets(rows, batch.snapshot)
            try:
                batch.simulation.step(targets, None if active is None or active.all() else np.flatnonzero(active))
            except DivergedError as error:
                diverged |= {int(batch.members[slot]): cause for slot, cause in error.causes.items()}
            batch.snapshot = batch.simulation.snapshot()
        return diverged

    def evaluate(self) -> None:
        """Compute flags and reward terms of the present snapshots."""
        flags: dict[str, np.ndarray] = {}
        terms: dict[str, np.ndarray] = {}
        for batch in self.group.batches:
            found = self.task.flags(batch.snapshot, batch.goal)
            found_terms = self.task.reward_terms(batch.snapshot, batch.goal, found)
            if batch.in_order:
                flags, terms = found, found_terms
            else:
                _scatter(found, batch, self.count, flags)
                _scatter(found_terms, batch, self.count, terms)
        self.flags, self.terms = flags, terms

    def outcome(
        self, is_dense: bool, resting: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rewards, terminations and truncations of a step, (B,) each; 0 and False where episodes rest."""
        success = self.progress.success
        rewards = self._dense_rewards() if is_dense else success.astype(np.float64)
        truncated = (self.progress.elapsed >= self.task.episode_steps) & ~success
        if resting is not None:
            rewards[resting] = 0.0
            return rewards, success & ~resting, truncated & ~resting
        return rewards, success, truncated

    def _dense_rewards(self) -> np.ndarray:
        if self.count == 1:  # a number takes a fraction of the time of an array of one, and has the same bits
            return np.array([self.task.dense_reward({name: term.item() for name, term in self.terms.items()})])
        rewards: np.ndarray = self.task.dense_reward(self.terms)
        return rewards

    def info(self) -> dict[str, Any]:
        """Return what `info` says of all episodes in every mode, as arrays (B,)."""
        counted = self.progress.counted
        return {
            "object": self.objects.copy(),
            "level": self.levels.copy(),
            "target": self.targets.copy(),
            "success": counted.all(axis=1),
            "flags": {name: counted[:, k].copy() for k, name in enumerate(self.progress.flag_names)},
            "reward_terms": self.terms,
        }

    def info_of(self, env: int) -> dict[str, Any]:
        """Return what `info` says of one episode, as plain values."""
        counted = self.progress.counted[env].tolist()
        return {
            "object": self.objects[env],
            "level": int(self.levels[env]),
            "target": self.targets[env],
            "success": all(counted),
            "flags": dict(zip(self.progress.flag_names, counted, strict=True)),
            "reward_terms": {name: term.item(env) for name, term in self.terms.items()},
        }

    # -- save and restore ----------------------------------------------------------------------------------------

    def save(self, env: int) -> EnvState:
        """Return the state of one episode.

        Raises:
            ResetNeededError: before the first reset.
        """
        self.check_begun("save_state()")
        batch, slot = self.group.batch_of(env), int(self.group.slot[env])
        return EnvState(
            task=self.task.name,
            object=self.objects[env],
            target=self.targets[env],
            level=int(self.levels[env]),
            simulation=batch.simulation.save([slot]),
            elapsed=int(self.progress.elapsed[env]),
            streaks=self.progress.streaks[env].copy(),
        )

    def restore(self, envs: Sequence[int], states: Sequence[EnvState]) -> list[int]:
        """Restore saved episodes; nothing has changed if it raises.

        Returns:
            The environments whose scene or target has changed.

        Raises:
            StateError: a state is of another task, object, robot, physics configuration or props, or damaged.
            UnknownNameError: there is no such object or target link.
        """
        objects, scenes = [], []
        for env, state in zip(envs, states, strict=True):
            check_episode(state, self.task.name, len(self.task.flag_names))
            obj = self.samplers[env].find(state.object)
            self.samplers[env].check_target(obj, state.target)
            objects.append(obj)
            scenes.append(self._scene_with(obj, env))
            check_state(state.simulation, scenes[-1:])
        targets = [state.target for state in states]
        goals = [self._goal_of(obj, target) for obj, target in zip(objects, targets, strict=True)]
        changed = self._changed(envs, scenes, targets)
        for batch, chosen in self.group.place(envs, scenes, goals):
            for k in chosen:
                slot = int(self.group.slot[envs[k]])
                batch.simulation.restore(states[k].simulation, [slot], [scenes[k]], is_checked=True)
            batch.refresh()
        self._name(envs, [state.level for state in states], scenes, targets)
        for env, state in zip(envs, states, strict=True):
            self.progress.elapsed[env] = state.elapsed
            self.progress.streaks[env] = state.streaks
        return changed

    def save_all(self) -> dict[str, Any]:
        """Return the states of all episodes and the objects that were handed in, for a copy of the environment.

        Raises:
            DivergedError: the physics of some diverged: there is no state to go on from.
        """
        causes: dict[int, Cause] = {}
        for batch in self.group.batches:
            found = batch.simulation.diverged(batch.taken)
            causes |= {int(batch.members[slot]): cause for slot, cause in found.items()}
        if causes:
            raise DivergedError(causes)
        return {
            "handed_in": [sampler.handed_in for sampler in self.samplers],
            "states": [self.save(env) for env in range(self.count if self.begun else 0)],
        }

    def remember(self, handed_in: Sequence[Sequence[ArticulatedObject]]) -> None:
        """Make objects known to each environment, as `save_all` returned them: saved states name them."""
        for sampler, objects in zip(self.samplers, handed_in, strict=True):
            for obj in objects:
                sampler.remember(obj)

    # -- inside --------------------------------------------------------------------------------------------------

    def _scene_with(self, obj: ArticulatedObject, env: int) -> Scene:
        """Return the scene of an object, which may be the one that the environment has now."""
        if self.begun and self.group.scene_of(env).object is obj:
            return self.group.scene_of(env)
        return cached_scene(self.task.robot, obj, self.task.physics, self.task.props)

    def _changed(self, envs: Sequence[int], scenes: Sequence[Scene], targets: Sequence[str]) -> list[int]:
        """Return the environments that have another scene or target so far."""
        return [
            env
            for env, scene, target in zip(envs, scenes, targets, strict=True)
            if self.objects[env] is None or self.group.scene_of(env) is not scene or self.targets[env] != target
        ]

    def _name(
        self, envs: Sequence[int], levels: Sequence[int], scenes: Sequence[Scene], targets: Sequence[str]
    ) -> None:
        for env, level, scene, target in zip(envs, levels, scenes, targets, strict=True):
            self.levels[env], self.objects[env], self.targets[env] = level, scene.object.id, target


class EpisodeProgress:
    """Elapsed steps and flag streaks of B episodes: what they remember besides the physical state.

    A flag counts once it has held for `hold_steps` consecutive steps; an episode is solved in the step in which
    all flags count at the same time.

    Attributes:
        elapsed: (B,) environment steps since the episode's first state.
        streaks: (B, F) consecutive steps that each flag has held up to now.
    """

    def __init__(self, num_envs: int, flag_names: Sequence[str], hold_steps: int) -> None:
        self.flag_names = tuple(flag_names)
        self.hold_steps = hold_steps
        self.elapsed = np.zeros(num_envs, dtype=np.int64)
        self.streaks = np.zeros((num_envs, len(self.flag_names)), dtype=np.int64)

    def restart(self, envs: Sequence[int]) -> None:
        """Begin new episodes in some environments."""
        self.elapsed[envs] = 0
        self.streaks[envs] = 0

    def advance(self, flags: Mapping[str, np.ndarray], active: np.ndarray | None = None) -> None:
        """Count one environment step with these flags, each (B,) bool; of the active environments, (B,) bool."""
        held = columns([flags[name] for name in self.flag_names])
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
        return self.streaks >= self.hold_steps

    @property
    def success(self) -> np.ndarray:
        """Which episodes are solved at this step, (B,) bool."""
        return np.asarray(self.counted.all(axis=-1))


def _active_slots(batch: Batch, resting: np.ndarray | None) -> np.ndarray:
    """Return which slots of a batch step, (S,) bool."""
    active = batch.members != FREE
    if resting is not None:
        active[active] = ~resting[batch.members[active]]
    return active


def _scatter(values: Mapping[str, np.ndarray], batch: Batch, count: int, out: dict[str, np.ndarray]) -> None:
    """Write arrays of a batch's slots into arrays of all environments, (B,)."""
    for name, array in values.items():
        out.setdefault(name, np.empty(count, array.dtype))[batch.members[batch.taken]] = array[batch.taken]
