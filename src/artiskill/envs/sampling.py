"""EpisodeSampler: which object and which target link an episode has, out of what the user allows."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import is_nameable, load_object, resolve_objects
from artiskill.assets.needs import TASK_NEEDS
from artiskill.errors import AssetError, check_name
from artiskill.tasks.levels import MAX_LEVEL, RngStream, level_generator
from artiskill.tasks.task import Task

_KNOWN = 64  # objects that are remembered

ObjectChoice = str | ArticulatedObject | Sequence[str | ArticulatedObject]


class EpisodeSampler:
    """Draws object and target of a level.

    Args:
        task: decides which links are legal targets.
        objects: a split, an id, a list of ids, or `ArticulatedObject`s.
        target: a fixed target link, or None to let the level draw one.

    Raises:
        UnknownNameError: no such split or object, or an object without this target.
        AssetError: an object of another category, or with nothing to do in this task.
    """

    def __init__(self, task: Task, objects: ObjectChoice, target: str | None = None) -> None:
        self.task = task
        self.choices = resolve_objects(objects, task=task.name)
        self.fixed_target = target
        self._known: dict[str, ArticulatedObject] = {}
        for choice in self.choices:
            if target is not None or isinstance(choice, ArticulatedObject):
                self.check_target(_load(choice), target)

    def draw(
        self, level: int, object_choice: Any = None, target: str | None = None
    ) -> tuple[ArticulatedObject, str]:
        """Return object and target link of a level; either may be given instead.

        Raises:
            UnknownNameError: an unknown object or target link.
            AssetError: an object that does not fit the task.
        """
        if object_choice is None:
            generator = level_generator(level, RngStream.OBJECT)
            object_choice = self.choices[int(generator.integers(len(self.choices)))]
        obj = self.find(object_choice)
        if not (isinstance(object_choice, str) and is_nameable(object_choice)):
            self.remember(obj)
        target = self.fixed_target if target is None else target
        targets = self.check_target(obj, target)
        if target is None:
            target = targets[int(level_generator(level, RngStream.TARGET).integers(len(targets)))]
        return obj, target

    @property
    def handed_in(self) -> tuple[ArticulatedObject, ...]:
        """The objects that are remembered, the last one last."""
        return tuple(self._known.values())

    def remember(self, obj: ArticulatedObject) -> None:
        """Keep an object that its id may not lead to: saved states name it."""
        self._known.pop(obj.id, None)
        self._known[obj.id] = obj
        if len(self._known) > _KNOWN:
            del self._known[next(iter(self._known))]

    def find(self, given: str | ArticulatedObject) -> ArticulatedObject:
        """Return an object by its id or as itself; ids of the last objects that were handed in are known too."""
        if isinstance(given, str):
            handed_in = {c.id: c for c in self.choices if isinstance(c, ArticulatedObject)}
            given = handed_in.get(given) or self._known.get(given) or given
        return _load(given)

    def check_target(self, obj: ArticulatedObject, target: str | None) -> tuple[str, ...]:
        """Return the object's legal targets; check that it has any and, if `target` is given, that it is one.

        Raises:
            UnknownNameError: no such target.
            AssetError: an object of another category, or without a target.
        """
        needs = TASK_NEEDS[self.task.name]
        needs.check_object(obj)
        targets = self.task.targets(obj)
        if not targets:
            raise AssetError(
                f"object {obj.id!r} has no link that {self.task.name} could be done with"
                f"{'' if needs.motion else '; register the task with motion=, and splits leave such objects out'}"
            )
        if target is not None:
            check_name("target link", target, targets, f"(object {obj.id!r}, {self.task.name})")
        return targets


def draw_level(generator: np.random.Generator) -> int:
    """Return the level of an environment's next episode."""
    return int(generator.integers(MAX_LEVEL + 1))


def _load(choice: str | ArticulatedObject) -> ArticulatedObject:
    return choice if isinstance(choice, ArticulatedObject) else load_object(choice)
