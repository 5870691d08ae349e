"""How far a vessel's body reaches out, by direction and height: what hands press against from the sides."""

import itertools
from functools import lru_cache

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape
from artiskill.geometry.arrays import matmul
from artiskill.geometry.meshes import convex_hull
from artiskill.geometry.rotations import transform_points

DIRECTIONS = 72  # every five degrees, from the root's +x on
LEVELS = (0.3, 0.4, 0.5, 0.6, 0.7)  # shares of the body's height
_CACHED_OBJECTS = 256


@lru_cache(maxsize=_CACHED_OBJECTS)
def body_outline(obj: ArticulatedObject, bottom_m: float, top_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Where rays from the root's z axis leave the root link's collision shapes, at some heights.

    What is touched counts, not what is drawn: a round wall is touched as a polygon. Shapes that are neither hulls
    nor boxes count as the boxes around them.

    Args:
        obj: the object.
        bottom_m: of its body, in the root's frame.
        top_m: likewise.

    Returns:
        (Z,) heights in the root's frame and (Z, DIRECTIONS) distances from the axis, 0 where a ray meets nothing.
    """
    hulls = [convex_hull(_corners(shape)).mesh for shape in obj.links[0].collisions]
    triangles = np.concatenate([hull.vertices[hull.faces] for hull in hulls])  # (T, 3, 3)
    heights = bottom_m + np.array(LEVELS) * (top_m - bottom_m)
    return heights, np.stack([_section_reach(triangles, z) for z in heights])


def _corners(shape: CollisionShape) -> np.ndarray:
    """Of a hull or of the box around any other shape, (V, 3) in the link's frame."""
    if shape.vertices is not None:
        local = shape.vertices
    else:
        local = np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * _half_extents(shape)
    return np.asarray(transform_points(shape.position, shape.quaternion, local))


def _half_extents(shape: CollisionShape) -> tuple[float, ...]:
    if shape.kind == "box":
        return shape.size
    radius = shape.size[0]
    if shape.kind == "sphere":
        return (radius, radius, radius)
    return (radius, radius, shape.size[1] + (radius if shape.kind == "capsule" else 0.0))


def _section_reach(triangles: np.ndarray, z: float) -> np.ndarray:
    """(DIRECTIONS,) how far the section at a height reaches out from the axis."""
    above = triangles[:, :, 2] > z
    crossing = triangles[above.any(axis=1) & ~above.all(axis=1)]
    start, end = crossing, np.roll(crossing, -1, axis=1)  # (T, 3 edges, 3)
    cut = (start[:, :, 2] > z) != (end[:, :, 2] > z)  # two edges of each triangle
    a, b = start[cut], end[cut]
    share = (z - a[:, 2]) / (b[:, 2] - a[:, 2])
    points = (a[:, :2] + share[:, None] * (b[:, :2] - a[:, :2])).reshape(-1, 2, 2)  # segments of the section
    angles = 2 * np.pi / DIRECTIONS * np.arange(DIRECTIONS)
    along = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    across = np.stack((-np.sin(angles), np.cos(angles)), axis=-1)
    side, out = matmul(points, across.T), matmul(points, along.T)  # (S, 2, D)
    met = (side[:, 0] > 0) != (side[:, 1] > 0)
    width = np.where(met, side[:, 0] - side[:, 1], 1.0)
    reach = out[:, 0] + side[:, 0] / width * (out[:, 1] - out[:, 0])
    found: np.ndarray = np.where(met, reach, 0.0).max(axis=0, initial=0.0)
    return found
