"""Every joint goes through its whole range, a whole turn where it has no limits, and no two links share space.

One joint moves at a time, the others rest: a door in front of an inner drawer is no fault. What the joint carries
is looked at against everything else. The joints of chairs and buckets never hinder one another, so random values
of all of them are tried as well.
"""

import math

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Joint
from artiskill.checks.config import ChecksConfig
from artiskill.checks.contacts import Overlap
from artiskill.checks.penetration import describe, pair_name, unmeant
from artiskill.checks.result import CheckResult, at_most
from artiskill.checks.specimen import Specimen

NAME = "sweep"
_MM = 1e3
# categories whose joints are independent of one another
_INDEPENDENT = ("chair", "bucket")


def check_sweep(specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    """One result per joint, and one for random combinations."""
    results = [_sweep(specimen, config, k) for k in range(len(specimen.joints))]
    if specimen.object.category in _INDEPENDENT and specimen.joints and config.sweep.combinations:
        rng = np.random.default_rng(0)
        draws = [_random(specimen.joints, rng) for _ in range(config.sweep.combinations)]
        results.append(_worst(specimen, config, "all joints", draws, ["together"] * len(draws)))
    return results


def sweep_values(joint: Joint, config: ChecksConfig) -> np.ndarray:
    """Where a joint is looked at, from one limit to the other; angles over one turn if it has none."""
    low, high = joint.limits
    if not math.isfinite(low) or not math.isfinite(high):
        return np.arange(config.sweep.steps_per_turn) * (2 * math.pi / config.sweep.steps_per_turn)
    return np.linspace(low, high, config.sweep.steps + 1)


def _sweep(specimen: Specimen, config: ChecksConfig, k: int) -> CheckResult:
    joint = specimen.joints[k]
    values = sweep_values(joint, config)
    qpos = np.tile(specimen.rest, (len(values), 1))
    qpos[:, k] = values
    places = [f"at {v:.3f} m" if joint.kind == "prismatic" else f"at {math.degrees(v):.0f} deg" for v in values]
    return _worst(specimen, config, joint.name, list(qpos), places, _carried(specimen.object, k))


def _carried(obj: ArticulatedObject, k: int) -> set[int]:
    """The links that joint k moves."""
    moved = {obj.jointed_links[k]}
    for i, link in enumerate(obj.links):
        if link.parent in moved:
            moved.add(i)
    return moved


def _worst(
    specimen: Specimen,
    config: ChecksConfig,
    subject: str,
    states: list[np.ndarray],
    places: list[str],
    moved: set[int] | None = None,
) -> CheckResult:
    """The deepest overlap over all states: of moved links with others if these are given, else of any two."""
    worst: tuple[Overlap, str] | None = None
    for qpos, place in zip(states, places, strict=True):
        for overlap in unmeant(specimen.object, specimen.probe.overlaps(qpos), config):
            if moved is not None and len(moved.intersection(overlap.links)) != 1:
                continue
            if worst is None or overlap.depth_m > worst[0].depth_m:
                worst = overlap, place
    limit = config.penetration_m * _MM
    if worst is None:
        return at_most(NAME, subject, 0.0, limit, "mm")
    overlap, place = worst
    note = f"{pair_name(specimen.object, overlap)}: {describe(overlap)}, {place}"
    return at_most(NAME, subject, overlap.depth_m * _MM, limit, "mm", note)


def _random(joints: tuple[Joint, ...], rng: np.random.Generator) -> np.ndarray:
    spans = [j.limits if np.isfinite(j.limits).all() else (-math.pi, math.pi) for j in joints]
    return np.array([rng.uniform(*span) for span in spans])
