"""Which demonstrations are replayed."""

from collections.abc import Sequence

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import Demos
from artiskill.demos.manifest import FileEntry
from artiskill.errors import UnknownNameError

Selected = tuple[str, FileEntry, ArticulatedObject | None]


def select(demos: Demos, objects: Sequence[str | ArticulatedObject] | None) -> list[Selected]:
    """The files of some objects, or of all: name, entry, and the object where it was handed in.

    Raises:
        UnknownNameError: there are no demonstrations of an object.
    """
    by_object = {entry.object: (name, entry) for name, entry in demos.manifest.files.items()}
    if objects is None:
        return [(name, entry, None) for name, entry in by_object.values()]
    found: dict[str, Selected] = {}
    for item in objects:
        given = item if isinstance(item, ArticulatedObject) else None
        key = item.id if isinstance(item, ArticulatedObject) else item
        if key not in by_object:
            raise UnknownNameError("object", key, by_object, f"(of {str(demos.folder)!r})")
        found[key] = *by_object[key], given
    return [found[key] for key in by_object if key in found]


def choose(file: DemoFile, count: int | None, keep_failures: bool = False) -> tuple[int, ...]:
    """Numbers of trajectories: all, or the first ones of each target, evenly of all targets.

    Args:
        file: of demonstrations.
        count: so many; None for all.
        keep_failures: failures count, too; else `count` successes are chosen.
    """
    if count is None:
        return tuple(range(len(file)))
    attempts = file.attempts
    rows = attempts[(attempts["trajectory"] >= 0) & (attempts["success"].astype(bool) | keep_failures)]
    rank = np.zeros(len(rows), dtype=int)  # within its target
    for target in np.unique(rows["target"]):
        of_target = np.flatnonzero(rows["target"] == target)
        rank[of_target] = np.arange(len(of_target))
    first = np.lexsort((rows["target"], rank))[:count]
    return tuple(sorted(int(number) for number in rows["trajectory"][first]))
