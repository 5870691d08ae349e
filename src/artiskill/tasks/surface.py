"""How near the fingertips are to an object's surface, for tasks in which any part of it may be touched."""

from functools import lru_cache
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.geometry.arrays import Array, amin, dot, namespace, rotate, total
from artiskill.geometry.kernel import kernel
from artiskill.geometry.meshes import sample_surface, triangle_areas
from artiskill.sim.snapshot import Snapshot

POINTS = 800  # on a chair, some 4 cm apart
_CACHED_OBJECTS = 256


@lru_cache(maxsize=_CACHED_OBJECTS)
def surface_samples(obj: ArticulatedObject) -> tuple[np.ndarray, np.ndarray]:
    """Points spread over everything drawn of an object, the same ones every time.

    Returns:
        (POINTS, 3) in the frame of their link, and (POINTS,) the index of that link.
    """
    rng = np.random.default_rng(0)  # fixed: the points are a property of the object
    areas = np.array([total(float(triangle_areas(v.mesh).sum()) for v in link.visuals) for link in obj.links])
    ends = np.round(np.cumsum(areas / areas.sum()) * POINTS).astype(int)
    counts = np.diff(ends, prepend=0)
    points = [
        sample_surface([v.mesh for v in link.visuals], count, rng)
        for link, count in zip(obj.links, counts, strict=True)
        if count
    ]
    return np.concatenate(points), np.repeat(np.arange(len(obj.links)), counts)


def fingertip_distance(snapshot: Snapshot, row: Array, points: Array, link: Array) -> Array:
    """Mean distance of the fingertips to the nearest of the surface's points, (B,) in metres.

    Args:
        snapshot: an instant.
        row: (B,) 0 to B - 1.
        points: (B, P, 3) in the frame of their link.
        link: (B, P) index of that link.
    """
    tips = snapshot.fingertip_position_w
    if isinstance(tips, np.ndarray):
        distance = np.empty(len(tips))
        tips = np.ascontiguousarray(tips)
        for_each_environment(tips, snapshot.link_position_w, snapshot.link_rotation_w, points, link, distance)
        return distance
    return by_array_calls(tips, snapshot.link_position_w, snapshot.link_rotation_w, row, points, link)


def by_array_calls(
    tips: Array, position_w: Array, rotation_w: Array, row: Array, points: Array, link: Array
) -> Array:
    """`fingertip_distance` for any array library; the kernel's definition.

    Args:
        tips: (B, T, 3) in the world.
        position_w: (B, L, 3) of the links.
        rotation_w: (B, L, 3, 3) of the links.
        row: (B,) 0 to B - 1.
        points: (B, P, 3).
        link: (B, P).
    """
    xp = namespace(tips)
    rows = row[:, None]
    in_world = rotate(rotation_w[rows, link], points) + position_w[rows, link]  # (B, P, 3)
    gap = tips[:, :, None] - in_world[:, None]  # (B, T, P, 3)
    return xp.mean(xp.sqrt(amin(dot(gap, gap))), axis=-1)


def load_kernel() -> None:
    """Compile the kernel, or read it from the disk's cache, now: no reset or step has to wait for it later."""
    one = np.ones((1, 1, 3))
    for_each_environment(one, one, np.ones((1, 1, 3, 3)), one, np.zeros((1, 1), dtype=np.int64), np.empty(1))


@kernel
def for_each_environment(
    tips: Any, position_w: Any, rotation_w: Any, points: Any, link: Any, distance: Any
) -> None:
    """Fill `distance` (B,); the other arguments as in `by_array_calls`."""
    count = tips.shape[1]
    nearest = np.empty(count)
    for b in range(tips.shape[0]):
        nearest[:] = np.inf
        for p in range(points.shape[1]):
            k = link[b, p]
            x, y, z = points[b, p, 0], points[b, p, 1], points[b, p, 2]
            turn, origin = rotation_w[b, k], position_w[b, k]
            world_x = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z + origin[0]
            world_y = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z + origin[1]
            world_z = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z + origin[2]
            for t in range(count):
                dx, dy, dz = tips[b, t, 0] - world_x, tips[b, t, 1] - world_y, tips[b, t, 2] - world_z
                nearest[t] = min(nearest[t], dx * dx + dy * dy + dz * dz)
        total = 0.0
        for t in range(count):
            total += np.sqrt(nearest[t])
        distance[b] = total / count
