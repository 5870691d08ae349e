"""No two links share space, at rest and over every joint's whole range.

All links are tried against all others, parents and children included. One kind of overlap is meant and left out:
that of a part named in `bearing_parts` (a pin in its hinge, a column in its sleeve) with its link's parent or
child. Everything else counts, at the depth by which the engine would push the shapes apart.
"""

import math

import numpy as np

from artiskill.assets.articulated_object import Joint
from artiskill.checks.context import CheckContext, CheckResult, Overlap, at_most

_MM = 1e3
# categories whose joints never hinder one another
_INDEPENDENT = ("chair", "bucket")


def check_closed(context: CheckContext) -> list[CheckResult]:
    """Check overlaps at rest: one result for the deepest pair of links, and one for each further pair too deep."""
    limit = context.config.penetration_m * _MM
    found = [
        at_most(_pair_name(context, o), o.depth_m * _MM, limit, "mm", _parts(o))
        for o in _overlaps(context, context.rest)
    ]
    if not found:
        return [at_most("object", 0.0, limit, "mm", "no two links touch")]
    return found[:1] + [result for result in found[1:] if not result.passed]


def check_sweep(context: CheckContext) -> list[CheckResult]:
    """Check overlaps at places of every joint's range: one result per joint, and one for random combinations.

    One joint moves at a time, the others rest: a door in front of an inner drawer is no fault. What the joint
    carries is looked at against everything else. The joints of chairs and buckets never hinder one another, so
    random values of all of them are tried as well.
    """
    results = []
    for k, joint in enumerate(context.joints):
        values = _sweep_values(context, joint)
        states = np.tile(context.rest, (len(values), 1))
        states[:, k] = values
        slides = joint.kind == "prismatic"
        places = [f"at {v:.3f} m" if slides else f"at {math.degrees(v):.0f} deg" for v in values]
        results.append(_worst(context, joint.name, list(states), places, context.carried(k)))
    if context.object.category in _INDEPENDENT and context.joints and context.config.sweep.combinations:
        rng = np.random.default_rng(0)
        spans = [j.limits if np.isfinite(j.limits).all() else (-math.pi, math.pi) for j in context.joints]
        draws = range(context.config.sweep.combinations)
        random_states = [np.array([rng.uniform(*span) for span in spans]) for _ in draws]
        results.append(_worst(context, "all joints", random_states, ["together"] * len(draws)))
    return results


def _sweep_values(context: CheckContext, joint: Joint) -> np.ndarray:
    """Return where a joint is looked at, from one limit to the other; angles over one turn if it has none."""
    sweep = context.config.sweep
    if not all(map(math.isfinite, joint.limits)):
        return np.arange(sweep.steps_per_turn) * (2 * math.pi / sweep.steps_per_turn)
    return np.linspace(*joint.limits, sweep.steps + 1)


def _worst(
    context: CheckContext,
    subject: str,
    states: list[np.ndarray],
    places: list[str],
    moved: set[int] | None = None,
) -> CheckResult:
    """Return the deepest overlap over all states: of `moved` links with others if given, else of any two."""
    worst: tuple[Overlap, str] | None = None
    for qpos, place in zip(states, places, strict=True):
        for overlap in _overlaps(context, qpos):
            if moved is not None and len(moved.intersection(overlap.links)) != 1:
                continue
            if worst is None or overlap.depth_m > worst[0].depth_m:
                worst = overlap, place
    limit = context.config.penetration_m * _MM
    if worst is None:
        return at_most(subject, 0.0, limit, "mm")
    overlap, place = worst
    note = f"{_pair_name(context, overlap)}: {_parts(overlap)}, {place}"
    return at_most(subject, overlap.depth_m * _MM, limit, "mm", note)


def _overlaps(context: CheckContext, qpos: np.ndarray) -> list[Overlap]:
    """Return the overlaps at joint values (J,) that are no bearings, the deepest first."""
    return [o for o in context.overlap_probe.overlaps(qpos) if not _is_bearing(context, o)]


def _is_bearing(context: CheckContext, overlap: Overlap) -> bool:
    links, (first, second) = context.object.links, overlap.links
    parent = links[second].parent
    while parent > first and not links[parent].collisions:  # it only joins two joints
        parent = links[parent].parent
    words = context.config.bearing_parts
    return parent == first and any(word in part.lower() for part in overlap.parts for word in words)


def _pair_name(context: CheckContext, overlap: Overlap) -> str:
    first, second = (context.object.links[i].name for i in overlap.links)
    return f"{second}/{first}"


def _parts(overlap: Overlap) -> str:
    first, second = (part or "unnamed part" for part in overlap.parts)
    return f"{second} in {first}"
