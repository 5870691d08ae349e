"""At rest, no two links share space: closed drawers stand free of their carcass, casters of their base.

All links are tried against all others, parents and children included. One kind of overlap is meant and left out:
that of a part named in `bearing_parts` (a pin in its hinge, a column in its sleeve) with its link's parent or
child. Everything else counts, at the depth by which the engine would push the shapes apart.
"""

from collections.abc import Iterable

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.checks.config import ChecksConfig
from artiskill.checks.contacts import Overlap
from artiskill.checks.result import CheckResult, at_most
from artiskill.checks.specimen import Specimen

NAME = "closed"
_MM = 1e3


def check_penetration(specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    """One result for the object's deepest pair of links, and one for each further pair that is too deep."""
    found = unmeant(specimen.object, specimen.probe.overlaps(specimen.rest), config)
    limit = config.penetration_m * _MM
    if not found:
        return [at_most(NAME, "object", 0.0, limit, "mm", "no two links touch")]
    results = [
        at_most(NAME, pair_name(specimen.object, o), o.depth_m * _MM, limit, "mm", describe(o)) for o in found
    ]
    return results[:1] + [result for result in results[1:] if not result.passed]


def unmeant(obj: ArticulatedObject, overlaps: Iterable[Overlap], config: ChecksConfig) -> list[Overlap]:
    """The overlaps that are no bearings."""
    return [o for o in overlaps if not _is_bearing(obj, o, config.bearing_parts)]


def pair_name(obj: ArticulatedObject, overlap: Overlap) -> str:
    """Both links' names."""
    first, second = overlap.links
    return f"{obj.links[second].name}/{obj.links[first].name}"


def describe(overlap: Overlap) -> str:
    """Which parts they are."""
    first, second = (part or "unnamed part" for part in overlap.parts)
    return f"{second} in {first}"


def _is_bearing(obj: ArticulatedObject, overlap: Overlap, bearing_parts: tuple[str, ...]) -> bool:
    first, second = overlap.links
    parent = obj.links[second].parent
    while parent > first and not obj.links[parent].collisions:  # it only joins two joints
        parent = obj.links[parent].parent
    return parent == first and any(word in part.lower() for part in overlap.parts for word in bearing_parts)
