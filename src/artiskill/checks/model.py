"""Checks of the compiled model, without a step: it is accepted, small enough, of real mass, and no links overlap.

Overlaps: all links are tried against all others, parents and children included. One kind is meant and left out:
that of a part named in `bearing_parts` (a pin in its hinge, a column in its sleeve) with its link's parent or
child. Everything else counts, at the depth by which the engine would push the shapes apart.
"""

import math

import numpy as np

from artiskill.assets.articulated_object import Joint
from artiskill.checks.context import CheckContext, CheckResult, Overlap, at_most, failed, fine, within

_SLACK = 1e-6  # of the triangle inequality: rounding of a flat body's moments
_MM = 1e3
# categories whose joints never hinder one another
_INDEPENDENT = ("chair", "bucket")


def check_compiles(context: CheckContext) -> list[CheckResult]:
    """Check that there is a model, and that it is at rest without warnings."""
    try:
        data = context.scene.rest_data()
    except ValueError as error:
        return [failed("object", f"the engine refuses it: {' '.join(str(error).split())}")]
    warnings = int(sum(warning.number for warning in data.warning))
    if warnings:
        return [failed("object", f"the engine warns {warnings} times at rest")]
    model = context.scene.model
    return [fine("object", f"{model.nbody - 1} bodies, {model.nv} degrees of freedom")]


def check_triangles(context: CheckContext) -> list[CheckResult]:
    """Check how many triangles are drawn."""
    triangles = sum(len(visual.mesh.faces) for link in context.object.links for visual in link.visuals)
    return [at_most("object", triangles, context.limits.triangles)]


def check_geoms(context: CheckContext) -> list[CheckResult]:
    """Check how many collision shapes there are."""
    return [at_most("object", sum(len(link.collisions) for link in context.object.links), context.limits.geoms)]


def check_mass(context: CheckContext) -> list[CheckResult]:
    """Check the mass of the whole and of each moving link, and the principal moments of each link."""
    obj, limits, model = context.object, context.limits, context.scene.model
    masses = model.body_mass[context.scene.bodies]
    whole = within("object", float(masses[list(obj.own_links)].sum()), limits.mass_kg, "kg")
    results = []
    for i, link in enumerate(obj.links):
        if link.joint is not None and not link.collisions:
            if not any(child.parent == i for child in obj.links):  # else it only joins two joints
                results.append(failed(link.name, "it has no collision shape, so that nothing gives it a mass"))
            continue
        if link.joint is not None:
            results.append(within(link.name, float(masses[i]), limits.link_mass_kg, "kg"))
        fault = _inertia_fault(context, i)
        if fault:
            results.append(failed(link.name, fault))
    values = [result.value for result in results if result.value is not None]
    summary = f"moving links of {min(values):.2g} to {max(values):.2g} kg" if values else "no moving links"
    return [whole, *([result for result in results if not result.passed] or [fine("links", summary)])]


def _inertia_fault(context: CheckContext, link: int) -> str:
    """Return what is wrong with a link's inertia, or nothing."""
    model, body = context.scene.model, context.scene.bodies[link]
    mass, moments = float(model.body_mass[body]), np.sort(model.body_inertia[body])
    if mass == 0 and not context.object.links[link].collisions:
        return ""  # a frame that carries others
    shown = ", ".join(f"{m:.2g}" for m in moments)
    if not (np.isfinite(moments).all() and moments[0] > 0):
        return f"principal moments must be positive: {shown} kg m2"
    if moments[0] + moments[1] < moments[2] * (1 - _SLACK):
        return f"no body has principal moments of which one exceeds the sum of the others: {shown} kg m2"
    shapes = model.geom_bodyid == body
    away = np.linalg.norm(model.geom_pos[shapes] - model.body_ipos[body], axis=1)
    # no point of the link's shapes is further than this from its centre of mass
    radius, reach = math.sqrt(moments[2] / mass), float((away + model.geom_rbound[shapes]).max())
    return f"radius of gyration {radius:.3f} m is larger than the link, {reach:.3f} m" if radius > reach else ""


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
