"""Success of a report's episodes by traits of their objects: which novelty does a policy not cope with?"""

from collections.abc import Sequence
from functools import cache, partial
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import object_of
from artiskill.assets.kinematics import joint_values, link_poses
from artiskill.errors import ConfigError, UnknownNameError
from artiskill.evaluation.statistics import (
    EpisodeResult,
    EpisodeStatistics,
    Interval,
    object_interval,
    summarize,
)
from artiskill.evaluation.stored_report import read_report
from artiskill.evaluation.verify import plan_again
from artiskill.geometry.rotations import quat_rotate

NONE = "none"  # an object has no such trait
_UPRIGHT = 0.7  # height of a unit vector along a hinge that is rather upright than level


class Trait(NamedTuple):
    """What some objects have in common, and others have not.

    Attributes:
        name: `family` of the object (`ArticulatedObject.family`); `handle`, the kind of the target's handle, or of
            the object's, if any; `joint` of a cabinet's target: `slide`, `upright hinge` or `level hinge`.
        value: of this one.
    """

    name: str
    value: str


class Group(NamedTuple):
    """Episodes on objects with one trait.

    Attributes:
        trait: of the objects.
        episodes: in the report's order.
        stats: of the episodes.
        interval_over_objects: 95 % interval of the rate by bootstrap over objects; None if all are alike.
    """

    trait: Trait
    episodes: tuple[EpisodeResult, ...]
    stats: EpisodeStatistics
    interval_over_objects: Interval | None

    @property
    def objects(self) -> int:
        """How many objects the episodes are on."""
        return len({one.object for one in self.episodes})


def group_episodes(folder: Path | str, objects: Sequence[str | ArticulatedObject] = ()) -> list[Group]:
    """Return the episodes of a report by trait, traits by name, of each the least successful value first.

    Args:
        folder: of the report.
        objects: that the report's own names do not lead to, imported ones say, or their folders' names.

    Raises:
        ConfigError: a file is missing or damaged, or an object is another one than the report's.
        ArtiSkillError: there is no such task, configuration, object, target or mode.
    """
    stored = read_report(folder)
    episodes, batches = iter(stored.episodes()), plan_again(stored.report, objects).batches
    found: dict[Trait, list[EpisodeResult]] = {}
    for row, batch in zip(stored.report.objects, batches, strict=True):
        if batch.content_hash != row.content_hash:
            raise ConfigError(
                f"object {row.object!r} is another one than the report's: its content hash is "
                f"{batch.content_hash}, not {row.content_hash}"
            )
        obj = object_of(batch.object)
        traits = cache(partial(traits_of, obj))
        for episode in islice(episodes, row.episodes):
            for trait in traits(episode.target):
                found.setdefault(trait, []).append(episode)
    groups = [Group(trait, tuple(own), summarize(own), object_interval(own)) for trait, own in found.items()]
    return sorted(groups, key=lambda one: (one.trait.name, one.stats.success_rate, one.trait.value))


def traits_of(obj: ArticulatedObject, target: str) -> list[Trait]:
    """Return the traits of an object whose link `target` is to be moved.

    Raises:
        ConfigError: it has no such link.
    """
    try:
        index = obj.link_index(target)
    except UnknownNameError as error:
        raise ConfigError(f"object {obj.id!r} has no link {target!r}, which the report names") from error
    held = obj.handles_of(target) or obj.handles
    found = [Trait("family", obj.family)]
    if held:
        found.append(Trait("handle", ", ".join(sorted({one.kind for one in held}))))
    if obj.category == "cabinet":
        found.append(Trait("joint", _joint_kind(obj, index)))
    return found


def _joint_kind(obj: ArticulatedObject, index: int) -> str:
    """Return the kind of a link's joint, as the object stands."""
    joint = obj.links[index].joint
    if joint is None:
        return NONE
    if joint.kind == "prismatic":
        return "slide"
    _, quaternions = link_poses(obj, joint_values(obj, 0.0))
    height = float(np.abs(quat_rotate(quaternions[index], joint.axis)[2]))
    return "upright hinge" if height > _UPRIGHT else "level hinge"
