"""The episodes of a vector: which level, object and target each environment has, and how far it is."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from gymnasium.utils import seeding

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.envs.sampling import EpisodeSampler, ObjectChoice
from artiskill.envs.vector.fleet import Fleet, Start
from artiskill.scene.scene import Scene, cached_scene
from artiskill.tasks.levels import MAX_LEVEL, RngStream, level_generator
from artiskill.tasks.progress import EpisodeProgress
from artiskill.tasks.task import Task

_GOALS = 512  # that are kept: of the last objects and targets


class Episodes:
    """B episodes of a task.

    Args:
        task: what is asked.
        castings: of each environment.
        num_threads: threads that step.

    Attributes:
        castings: of each environment.
        generators: (B,) what draws each environment's next levels; None before the first draw.
        fleet: their physics.
        progress: their steps and flags.
        levels: (B,) int64.
        objects: (B,) ids, None before the first episode.
        targets: (B,) names of links.
        flags: name -> (B,) bool, the conditions as they are now.
        terms: name -> (B,) unweighted reward terms now.
    """

    def __init__(self, task: Task, castings: Sequence[EpisodeSampler], num_threads: int) -> None:
        self.task, self.castings = task, list(castings)
        count = len(castings)
        self.fleet = Fleet(count, num_threads)
        self.progress = EpisodeProgress(count, task.flag_names, task.hold_steps)
        self.levels = np.zeros(count, dtype=np.int64)
        self.objects, self.targets = (np.full(count, None, dtype=object) for _ in range(2))
        self.flags: dict[str, np.ndarray] = {}
        self.terms: dict[str, np.ndarray] = {}
        self.generators: list[np.random.Generator | None] = [None] * count
        self._goal_of = lru_cache(_GOALS)(task.make_goal)

    @property
    def begun(self) -> bool:
        """Whether there has been a first reset."""
        return bool(self.objects[0] is not None)

    def next_level(self, env: int, seed: int | None = None) -> int:
        """The level of an environment's next episode, as a single environment draws it."""
        if seed is not None or self.generators[env] is None:
            self.generators[env], _ = seeding.np_random(seed)
        generator = self.generators[env]
        assert generator is not None
        return seed if seed is not None else int(generator.integers(MAX_LEVEL + 1))

    def level_of(self, env: int, seed: int | None, chosen: int | None) -> int:
        """The level of a reset: what the options say, else the seed, else the next one."""
        if chosen is not None and seed is None:
            return chosen
        level = self.next_level(env, seed)
        return level if chosen is None else chosen

    def start(
        self, envs: Sequence[int], levels: Sequence[int], objects: Sequence[Any], targets: Sequence[str | None]
    ) -> list[int]:
        """Start episodes; objects and targets that are None are the levels' own.

        Returns:
            The environments that have another scene or target now.

        Raises:
            UnknownNameError: an unknown object or target link; nothing has been started then.
            AssetError: an object that does not fit the task; likewise.
        """
        cast = [
            self.castings[env].draw(level, obj, target)
            for env, level, obj, target in zip(envs, levels, objects, targets, strict=True)
        ]
        starts = [self._begin(obj, target, level) for (obj, target), level in zip(cast, levels, strict=True)]
        before = [(self._scene(env), self.targets[env]) for env in envs]
        self.fleet.start(envs, starts)
        for env, level, (obj, target) in zip(envs, levels, cast, strict=True):
            self.levels[env], self.objects[env], self.targets[env] = level, obj.id, target
        self.progress.restart(envs)
        now = [(start.scene, target) for start, (_, target) in zip(starts, cast, strict=True)]
        return [env for env, old, new in zip(envs, before, now, strict=True) if old != new]

    def choices_of(self, env: int) -> tuple[str | ArticulatedObject, ...]:
        """What an environment draws its objects from."""
        return self.castings[env].choices

    def draw_from(self, choices: Sequence[ObjectChoice]) -> None:
        """Have each environment draw its next objects from another choice.

        Raises:
            UnknownNameError, AssetError: as of a new environment; nothing has changed then.
        """
        castings = zip(self.castings, choices, strict=True)
        self.castings = [EpisodeSampler(self.task, choice, casting.fixed_target) for casting, choice in castings]

    def _begin(self, obj: ArticulatedObject, target: str, level: int) -> Start:
        state = self.task.sample_initial_state(obj, level_generator(level, RngStream.INITIAL_STATE))
        return Start(self.scene_for(obj), self._goal_of(obj, target), state)

    def scene_for(self, obj: ArticulatedObject) -> Scene:
        """The task's scene with an object."""
        return cached_scene(self.task.robot, obj, self.task.physics, self.task.props)

    def find(self, env: int, object_id: str, target: str) -> ArticulatedObject:
        """An object that an environment knows, or of the catalogue.

        Raises:
            UnknownNameError: there is none of this name, or it has no such target.
        """
        obj = self.castings[env].find(object_id)
        self.castings[env].check_target(obj, target)
        return obj

    def _scene(self, env: int) -> Scene | None:
        return None if self.objects[env] is None else self.fleet.scene_of(env)

    def evaluate(self) -> None:
        """Bring flags and reward terms up to date."""
        count = len(self.levels)
        self.flags = {name: np.empty(count, dtype=bool) for name in self.task.flag_names}
        self.terms = {}
        for squad, taken, members in self.fleet:
            flags = self.task.flags(squad.snapshot, squad.goal)
            for name, values in flags.items():
                self.flags[name][members] = values[taken]
            for name, values in self.task.reward_terms(squad.snapshot, squad.goal, flags).items():
                self.terms.setdefault(name, np.empty(count))[members] = values[taken]

    def outcome(self, dense: bool, resting: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rewards, terminations and truncations of a step, (B,); none of them where an episode only began."""
        success = self.progress.success
        rewards = self.task.dense_reward(self.terms) if dense else success.astype(float)
        rewards[resting] = 0.0
        truncated = (self.progress.elapsed >= self.task.episode_steps) & ~success
        return rewards, success & ~resting, truncated & ~resting

    def attributes(self) -> dict[str, np.ndarray]:
        """Object, level and target of all episodes, (B,) each."""
        return {"object": self.objects.copy(), "level": self.levels.copy(), "target": self.targets.copy()}

    def info(self) -> dict[str, Any]:
        """What `info` says of all episodes in every mode, as arrays (B,)."""
        counted = self.progress.counted
        return self.attributes() | {
            "success": counted.all(axis=1),
            "flags": {name: counted[:, k].copy() for k, name in enumerate(self.progress.flag_names)},
            "reward_terms": self.terms,
        }
