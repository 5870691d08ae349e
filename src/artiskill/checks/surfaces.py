"""Collision shapes are where something is drawn, and the other way round; the cavities of drawers are empty."""

from collections.abc import Callable, Sequence

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape, Link
from artiskill.assets.handles import is_handle_part
from artiskill.checks.config import SurfacesConfig
from artiskill.checks.context import CheckContext, CheckResult, at_most, failed, fine
from artiskill.geometry.meshes import ConvexHull, TriMesh, convex_hull, depth_inside, merge
from artiskill.geometry.primitives import box, capsule, cylinder, sphere
from artiskill.geometry.rotations import quat_conjugate, quat_rotate, transform_points
from artiskill.geometry.surfaces import make_surface, point_triangle_distance

_DENSE = 6000  # samples of a link's visual surface, to find the triangles near a point
_CANDIDATES = 12
_SEGMENTS = 32  # of a round shape's mesh, from which samples are drawn
# Samples deeper than this inside a shape are hidden; those on a polyhedron's faces lie inside by less.
_SKIN_M = 0.002

_GRID = 12  # columns along each side of a drawer
_LEVELS = 4  # points in each column
_MARGIN_M = 0.012  # from bottom and rim: twice the thickness by which collision shapes may exceed what is drawn
_SHALLOW_M = 0.03  # less than this is no cavity


def check_surfaces(context: CheckContext) -> list[CheckResult]:
    """Check each link's visual surface against its collision shapes: the worst link each way, and all that fail.

    Points are spread by area over the visual surface and over the outside of the collision shapes. Each is
    measured to the other. A visual point inside a collision shape counts as covered: a shape that fills a visible
    cavity shows with its own surface. The given percentile of each direction must be small. What stands out is the
    rest: bevels, small ornaments, edges. What a neighbour covers, the link that carries it or one that it carries,
    is covered, too: the hood of a caster by its wheel, a rod by its sleeve.
    """
    obj, config = context.object, context.config.surfaces
    results: list[CheckResult] = []
    visual_to_collision, collision_to_visual = [], []
    bodies = [CollisionSurface(link.collisions) for link in obj.links]
    for i, link in enumerate(obj.links):
        if link.visuals and link.collisions:
            there, back = _distances(context, i, bodies)
            visual_to_collision.append(_judge(link.name, there, config, "visual to collision surface"))
            collision_to_visual.append(_judge(link.name, back, config, "collision to visual surface"))
        elif link.visuals:
            results.append(failed(link.name, "it is drawn and has no collision shape"))
        elif link.collisions:
            results.append(failed(link.name, "it has collision shapes and is not drawn"))
    for direction in (visual_to_collision, collision_to_visual):
        direction.sort(key=lambda result: -(result.value or 0.0))
        results += direction[:1] + [result for result in direction[1:] if not result.passed]
    return results or [fine("object", "nothing is drawn, and there are no collision shapes")]


def _distances(
    context: CheckContext, index: int, bodies: list["CollisionSurface"]
) -> tuple[np.ndarray, np.ndarray]:
    """Return distances in metres of samples of a link's visual surface to the collision shapes, and back."""
    rng = np.random.default_rng(0)  # fixed: the samples are a property of the link
    points = context.config.surfaces.points
    surface = make_surface(merge(visual.mesh for visual in context.object.links[index].visuals), _DENSE, rng)
    drawn = surface.samples[:points]
    there = np.maximum(bodies[index].signed_distances(drawn), 0.0)
    positions, quaternions = context.rest_poses
    world = transform_points(positions[index], quaternions[index], drawn)
    for k in _neighbours(context.object, index):
        local = quat_rotate(quat_conjugate(quaternions[k]), world - positions[k])
        there = np.minimum(there, np.maximum(bodies[k].signed_distances(local), 0.0))
    return there, surface.distances(bodies[index].samples(points, rng), _CANDIDATES)


def _neighbours(obj: ArticulatedObject, index: int) -> list[int]:
    """Return the links before and after a link, over those that have no shapes."""
    found = [obj.links[index].parent] if index else []
    found += [i for i, link in enumerate(obj.links) if link.parent == index]
    passed = [i for i in found if not obj.links[i].collisions]
    found += [obj.links[i].parent for i in passed if obj.links[i].parent not in (index, -1)]
    found += [k for k, link in enumerate(obj.links) if link.parent in passed and k != index]
    return sorted(set(found))


