"""What is touched is where something is drawn, and the other way round.

Of each link, points are spread by area over the drawn surface and over the outside of its collision shapes. Each
is measured to the other; a drawn point inside a collision shape counts as touched, for a shape that fills a drawn
hollow shows with its own surface. The given percentile of each direction must be small. What stands out is the
rest: bevels, small ornaments, edges.

What a neighbour covers, the link that carries it or one that it carries, is covered, too: the hood of a caster by
its wheel, a rod by its sleeve.
"""

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.kinematics import link_poses
from artiskill.checks.config import ChecksConfig, SurfacesConfig
from artiskill.checks.result import CheckResult, at_most, failed, fine
from artiskill.checks.shapes import TouchedSurface
from artiskill.checks.specimen import Specimen
from artiskill.geometry.meshes import merge
from artiskill.geometry.rotations import quat_conjugate, quat_rotate, transform_points
from artiskill.geometry.surfaces import make_surface

NAME = "surfaces"
_DENSE = 6000  # samples of a link's drawn surface, to find the triangles near a point
_CANDIDATES = 12


def check_surfaces(specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    """The worst link of each direction, and every link that fails."""
    obj = specimen.object
    results: list[CheckResult] = []
    drawn, touched = [], []
    poses = link_poses(obj, specimen.rest)
    bodies = [TouchedSurface(link.collisions) for link in obj.links]
    for i, link in enumerate(obj.links):
        if link.visuals and link.collisions:
            there, back = _distances(obj, i, bodies, poses, config.surfaces)
            drawn.append(_judge(link.name, there, config.surfaces, "drawn surface to touched one"))
            touched.append(_judge(link.name, back, config.surfaces, "touched surface to drawn one"))
        elif link.visuals:
            results.append(failed(NAME, link.name, "it is drawn and cannot be touched: no collision shape"))
        elif link.collisions:
            results.append(failed(NAME, link.name, "it can be touched and is not drawn"))
    for direction in (drawn, touched):
        direction.sort(key=lambda result: -(result.value or 0.0))
        results += direction[:1] + [result for result in direction[1:] if not result.passed]
    return results or [fine(NAME, "object", "nothing is drawn or touched")]


def _distances(
    obj: ArticulatedObject,
    index: int,
    bodies: list[TouchedSurface],
    poses: tuple[np.ndarray, np.ndarray],
    config: SurfacesConfig,
) -> tuple[np.ndarray, np.ndarray]:
    """Distances in metres of samples of a link's drawn surface to the touched one, and back."""
    rng = np.random.default_rng(0)  # fixed: the samples are a property of the link
    link = obj.links[index]
    surface = make_surface(merge(visual.mesh for visual in link.visuals), _DENSE, rng)
    drawn = surface.samples[: config.points]
    there = np.maximum(bodies[index].signed_distances(drawn), 0.0)
    positions, quaternions = poses
    world = transform_points(positions[index], quaternions[index], drawn)
    for k in _neighbours(obj, index):
        local = quat_rotate(quat_conjugate(quaternions[k]), world - positions[k])
        there = np.minimum(there, np.maximum(bodies[k].signed_distances(local), 0.0))
    back = surface.distances(bodies[index].samples(config.points, rng), _CANDIDATES)
    return there, back


def _neighbours(obj: ArticulatedObject, index: int) -> list[int]:
    """The links before and after a link, over those that have no shapes."""
    found = [obj.links[index].parent] if index else []
    found += [i for i, link in enumerate(obj.links) if link.parent == index]
    passed = [i for i in found if not obj.links[i].collisions]
    found += [obj.links[i].parent for i in passed if obj.links[i].parent not in (index, -1)]
    found += [k for k, link in enumerate(obj.links) if link.parent in passed and k != index]
    return sorted(set(found))


def _judge(link: str, distances: np.ndarray, config: SurfacesConfig, direction: str) -> CheckResult:
    value = float(np.percentile(distances, config.percentile)) if len(distances) else 0.0
    largest = f"{direction}, {config.percentile:g} % of it; at most {1e3 * distances.max(initial=0.0):.0f} mm"
    return at_most(NAME, link, value * 1e3, config.distance_m * 1e3, "mm", largest)
