"""Distances of points to a triangle mesh's surface: a search for near triangles, then exact geometry."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from artiskill.geometry.meshes import TriMesh, triangle_areas


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh's surface, made searchable by samples.

    Attributes:
        corners: (F, 3, 3) the triangles.
        samples: (N, 3) points spread by area over them, in random order.
        faces: (N,) on which triangle each sample lies.
    """

    corners: np.ndarray
    samples: np.ndarray
    faces: np.ndarray

    def distances(self, points: np.ndarray, candidates: int = 4) -> np.ndarray:
        """Distance of each point to the surface, never too small.

        Exact where the nearest triangle is among those of the `candidates` nearest samples; samples that are dense
        against the triangles' size make it so, nearly always.

        Args:
            points: (P, 3) in the mesh's frame.
            candidates: how many samples' triangles are looked at.

        Returns:
            (P,) metres.
        """
        candidates = min(candidates, len(self.samples))
        found = self._tree.query(points, k=candidates)[1].reshape(len(points), candidates)
        triangles = self.corners[self.faces[found]]  # (P, k, 3, 3)
        return point_triangle_distance(points[:, None], triangles).min(axis=1)

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.samples)

    def __getstate__(self) -> dict[str, Any]:
        """Without the search tree, which is found again faster than it travels."""
        return {name: value for name, value in self.__dict__.items() if name != "_tree"}


def make_surface(mesh: TriMesh, count: int, rng: np.random.Generator) -> Surface:
    """The surface of a mesh with area, with so many samples.

    Samples are stratified: one in each of `count` equal shares of the area, so that they are more even than
    independent ones, and no triangle of some size goes without.
    """
    areas = triangle_areas(mesh)
    ends = np.cumsum(areas)
    at = (np.arange(count) + rng.random(count)) * (ends[-1] / count)
    faces = np.minimum(np.searchsorted(ends, at, side="right"), len(areas) - 1)
    u, v = rng.random((2, count))
    flip = u + v > 1
    u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
    corners = mesh.vertices[mesh.faces]
    a, b, c = (corners[faces, i] for i in range(3))
    samples = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    order = rng.permutation(count)
    return Surface(corners, samples[order], faces[order])


def point_triangle_distance(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Distance of points to triangles. (..., 3), (..., 3, 3) -> (...); triangles without area are segments.

    Where the foot of the perpendicular lies inside, it is the height over the plane, else the distance to the
    nearest edge.
    """
    a, b, c = (triangles[..., i, :] for i in range(3))
    edges = np.stack([_segment_distance2(points, *ends) for ends in ((a, b), (b, c), (c, a))])
    nearest = edges.min(axis=0)
    normal = np.cross(b - a, c - a)
    length2 = np.sum(normal * normal, axis=-1)
    inside = length2 > 0
    for start, end in ((a, b), (b, c), (c, a)):
        inside = inside & (np.sum(np.cross(end - start, points - start) * normal, axis=-1) >= 0)
    height = np.sum((points - a) * normal, axis=-1)
    plane = height * height / np.where(length2 > 0, length2, 1.0)
    return np.sqrt(np.where(inside, plane, nearest))


def _segment_distance2(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    along = end - start
    length2 = np.sum(along * along, axis=-1)
    share = np.sum((points - start) * along, axis=-1) / np.where(length2 > 0, length2, 1.0)
    offset = points - start - np.clip(share, 0.0, 1.0)[..., None] * along
    return np.sum(offset * offset, axis=-1)
