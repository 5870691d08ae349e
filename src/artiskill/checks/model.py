"""Checks of the compiled model: the engine takes the object, it is not too costly, and its masses are real."""

import math

import numpy as np

from artiskill.checks.context import CheckContext, CheckResult, at_most, failed, fine, within

_SLACK = 1e-6  # of the triangle inequality: rounding of a flat body's moments


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
