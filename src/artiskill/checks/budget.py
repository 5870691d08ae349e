"""The engine compiles the object, and it costs no more to draw and to touch than its category may."""

from artiskill.checks.config import ChecksConfig
from artiskill.checks.result import CheckResult, at_most, failed, fine
from artiskill.checks.specimen import Specimen

COMPILES, TRIANGLES, GEOMS = "compiles", "triangles", "geoms"


def check_compiles(specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    """Whether there is a model, and a still one."""
    try:
        data = specimen.scene.rest_data()
    except ValueError as error:
        return [failed(COMPILES, "object", f"the engine refuses it: {' '.join(str(error).split())}")]
    warnings = int(sum(warning.number for warning in data.warning))
    if warnings:
        return [failed(COMPILES, "object", f"the engine warns {warnings} times at rest")]
    model = specimen.scene.model
    return [fine(COMPILES, "object", f"{model.nbody - 1} bodies, {model.nv} degrees of freedom")]


def check_budget(specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    """Triangles that are drawn, and collision shapes."""
    links, limits = specimen.object.links, config.of(specimen.object.category)
    triangles = sum(len(visual.mesh.faces) for link in links for visual in link.visuals)
    geoms = sum(len(link.collisions) for link in links)
    return [
        at_most(TRIANGLES, "object", triangles, limits.triangles),
        at_most(GEOMS, "object", geoms, limits.geoms),
    ]
