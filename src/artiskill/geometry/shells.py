"""Hollow bodies and bands: a section carried around an outline, or along a path."""

from typing import Any

import numpy as np

from artiskill.geometry.arrays import norm
from artiskill.geometry.meshes import TriMesh, loft


def ring_sweep(outline: Any, loop: Any, tile_m: float = 0.0) -> TriMesh:
    """A closed skin made by carrying a closed loop around a closed outline, as a lathe does around a circle.

    Args:
        outline: (N, 2) counter-clockwise seen from +z, about the z axis; it is scaled for each point of the loop.
        loop: (P, 2) scale of the outline and height, counter-clockwise in the plane (scale, z): outside going up,
            inside going down. It may be (N, P, 2) to differ around the outline.
        tile_m: side of the square that a texture covers; then there are texture coordinates, u around the outline,
            v along the loop. A whole number of squares goes around.
    """
    around = np.asarray(outline, dtype=float)
    loops = np.asarray(loop, dtype=float)
    if loops.ndim == 2:
        loops = np.broadcast_to(loops, (len(around), *loops.shape))
    if tile_m > 0:
        return _textured_ring(around, loops, tile_m)
    count, points = loops.shape[:2]
    xy = around[:, None, :] * loops[:, :, :1]  # (N, P, 2)
    vertices = np.concatenate((xy, loops[:, :, 1:]), axis=-1).reshape(-1, 3)
    i, p = (index.ravel() for index in np.mgrid[0:count, 0:points])
    j, q = (i + 1) % count, (p + 1) % points
    a, b, c, d = i * points + p, j * points + p, j * points + q, i * points + q
    return TriMesh(vertices, np.concatenate((np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1))))


def _textured_ring(around: np.ndarray, loops: np.ndarray, tile_m: float) -> TriMesh:
    """As `ring_sweep`, its vertices doubled along the two seams."""
    around, loops = np.concatenate((around, around[:1])), np.concatenate((loops, loops[:1]))
    loops = np.concatenate((loops, loops[:, :1]), axis=1)
    count, points = loops.shape[:2]
    xy = around[:, None, :] * loops[:, :, :1]
    vertices = np.concatenate((xy, loops[:, :, 1:]), axis=-1)
    along = norm(np.diff(around, axis=0))
    turns = max(1, round(float(along.sum() * loops[:, :, 0].max()) / tile_m))
    u = np.concatenate(([0.0], np.cumsum(along))) / along.sum() * turns
    v = np.concatenate(([0.0], np.cumsum(norm(np.diff(loops[0], axis=0))))) / tile_m
    uvs = np.stack(np.broadcast_arrays(u[:, None], v[None, :]), axis=-1).reshape(-1, 2)
    i, p = (index.ravel() for index in np.mgrid[0 : count - 1, 0 : points - 1])
    a = i * points + p
    b, c, d = a + points, a + points + 1, a + 1
    faces = np.concatenate((np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)))
    return TriMesh(vertices.reshape(-1, 3), faces, uvs.astype(np.float32))


def path_sweep(path: Any, section: Any, side: Any) -> TriMesh:
    """A closed skin made by carrying a convex section along an open path that lies in a plane.

    Args:
        path: (P, 3) points.
        section: (N, 2) convex outline, counter-clockwise: its first coordinate runs along `side`, its second in
            the plane, along tangent x side.
        side: (3,) unit normal of the plane.
    """
    points, around = np.asarray(path, dtype=float), np.asarray(section, dtype=float)
    normal = np.asarray(side, dtype=float)
    tangents = np.gradient(points, axis=0)
    tangents /= norm(tangents)[:, None]
    across = np.cross(tangents, normal)  # (P, 3)
    rings = points[:, None] + around[None, :, :1] * normal + around[None, :, 1:] * across[:, None]
    return loft(rings)
