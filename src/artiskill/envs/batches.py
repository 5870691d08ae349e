"""`BatchGroup`: which environment has which slot of which simulation.

Environments whose scenes share a layout form a `Batch`: one simulation, one snapshot and one stacked goal, so that
physics, rewards and observations of all of them are one call each. Objects of one category nearly always share a
layout; an environment whose next object has another one moves to another batch.
"""

from collections.abc import Sequence

import numpy as np

from artiskill.scene.layout import SceneLayout
from artiskill.scene.scene import Scene
from artiskill.sim.simulation import Simulation
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.task import Goal, put_goal, stack_goals

FREE = -1


class BatchGroup:
    """All environments.

    Attributes:
        batches: those that have any environment.
        slot: (B,) each environment's slot in its batch.
    """

    def __init__(self, num_envs: int, num_threads: int) -> None:
        self.num_envs, self._num_threads = num_envs, num_threads
        self._by_layout: dict[SceneLayout, Batch] = {}
        self._batch_of: list[Batch | None] = [None] * num_envs
        self.batches: tuple[Batch, ...] = ()
        self.slot = np.full(num_envs, FREE)

    def batch_of(self, env: int) -> "Batch":
        """Return the batch of an environment that has been placed."""
        batch = self._batch_of[env]
        assert batch is not None, "an environment is placed before it is asked for"
        return batch

    def scene_of(self, env: int) -> Scene:
        """Return what an environment simulates."""
        return self.batch_of(env).simulation.scenes[self.slot[env]]

    def snapshot_of(self, env: int) -> Snapshot:
        """Return the snapshot of one environment, B = 1."""
        snapshot = self.batch_of(env).snapshot
        return snapshot if len(snapshot.time_s) == 1 else snapshot.row(int(self.slot[env]))

    def goal_of(self, env: int) -> Goal:
        """Return the goal of one environment, B = 1."""
        return self.batch_of(env).goals[int(self.slot[env])]

    def place(
        self, envs: Sequence[int], scenes: Sequence[Scene], goals: Sequence[Goal]
    ) -> list[tuple["Batch", list[int], list[int]]]:
        """Give environments slots that fit their scenes' layouts, and their goals to the batches.

        Returns:
            Each batch that has any of them, their indices in `envs` in the order of their slots, and these slots.
            The caller resets or restores them and then calls `refresh`.
        """
        moving: dict[SceneLayout, list[int]] = {}
        for k, (env, scene) in enumerate(zip(envs, scenes, strict=True)):
            old = self._batch_of[env]
            if old is None or old.layout != scene.layout:
                moving.setdefault(scene.layout, []).append(k)
                self._leave(env)
        for layout, indices in moving.items():
            first = indices[0]
            self._join(layout, [envs[k] for k in indices], scenes[first], goals[first])
        if moving:
            self.batches = tuple(batch for batch in self._by_layout.values() if len(batch.taken))
        found: dict[Batch, list[int]] = {}
        for k, env in enumerate(envs):
            found.setdefault(self.batch_of(env), []).append(k)
        placed = []
        for batch, indices in found.items():
            indices.sort(key=lambda k: int(self.slot[envs[k]]))
            slots = [int(self.slot[envs[k]]) for k in indices]
            batch.set_goals(slots, [goals[k] for k in indices])
            placed.append((batch, indices, slots))
        return placed

    def _leave(self, env: int) -> None:
        batch = self._batch_of[env]
        if batch is not None:
            batch.assign_slot(FREE, int(self.slot[env]))
            self._batch_of[env], self.slot[env] = None, FREE

    def _join(self, layout: SceneLayout, envs: Sequence[int], scene: Scene, goal: Goal) -> None:
        """Give environments a slot in the batch of a layout; a new batch starts with this scene and goal."""
        batch = self._by_layout.get(layout)
        if batch is None:
            batch = Batch(scene, goal, len(envs), self.num_envs, self._num_threads)
            self._by_layout[layout] = batch
        batch.reserve(len(envs))
        for env, slot in zip(envs, np.flatnonzero(batch.members == FREE), strict=False):
            batch.assign_slot(env, int(slot))
            self._batch_of[env], self.slot[env] = batch, slot


class Batch:
    """Environments of one layout; each has a slot of the simulation. Some slots may be free.

    Attributes:
        layout: of all scenes.
        simulation: of all slots.
        members: (S,) which environment has each slot, or `FREE`.
        taken: the slots that have an environment, sorted.
        in_order: whether slot k has environment k, for all environments: then no array must be rearranged.
        goals: of each slot, B = 1.
        goal: of all slots.
        snapshot: of all slots.
    """

    def __init__(self, scene: Scene, goal: Goal, count: int, num_envs: int, num_threads: int) -> None:
        """Make slots for `count` of the `num_envs` environments, all free."""
        self.layout, self._num_envs = scene.layout, num_envs
        slots = self._with_spare(count)
        self.simulation = Simulation(scene, slots, num_threads)
        self.members, self.taken, self.in_order = np.full(slots, FREE), np.arange(0), False
        self.goals = [goal] * slots
        self.goal: Goal = _stacked(self.goals)
        self.snapshot: Snapshot = self.simulation.snapshot()

    def assign_slot(self, env: int, slot: int) -> None:
        """Give a slot to an environment, or, with `FREE`, to nobody."""
        self.members[slot] = env
        self._update()

    def reserve(self, count: int) -> None:
        """Make sure that `count` slots are free."""
        slots = len(self.members)
        if count > slots - len(self.taken):
            grown = self._with_spare(len(self.taken) + count)
            self.simulation.grow(grown)
            self.members = np.append(self.members, np.full(grown - slots, FREE))
            self.goals += [self.goals[0]] * (grown - slots)
            self.goal = _stacked(self.goals)
            self._update()

    def set_goals(self, slots: Sequence[int], goals: Sequence[Goal]) -> None:
        """Exchange the goals of some slots."""
        stale = False
        for slot, goal in zip(slots, goals, strict=True):
            if self.goals[slot] is not goal:
                self.goals[slot] = goal
                stale = stale or len(self.goals) == 1 or not put_goal(self.goal, slot, goal)
        if stale:
            self.goal = _stacked(self.goals)

    def refresh(self) -> None:
        """Bring the snapshot up to date."""
        self.snapshot = self.simulation.snapshot()

    def _update(self) -> None:
        self.taken = np.flatnonzero(self.members != FREE)
        self.in_order = np.array_equal(self.members, np.arange(self._num_envs))

    def _with_spare(self, count: int) -> int:
        """Return how many slots to make for so many environments: objects come and go, and growing takes time."""
        return min(count + count // 4 + 1, self._num_envs)


def _stacked(goals: Sequence[Goal]) -> Goal:
    """Return one goal of all; a single one as it is, for nothing may be written into it."""
    return goals[0] if len(goals) == 1 else stack_goals(goals)
