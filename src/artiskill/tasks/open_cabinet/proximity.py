"""How the fingers lie around a handle: the costliest question that the reward asks, so it has a kernel.

One environment's step spends some 350 microseconds in the engine. The array calls below took 45 of another 200,
the kernel takes 5 (benchmarks/environment.py shows the whole). The array code remains for other libraries, and as
the definition that a test holds the kernel to.
"""

from typing import Any

import numpy as np

from artiskill.geometry.arrays import Array, amax, amin, clip, matmul, namespace
from artiskill.geometry.kernel import kernel
from artiskill.geometry.meshes import depth_inside
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet.goal import OpenGoal

# Five points along the fingers' mid-line, as weights of the ends (start, tip) of the two fingers' lines.
_MIDDLE_WEIGHTS = np.array([(1 - t, t, 1 - t, t) for t in (0.0, 0.25, 0.5, 0.75, 1.0)]) / 2


def handle_proximity(snapshot: Snapshot, goal: OpenGoal) -> tuple[Array, Array]:
    """How the first arm's fingers lie around the handle.

    Returns:
        (B, 2) least distance of each finger's line to the handle's points, and (B,) greatest depth of the fingers'
        mid-line in the handle's hull (positive inside), both in metres.
    """
    row, link = goal.row, goal.link
    origin, rotation = snapshot.link_position_w[row, link], snapshot.link_rotation_w[row, link]
    lines = snapshot.finger_line_w[:, :2]
    if isinstance(lines, np.ndarray):
        return _by_kernel(lines, origin, rotation, goal.handle_points, goal.handle_planes)
    return by_array_calls(lines, origin, rotation, goal.handle_points, goal.handle_planes)


def by_array_calls(
    lines_w: Array, origin_w: Array, rotation_w: Array, points: Array, planes: Array
) -> tuple[Array, Array]:
    """`handle_proximity` for any array library.

    Args:
        lines_w: (B, 2, 2, 3) finger lines, start and tip.
        origin_w: (B, 3) frame of the link that carries the handle.
        rotation_w: (B, 3, 3) likewise.
        points: (B, 3, P) of the handle, in that frame.
        planes: (B, F, 4) of the handle's hull, in that frame.
    """
    xp = namespace(lines_w)
    lines = matmul(lines_w - origin_w[:, None, None], rotation_w[:, None])  # in the link's frame
    start = lines[:, :, 0, :, None]  # (B, 2, 3, 1)
    line = lines[:, :, 1, :, None] - start
    to_points = points[:, None] - start  # (B, 2, 3, P)
    along = xp.sum(to_points * line, axis=-2) / xp.sum(line * line, axis=-2)  # (B, 2, P)
    gap = to_points - clip(along, 0.0, 1.0)[:, :, None] * line
    distance = xp.sqrt(amin(xp.sum(gap * gap, axis=-2)))
    samples = matmul(xp.asarray(_MIDDLE_WEIGHTS, dtype=lines.dtype), xp.reshape(lines, (-1, 4, 3)))  # (B, 5, 3)
    return distance, amax(depth_inside(planes, samples))


def load_kernel() -> None:
    """Compile the kernel, or read it from the disk's cache, now: no reset or step has to wait for it later."""
    _by_kernel(np.ones((1, 2, 2, 3)), np.ones((1, 3)), np.ones((1, 3, 3)), np.ones((1, 3, 1)), np.ones((1, 1, 4)))


def _by_kernel(
    lines_w: np.ndarray, origin_w: np.ndarray, rotation_w: np.ndarray, points: np.ndarray, planes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    batch = lines_w.shape[0]
    distance, depth = np.empty((batch, 2)), np.empty(batch)
    lines_w = np.ascontiguousarray(lines_w)  # one memory layout, one compilation
    for_each_environment(lines_w, origin_w, rotation_w, points, planes, _MIDDLE_WEIGHTS, distance, depth)
    return distance, depth


@kernel
def for_each_environment(
    lines_w: Any,
    origin_w: Any,
    rotation_w: Any,
    points: Any,
    planes: Any,
    weights: Any,
    distance: Any,
    depth: Any,
) -> None:
    """Fill `distance` (B, 2) and `depth` (B,); the other arguments as in `by_array_calls`."""
    ends, sample = np.empty((4, 3)), np.empty(3)
    for b in range(lines_w.shape[0]):
        for i in range(4):
            for k in range(3):
                ends[i, k] = 0.0
                for j in range(3):
                    ends[i, k] += (lines_w[b, i // 2, i % 2, j] - origin_w[b, j]) * rotation_w[b, j, k]
        for finger in range(2):
            distance[b, finger] = segment_distance(ends[2 * finger], ends[2 * finger + 1], points[b])
        depth[b] = -np.inf
        for i in range(weights.shape[0]):
            for k in range(3):
                sample[k] = 0.0
                for j in range(4):
                    sample[k] += weights[i, j] * ends[j, k]
            depth[b] = max(depth[b], -plane_height(sample, planes[b]))


@kernel
def segment_distance(start: Any, end: Any, points: Any) -> Any:
    """Least distance of a segment to points (3, P)."""
    line_x, line_y, line_z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    length_squared = line_x * line_x + line_y * line_y + line_z * line_z
    best = np.inf
    for p in range(points.shape[1]):
        x, y, z = points[0, p] - start[0], points[1, p] - start[1], points[2, p] - start[2]
        along = min(max((x * line_x + y * line_y + z * line_z) / length_squared, 0.0), 1.0)
        x, y, z = x - along * line_x, y - along * line_y, z - along * line_z
        best = min(best, x * x + y * y + z * z)
    return np.sqrt(best)


@kernel
def plane_height(point: Any, planes: Any) -> Any:
    """Greatest height of a point over planes (F, 4): negative inside the hull that they bound."""
    highest = -np.inf
    for i in range(planes.shape[0]):
        height = planes[i, 3]
        for k in range(3):
            height += planes[i, k] * point[k]
        highest = max(highest, height)
    return highest
