"""`Fleet`: the environments of a vector, in squads of one layout each.

A squad is one simulation, one snapshot and one stacked goal, so that physics, rewards and observations of all its
environments are one call each. Objects of one category nearly always share a layout; an environment whose next
object has another one moves over.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from artiskill.errors import Cause, DivergedError
from artiskill.scene.layout import SceneLayout
from artiskill.scene.scene import Scene
from artiskill.sim.simulation import Simulation
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import InitialState
from artiskill.tasks.task import Goal, put_goal, stack_goals

FREE = -1


@dataclass(frozen=True, eq=False)
class Start:
    """How one environment's episode begins."""

    scene: Scene
    goal: Goal
    state: InitialState


class Squad:
    """Environments of one layout; each has a slot of the simulation. Some slots may be free.

    Attributes:
        simulation: of all slots.
        members: (S,) which environment of the vector has each slot, or `FREE`.
        taken: the slots that have an environment, sorted.
        goal: of all slots.
        snapshot: of all slots, now.
    """

    def __init__(self, scene: Scene, goal: Goal, slots: int, num_threads: int) -> None:
        self.simulation = Simulation(scene, slots, num_threads)
        self.members, self.taken = np.full(slots, FREE), np.arange(0)
        self._goals = [goal] * slots
        self.goal: Goal = stack_goals(self._goals)
        self.snapshot: Snapshot = self.simulation.snapshot()

    def seat(self, env: int, slot: int) -> None:
        """Give a slot to an environment, or, with `FREE`, to nobody."""
        self.members[slot] = env
        self.taken = np.flatnonzero(self.members != FREE)

    def goal_at(self, slot: int) -> Goal:
        """Of one slot, B = 1."""
        return self._goals[slot]

    def make_room(self, count: int, most: int) -> None:
        """See to it that `count` slots are free; a squad that grows has some to spare, but never beyond `most`."""
        slots = len(self.members)
        if count > slots - len(self.taken):
            grown = _with_spare(len(self.taken) + count, most)
            self.simulation.grow(grown)
            self.members = np.append(self.members, np.full(grown - slots, FREE))
            self._goals += [self._goals[0]] * (grown - slots)
            self.goal = stack_goals(self._goals)

    def start(self, slots: Sequence[int], starts: Sequence[Start]) -> None:
        """Begin episodes in sorted slots."""
        stale = False
        for slot, start in zip(slots, starts, strict=True):
            if self._goals[slot] is not start.goal:
                self._goals[slot] = start.goal
                stale = not put_goal(self.goal, slot, start.goal) or stale
        if stale:
            self.goal = stack_goals(self._goals)
        self.simulation.reset([s.state for s in starts], list(slots), [s.scene for s in starts])

    def look(self) -> None:
        """Bring the snapshot up to date."""
        self.snapshot = self.simulation.snapshot()


def _with_spare(count: int, most: int) -> int:
    """Slots for so many environments: growing takes time, and objects drawn at random come and go."""
    return min(count + count // 4 + 1, most)


class Fleet:
    """All environments of a vector.

    Attributes:
        squads: by layout.
        slot: (B,) each environment's slot in its squad.
    """

    def __init__(self, num_envs: int, num_threads: int) -> None:
        self.num_envs, self._num_threads = num_envs, num_threads
        self._squads: dict[SceneLayout, Squad] = {}
        self._squad_of: list[Squad | None] = [None] * num_envs
        self.slot = np.full(num_envs, FREE)

    @property
    def squads(self) -> tuple[Squad, ...]:
        """Those that have any environment."""
        return tuple(squad for squad in self._squads.values() if len(squad.taken))

    def squad_of(self, env: int) -> Squad:
        """The squad that an environment is in; it has been started."""
        squad = self._squad_of[env]
        assert squad is not None, "an environment is started before it is asked for"
        return squad

    def scene_of(self, env: int) -> Scene:
        """What an environment simulates."""
        return self.squad_of(env).simulation.scenes[self.slot[env]]

    def snapshot_of(self, env: int) -> Snapshot:
        """What is true in one environment, B = 1."""
        return self.squad_of(env).snapshot.row(int(self.slot[env]))

    def goal_of(self, env: int) -> Goal:
        """What is asked for in one environment, B = 1."""
        return self.squad_of(env).goal_at(int(self.slot[env]))

    def start(self, envs: Sequence[int], starts: Sequence[Start]) -> None:
        """Begin episodes; environments go over to another squad where their scene's layout asks for it."""
        arriving: dict[SceneLayout, list[tuple[int, Start]]] = {}
        for env, start in zip(envs, starts, strict=True):
            arriving.setdefault(start.scene.layout, []).append((env, start))
        for layout, group in arriving.items():
            for env, _ in group:
                self._leave(env, layout)
        for layout, group in arriving.items():
            squad = self._enter(layout, group)
            placed = sorted((int(self.slot[env]), start) for env, start in group)
            squad.start([slot for slot, _ in placed], [start for _, start in placed])
            squad.look()

    def _leave(self, env: int, layout: SceneLayout) -> None:
        squad = self._squad_of[env]
        if squad is not None and squad is not self._squads.get(layout):
            squad.seat(FREE, int(self.slot[env]))
            self._squad_of[env], self.slot[env] = None, FREE

    def _enter(self, layout: SceneLayout, group: list[tuple[int, Start]]) -> Squad:
        new = [env for env, _ in group if self._squad_of[env] is None]
        if layout not in self._squads:
            start, slots = group[0][1], _with_spare(len(new), self.num_envs)
            self._squads[layout] = Squad(start.scene, start.goal, slots, self._num_threads)
        squad = self._squads[layout]
        squad.make_room(len(new), self.num_envs)
        for env, slot in zip(new, np.flatnonzero(squad.members == FREE), strict=False):
            squad.seat(env, int(slot))
            self._squad_of[env], self.slot[env] = squad, slot
        return squad

    def step(self, targets: Sequence[tuple[Squad, np.ndarray]], resting: np.ndarray) -> dict[int, Cause]:
        """One environment step.

        Args:
            targets: of each squad, (S, R).
            resting: (B,) bool, environments that do not step.

        Returns:
            Environments whose physics ran away, and why; all others have stepped.
        """
        diverged: dict[int, Cause] = {}
        for squad, values in targets:
            members = squad.members
            active = members != FREE
            active[active] = ~resting[members[active]]
            if not active.any():
                continue
            try:
                squad.simulation.step(values, None if active.all() else np.flatnonzero(active))
            except DivergedError as error:
                diverged.update({int(members[slot]): cause for slot, cause in error.causes.items()})
            squad.look()
        return diverged

    def diverged(self) -> dict[int, Cause]:
        """Environments whose physics has run away since their reset, and why."""
        causes: dict[int, Cause] = {}
        for squad, taken, members in self:
            causes |= {int(members[k]): cause for k, cause in squad.simulation.diverged(taken).items()}
        return causes

    def __iter__(self) -> Iterator[tuple[Squad, np.ndarray, np.ndarray]]:
        """Each squad with its taken slots and the environments in them."""
        for squad in self.squads:
            taken = squad.taken
            yield squad, taken, squad.members[taken]
