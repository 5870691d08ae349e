"""How the hand lies at a handle: the costliest questions of the cabinet tasks' reward, so they have kernels.

One environment's step spends some 350 microseconds in the engine. The array calls of `finger_distances` took 45 of
another 200, the kernel takes 5 (benchmarks/environment.py shows the whole). The array code remains for other
libraries, and as the definition that a test holds the kernels to. Handle data is in the frame of the link that
carries the handle.
"""

from typing import Any

import numpy as np

from artiskill.geometry.arrays import Array, amax, amin, arccos, clip, dot, matmul, namespace
from artiskill.geometry.kernel import allocating_kernel, kernel
from artiskill.geometry.meshes import depth_inside

# Five points along the fingers' mid-line, as weights of the ends (start, tip) of the two fingers' lines.
_MIDDLE_WEIGHTS = np.array([(1 - t, t, 1 - t, t) for t in (0.0, 0.25, 0.5, 0.75, 1.0)]) / 2


def hand_angle(link_w: Array, hand_w: Array, grasps: Array) -> Array:
    """Return the angle between a hand and the nearest of a handle's grasp poses, over pi: (B,) in [0, 1].

    Args:
        link_w: (B, 3, 3) rotation of the link that carries the handle.
        hand_w: (B, 3, 3) rotation of the hand.
        grasps: (B, G, 3, 3) rotations of the grasp poses.
    """
    xp = namespace(hand_w)
    if isinstance(hand_w, np.ndarray):
        trace = np.empty(len(hand_w))
        _grasp_trace_kernel(link_w, np.ascontiguousarray(hand_w), grasps, trace)
    else:
        trace = grasp_trace_reference(link_w, hand_w, grasps)
    return arccos(clip(0.5 * trace - 0.5, -1.0, 1.0)) / xp.pi


def grasp_trace_reference(link_w: Array, hand_w: Array, grasps: Array) -> Array:
    """Return the greatest trace of the rotations between a hand and grasp poses, (B,); see `hand_angle`."""
    xp = namespace(hand_w)
    hand = matmul(xp.matrix_transpose(link_w), hand_w)  # in the link's frame
    return amax(dot(xp.reshape(hand, (-1, 1, 9)), xp.reshape(grasps, (*grasps.shape[:2], 9))))


@allocating_kernel
def _grasp_trace_kernel(link_w: Any, hand_w: Any, grasps: Any, trace: Any) -> None:
    """Fill `trace` (B,); the other arguments as in `grasp_trace_reference`."""
    hand = np.empty((3, 3))
    for b in range(link_w.shape[0]):
        for i in range(3):
            for j in range(3):
                hand[i, j] = 0.0
                for k in range(3):
                    hand[i, j] += link_w[b, k, i] * hand_w[b, k, j]
        trace[b] = -np.inf
        for g in range(grasps.shape[1]):
            summed = 0.0
            for i in range(3):
                for j in range(3):
                    summed += hand[i, j] * grasps[b, g, i, j]
            trace[b] = max(trace[b], summed)


def finger_distances(
    lines_w: Array, origin_w: Array, rotation_w: Array, points: Array, planes: Array
) -> tuple[Array, Array]:
    """Return how two fingers lie around a handle.

    Args:
        lines_w: (B, 2, 2, 3) of each finger a line, from its start to its tip.
        origin_w: (B, 3) frame of the link that carries the handle.
        rotation_w: (B, 3, 3) rotation of that frame.
        points: (B, 3, P) of the handle.
        planes: (B, F, 4) of the handle's hull.

    Returns:
        (B, 2) least distance of each finger's line to the handle's points, and (B,) greatest depth of the fingers'
        mid-line in the handle's hull (positive inside), both in metres.
    """
    if not isinstance(lines_w, np.ndarray):
        return finger_distances_reference(lines_w, origin_w, rotation_w, points, planes)
    distance, depth = np.empty((len(lines_w), 2)), np.empty(len(lines_w))
    lines_w = np.ascontiguousarray(lines_w)  # one memory layout, one compilation
    _finger_distances_kernel(lines_w, origin_w, rotation_w, points, planes, _MIDDLE_WEIGHTS, distance, depth)
    return distance, depth


def finger_distances_reference(
    lines_w: Array, origin_w: Array, rotation_w: Array, points: Array, planes: Array
) -> tuple[Array, Array]:
    """Return `finger_distances` for any array library: the kernel's definition."""
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


@allocating_kernel
def _finger_distances_kernel(
    lines_w: Any,
    origin_w: Any,
    rotation_w: Any,
    points: Any,
    planes: Any,
    weights: Any,
    distance: Any,
    depth: Any,
) -> None:
    """Fill `distance` (B, 2) and `depth` (B,); the other arguments as in `finger_distances`."""
    ends, sample = np.empty((4, 3)), np.empty(3)
    for b in range(lines_w.shape[0]):
        for i in range(4):
            for k in range(3):
                ends[i, k] = 0.0
                for j in range(3):
                    ends[i, k] += (lines_w[b, i // 2, i % 2, j] - origin_w[b, j]) * rotation_w[b, j, k]
        for finger in range(2):
            distance[b, finger] = _segment_distance(ends[2 * finger], ends[2 * finger + 1], points[b])
        depth[b] = -np.inf
        for i in range(weights.shape[0]):
            for k in range(3):
                sample[k] = 0.0
                for j in range(4):
                    sample[k] += weights[i, j] * ends[j, k]
            depth[b] = max(depth[b], -_plane_height(sample, planes[b]))


@kernel
def _segment_distance(start: Any, end: Any, points: Any) -> Any:
    """Return the least distance of a segment to points (3, P)."""
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
def _plane_height(point: Any, planes: Any) -> Any:
    """Return the greatest height of a point over planes (F, 4): negative inside the hull that they bound."""
    highest = -np.inf
    for i in range(planes.shape[0]):
        height = planes[i, 3]
        for k in range(3):
            height += planes[i, k] * point[k]
        highest = max(highest, height)
    return highest


def load_kernels() -> None:
    """Compile the kernels, or read them from the disk's cache, now: no reset or step has to wait later."""
    one = np.ones((1, 3, 3))
    hand_angle(one, one, one[None])
    finger_distances(np.ones((1, 2, 2, 3)), np.ones((1, 3)), one, np.ones((1, 3, 1)), np.ones((1, 1, 4)))
