"""Masses are those of real things, inertias those that bodies can have."""

import math

import numpy as np

from artiskill.checks.config import ChecksConfig
from artiskill.checks.result import CheckResult, failed, fine, within
from artiskill.checks.specimen import Specimen

NAME = "mass"
_SLACK = 1e-6  # of the triangle inequality: rounding of a flat body's moments


def check_mass(specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    """Mass of the whole and of each moving link; principal moments of each link."""
    obj, limits, model = specimen.object, config.of(specimen.object.category), specimen.scene.model
    masses = model.body_mass[specimen.scene.bodies]
    results = [within(NAME, "object", float(masses[list(obj.own_links)].sum()), limits.mass_kg, "kg")]
    for i, link in enumerate(obj.links):
        name, mass = link.name, float(masses[i])
        if link.joint is not None and not link.collisions:
            if not any(child.parent == i for child in obj.links):  # else it only joins two joints
                results.append(failed(NAME, name, "it has no collision shape, so that nothing gives it a mass"))
            continue
        if link.joint is not None:
            results.append(within(NAME, name, mass, limits.link_mass_kg, "kg"))
        complaint = _complaint(specimen, i)
        if complaint:
            results.append(failed(NAME, name, complaint))
    worst = [result for result in results[1:] if not result.passed]
    return [results[0], *worst] if worst else [results[0], fine(NAME, "links", _summary(results[1:]))]


def _summary(results: list[CheckResult]) -> str:
    values = [result.value for result in results if result.value is not None]
    return f"moving links of {min(values):.2g} to {max(values):.2g} kg" if values else "no moving links"


def _complaint(specimen: Specimen, link: int) -> str:
    """What is wrong with a link's inertia, or nothing."""
    model, body = specimen.scene.model, specimen.scene.bodies[link]
    mass, moments = float(model.body_mass[body]), np.sort(model.body_inertia[body])
    if mass == 0 and not specimen.object.links[link].collisions:
        return ""  # a frame that carries others
    shown = ", ".join(f"{m:.2g}" for m in moments)
    if not (np.isfinite(moments).all() and moments[0] > 0):
        return f"principal moments must be positive: {shown} kg m2"
    if moments[0] + moments[1] < moments[2] * (1 - _SLACK):
        return f"no body has principal moments of which one exceeds the sum of the others: {shown} kg m2"
    radius, reach = math.sqrt(moments[2] / mass), _reach(specimen, link)
    if radius > reach:
        return f"radius of gyration {radius:.3f} m is larger than the link, {reach:.3f} m"
    return ""


def _reach(specimen: Specimen, link: int) -> float:
    """No point of a link's shapes is further than this from its centre of mass."""
    model, body = specimen.scene.model, specimen.scene.bodies[link]
    mine = model.geom_bodyid == body
    away = np.linalg.norm(model.geom_pos[mine] - model.body_ipos[body], axis=1)
    return float((away + model.geom_rbound[mine]).max())
