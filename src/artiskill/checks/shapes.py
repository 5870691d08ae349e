"""Collision shapes as geometry: signed distances of points to them, samples of their surface."""

from collections.abc import Callable, Sequence

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.geometry.meshes import ConvexHull, TriMesh, convex_hull, depth_inside, merge
from artiskill.geometry.primitives import box, capsule, cylinder, sphere
from artiskill.geometry.rotations import quat_conjugate, transform_points
from artiskill.geometry.surfaces import make_surface, point_triangle_distance

_SEGMENTS = 32  # of a round shape's mesh, from which samples are drawn
_SKIN_M = (
    0.002  # samples deeper than this inside a shape are hidden; those on a polyhedron's faces lie inside by less
)


class TouchedSurface:
    """The collision shapes of one link as one body, in the link's frame."""

    def __init__(self, shapes: Sequence[CollisionShape]) -> None:
        self._shapes = shapes
        self._hulls = {i: convex_hull(s.vertices) for i, s in enumerate(shapes) if s.vertices is not None}

    def signed_distances(self, points: np.ndarray) -> np.ndarray:
        """Distance of each point to the nearest shape, negative inside: minus the depth in the deepest one.

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
        """Points spread by area over the shapes, those inside another shape left out. (<= count, 3)."""
        if not self._shapes:
            return np.zeros((0, 3))
        mesh = merge(self._mesh(i) for i in range(len(self._shapes)))
        points = make_surface(mesh, count, rng).samples
        return points[self.signed_distances(points) > -_SKIN_M]

    def _mesh(self, index: int) -> TriMesh:
        shape = self._shapes[index]
        mesh = self._hulls[index].mesh if index in self._hulls else _MESHES[shape.kind](shape.size)
        return mesh.transformed(shape.position, shape.quaternion)

    def _distance(self, index: int, points: np.ndarray, known: np.ndarray) -> np.ndarray:
        """To one shape; where `known` is smaller anyway, it may be too small, but not smaller than that."""
        shape = self._shapes[index]
        back = quat_conjugate(np.asarray(shape.quaternion, dtype=float))
        local = transform_points(np.zeros(3), back, points - np.asarray(shape.position, dtype=float))
        if index in self._hulls:
            return _hull_distance(self._hulls[index], local, known)
        return _DISTANCES[shape.kind](local, shape.size)


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
    """From how far points are beyond each pair of a shape's faces, (P, n), to signed distances (P,)."""
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