def _judge(link: str, distances: np.ndarray, config: SurfacesConfig, direction: str) -> CheckResult:
    value = float(np.percentile(distances, config.percentile)) if len(distances) else 0.0
    largest = f"{direction}, {config.percentile:g} % of it; at most {1e3 * distances.max(initial=0.0):.0f} mm"
    return at_most(link, value * 1e3, config.distance_m * 1e3, "mm", largest)


def check_cavity(context: CheckContext) -> list[CheckResult]:
    """Check that collision shapes leave the visible cavity of each drawer free: how much of it is solid.

    The cavity is found from what is drawn: seen from above, everything over the drawer's bottom and under its rim
    that no surface covers. It is then probed with points, at rest, against the shapes of all links.
    """
    obj = context.object
    positions, quaternions = context.rest_poses
    bodies = [CollisionSurface(link.collisions) for link in obj.links]
    results = []
    for i, link in enumerate(obj.links):
        if link.joint is None or link.joint.kind != "prismatic":
            continue
        points = _cavity_points(link)
        if len(points) == 0:
            results.append(fine(link.name, "it has no visible cavity"))
            continue
        world = transform_points(positions[i], quaternions[i], points)
        solid, where = np.zeros(len(points), dtype=bool), []
        for k, body in enumerate(bodies):
            local = transform_points(np.zeros(3), quat_conjugate(quaternions[k]), world - positions[k])
            inside = body.signed_distances(local) < 0
            where += [obj.links[k].name] if inside.any() else []
            solid |= inside
        share, limit = 100 * float(solid.mean()), 100 * context.config.surfaces.solid_share
        note = f"shapes of {', '.join(where)} fill its opening" if share > limit else ""
        results.append(at_most(link.name, share, limit, "%", note))
    return results


def _cavity_points(link: Link) -> np.ndarray:
    """Return points in the visible cavity of a link that is open at its top. (N, 3) in its frame."""
    # what makes the drawer's box: handles and fronts stand out of it
    meshes = [v.mesh for v in link.visuals if not is_handle_part(v.part) and "front" not in v.part]
    if not meshes:
        return np.zeros((0, 3))
    mesh = merge(meshes)
    low, high = mesh.bounds
    steps = (np.arange(_GRID) + 0.5) / _GRID
    grid = np.stack(np.meshgrid(*(low[a] + steps * (high[a] - low[a]) for a in (0, 1))), axis=-1).reshape(-1, 2)
    bottom = _heights_below(mesh, grid)
    rim = _rim(bottom[np.isfinite(bottom)], high[2])
    open_columns = np.isfinite(bottom) & (bottom < rim - _SHALLOW_M)
    shares = np.linspace(0.0, 1.0, _LEVELS)
    first, last = bottom[open_columns] + _MARGIN_M, rim - _MARGIN_M
    z = first[:, None] + shares * (last - first)[:, None]
    xy = np.repeat(grid[open_columns][:, None], _LEVELS, axis=1)
    return np.concatenate((xy, z[..., None]), axis=-1).reshape(-1, 3)


def _heights_below(mesh: TriMesh, xy: np.ndarray) -> np.ndarray:
    """Return the height of the highest surface at places seen from above, else -inf. (P, 2) -> (P,)."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    area = _cross(b[:, :2] - a[:, :2], c[:, :2] - a[:, :2])
    seen = np.abs(area) > 1e-12  # upright triangles are lines from above
    a, b, c, area = a[seen], b[seen], c[seen], area[seen]
    p = xy[:, None]
    u = _cross(b[:, :2] - a[:, :2], p - a[:, :2]) / area  # weight of c
    v = _cross(p - a[:, :2], c[:, :2] - a[:, :2]) / area  # weight of b
    inside = (u >= 0) & (v >= 0) & (u + v <= 1)
    z = a[:, 2] + v * (b[:, 2] - a[:, 2]) + u * (c[:, 2] - a[:, 2])
    return np.where(inside, z, -np.inf).max(axis=1, initial=-np.inf)


def _rim(bottom: np.ndarray, top: float) -> float:
    """Return the height of a drawer's sides: its columns that are no opening. The front may be higher."""
    walls = bottom[bottom > np.median(bottom) + _SHALLOW_M] if len(bottom) else bottom
    return float(min(np.median(walls), top)) if len(walls) else top


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


class CollisionSurface:
    """The collision shapes of one link as one body, in the link's frame."""

    def __init__(self, shapes: Sequence[CollisionShape]) -> None:
        self._shapes = shapes
        self._hulls = {i: convex_hull(s.vertices) for i, s in enumerate(shapes) if s.vertices is not None}

    def signed_distances(self, points: np.ndarray) -> np.ndarray:
        """Return distances of points to the nearest shape, negative inside: minus the depth in the deepest one.

        Args:
            points: (P, 3) in the link's frame.

        Returns:
            (P,) metres; infinite where there are no shapes.
        """
        nearest = np.full(len(points), np.inf)
        for i in range(len(self._shapes)):
            nearest = np.minimum(nearest, self._distance(i, points, nearest))
        return nearest

    def samples(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Sample points by area over the shapes, those inside another shape left out. (<= count, 3)."""
        if not self._shapes:
            return np.zeros((0, 3))
        mesh = merge(map(collision_mesh, self._shapes))
        points = make_surface(mesh, count, rng).samples
        return points[self.signed_distances(points) > -_SKIN_M]

    def _distance(self, index: int, points: np.ndarray, known: np.ndarray) -> np.ndarray:
        """Return distances to one shape; where `known` is smaller, they may be too small, but not below that."""
        shape = self._shapes[index]
        back = quat_conjugate(np.asarray(shape.quaternion, dtype=float))
        local = transform_points(np.zeros(3), back, points - np.asarray(shape.position, dtype=float))
        if index in self._hulls:
            return _hull_distance(self._hulls[index], local, known)
        return _DISTANCES[shape.kind](local, shape.size)


def collision_mesh(shape: CollisionShape) -> TriMesh:
    """Return the surface of a collision shape, in its link's frame."""
    mesh = convex_hull(shape.vertices).mesh if shape.vertices is not None else _MESHES[shape.kind](shape.size)
    return mesh.transformed(shape.position, shape.quaternion)


def _box_distance(points: np.ndarray, size: tuple[float, ...]) -> np.ndarray:
    return _from_excess(np.abs(points) - np.asarray(size))


def _cylinder_distance(points: np.ndarray, size: tuple[float, ...]) -> np.ndarray:
    radial = np.linalg.norm(points[:, :2], axis=1) - size[0]
    return _from_excess(np.stack((radial, np.abs(points[:, 2]) - size[1]), axis=1))


def _capsule_distance(points: np.ndarray, size: tuple[float, ...]) -> np.ndarray:
    beyond = points - np.array((0.0, 0.0, 1.0)) * np.clip(points[:, 2], -size[1], size[1])[:, None]
    return np.linalg.norm(beyond, axis=1) - size[0]


def _sphere_distance(points: np.ndarray, size: tuple[float, ...]) -> np.ndarray:
    return np.linalg.norm(points, axis=1) - size[0]


def _from_excess(excess: np.ndarray) -> np.ndarray:
    """Turn how far points are beyond each pair of a shape's faces, (P, n), into signed distances (P,)."""
    outside = np.linalg.norm(np.maximum(excess, 0.0), axis=1)
    return outside + np.minimum(excess.max(axis=1), 0.0)


def _hull_distance(hull: ConvexHull, points: np.ndarray, known: np.ndarray) -> np.ndarray:
    distances = -depth_inside(hull.planes, points)  # outside of the hull a lower bound
    unsure = (distances > 0) & (distances < known)
    if unsure.any():
        corners = hull.mesh.vertices[hull.mesh.faces]
        distances[unsure] = point_triangle_distance(points[unsure, None], corners[None]).min(axis=1)
    return distances


_DISTANCES: dict[str, Callable[[np.ndarray, tuple[float, ...]], np.ndarray]] = {
    "box": _box_distance,
    "cylinder": _cylinder_distance,
    "capsule": _capsule_distance,
    "sphere": _sphere_distance,
}
_MESHES: dict[str, Callable[[tuple[float, ...]], TriMesh]] = {
    "box": box,
    "cylinder": lambda size: cylinder(size[0], size[1], _SEGMENTS),
    "capsule": lambda size: capsule(size[0], size[1], _SEGMENTS),
    "sphere": lambda size: sphere(size[0], _SEGMENTS),
}
