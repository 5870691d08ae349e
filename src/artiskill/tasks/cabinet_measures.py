"""What the cabinet tasks measure for rewards and states: how the target moves, how the hand lies at its handle.

An environment's step spends some 300 microseconds in the engine, and had 50 more in these array calls; the kernels
take 7 (benchmarks/environment.py shows the whole). The array code remains for other libraries, and as the
definition that a test holds the kernels to. Handle data is in the frame of the link that carries the handle.

A link that is ajar counts as held, if the task says so: `finger_gap` and `depth` then are as if the fingers closed
in while it opens. At `_HELD` of the range that the task gives, they are at the handle, at its end they grip it.
`pushing_distance` is from the place behind the handle where the link is pushed: it counts once that is ajar.

The state of the paper has joints and a root: enough for an agent of one cabinet, which learns where the handle is.
Of many cabinets `describe_handle` says where the hand shall go, and in which direction it shall pull.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from artiskill.geometry.arrays import (
    Array,
    amax,
    amin,
    arccos,
    clip,
    columns,
    dot,
    matmul,
    namespace,
    norm,
    rotate,
    total,
)
from artiskill.geometry.kernel import allocating_kernel, inlined_kernel, kernel
from artiskill.geometry.meshes import depth_inside
from artiskill.geometry.rotations import cross
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.state_vector import FAR_M, ObservationField, along_base_axes, base_position

MEASURES = (  # what they mean stands with the task's table of stages
    "hand_angle",
    "handle_distance",
    "depth",
    "finger_gap",
    "opening_speed",
    "opening",
    "speed",
    "pushing_distance",
    "angular_speed",
)
# Five points along the fingers' mid-line, as weights of the ends (start, tip) of the two fingers' lines.
_MIDDLE_WEIGHTS = np.array([(1 - t, t, 1 - t, t) for t in (0.0, 0.25, 0.5, 0.75, 1.0)]) / 2
_HELD = 0.7  # of the range over which a link comes to count as held
# Over the whole range, depth seems to rise from -16 to 7 mm, `finger_gap` to fall from 3.1 to 0.1, a firm grip.
# They begin beyond where the hand comes to count as near: no reward jumps where a link becomes ajar.
_RANGES_PER_M, _GAP_PER_RANGE = 45.0, 3.0
CLOSED_M = 1.0  # added to `pushing_distance` while a door is closed; it fades as the door becomes ajar
NEVER_AJAR = (1e9, 2e9)  # no link opens so far
_MOST_OPENING = 100.0
HANDLE_FIELDS = (
    ObservationField("grasp position, base frame", 3, FAR_M, "m"),
    ObservationField("from the hand to the grasp position, base frame", 3, FAR_M, "m"),
    ObservationField("where the grasp points and where its fingers close, base frame", 6, 1.0, "1"),
    ObservationField("where the hand points and where its fingers close, base frame", 6, 1.0, "1"),
    ObservationField("velocity of the grasp while the joint opens by 1 m/s or rad/s, base frame", 3, FAR_M, "m/s"),
    ObservationField("how far the target is open: 0 closed, 1 open enough", 1, _MOST_OPENING, "1"),
    ObservationField("extent of the handle between the fingers", 1, FAR_M, "m"),
)
HANDLE_SIZE = int(total(field.size for field in HANDLE_FIELDS))


def target_motion(snapshot: Snapshot, goal: Any) -> tuple[Array, Array]:
    """Return the speed and the angular speed of each target's link over the last step, (B,) m/s and rad/s.

    Args:
        snapshot: of B environments.
        goal: their `CabinetGoal`.
    """
    if not isinstance(snapshot.object_qpos, np.ndarray):
        at = goal.row, goal.link
        return snapshot.link_speed_m_s[at], snapshot.link_angular_speed_rad_s[at]
    _check_batch(snapshot, goal)
    motion = np.empty((2, len(goal.link)))
    _motion_kernel(goal.link, _link_poses(snapshot), snapshot.step_s, motion)
    return motion[0], motion[1]


class Limits(NamedTuple):
    """What measures are relative to.

    Attributes:
        close_m: the distance of both fingers to the handle that counts as close.
        slow_m_s: the speed of the target's link that counts as still.
        slow_rad_s: likewise its angular speed.
        ajar: range of `opening` over which the link comes to count as held; `NEVER_AJAR` for never.
    """

    close_m: float
    slow_m_s: float
    slow_rad_s: float
    ajar: tuple[float, float] = NEVER_AJAR


def measure(snapshot: Snapshot, goal: Any, limits: Limits) -> Array:
    """Return `MEASURES`, (B, M).

    Args:
        snapshot: of B environments.
        goal: their `CabinetGoal`.
        limits: of the task.
    """
    if not isinstance(snapshot.object_qpos, np.ndarray):
        return measure_by_arrays(snapshot, goal, limits)
    _check_batch(snapshot, goal)
    measured = np.empty((len(goal.link), len(MEASURES)))
    as_one = np.ascontiguousarray  # one memory layout, one compilation
    _measure_kernel(
        goal.link,
        _link_poses(snapshot),
        snapshot.step_s,
        goal.joint,
        (snapshot.object_qpos, snapshot.object_qvel, goal.lower, goal.open_qpos),
        (
            as_one(snapshot.link_rotation_w),
            as_one(snapshot.finger_line_w),
            as_one(snapshot.tool_rotation_w),
            as_one(snapshot.tool_position_w),
        ),
        (goal.handle_points, goal.handle_planes, goal.grasp_rotations, goal.pushing_position, _MIDDLE_WEIGHTS),
        (*map(float, limits[:3]), *map(float, limits.ajar)),
        measured,
    )
    return measured


def measure_by_arrays(snapshot: Snapshot, goal: Any, limits: Limits) -> Array:
    """Return what `measure` does of finite numbers, for any array library: the kernel's definition."""
    xp, at = namespace(snapshot.object_qpos), (goal.row, goal.link)
    origin, rotation = snapshot.link_position_w[at], snapshot.link_rotation_w[at]
    lines = snapshot.finger_line_w[:, :2]  # of the first arm, as its hand below
    distance, depth = finger_distances(lines, origin, rotation, goal.handle_points, goal.handle_planes)
    opening = _opening(snapshot, goal)
    first, last = limits.ajar
    ajar = clip((opening - first) / (last - first), 0.0, 1.0)
    gap = xp.maximum(distance[:, 0], distance[:, 1]) / limits.close_m
    is_ajar = ajar > 0
    place = origin + rotate(rotation, goal.pushing_position)
    measures = {
        "hand_angle": hand_angle(rotation, snapshot.tool_rotation_w[:, 0], goal.grasp_rotations),
        "handle_distance": 0.5 * (distance[:, 0] + distance[:, 1]),
        "depth": xp.where(is_ajar, xp.maximum(depth, (ajar - _HELD) / _RANGES_PER_M), depth),
        "finger_gap": xp.where(is_ajar, xp.minimum(gap, 1.0 - _GAP_PER_RANGE * (ajar - _HELD)), gap),
        "opening_speed": snapshot.object_qvel[goal.row, goal.joint],
        "opening": opening,
        "speed": snapshot.link_speed_m_s[at] / limits.slow_m_s,
        "pushing_distance": norm(snapshot.tool_position_w[:, 0] - place) + CLOSED_M * (1.0 - ajar),
        "angular_speed": snapshot.link_angular_speed_rad_s[at] / limits.slow_rad_s,
    }
    return columns([measures[name] for name in MEASURES])


def _opening(snapshot: Snapshot, goal: Any) -> Array:
    """Return how far each target is open, (B,): 0 closed, 1 open enough."""
    qpos = snapshot.object_qpos[goal.row, goal.joint]
    return (qpos - goal.lower) / (goal.open_qpos - goal.lower)


def describe_handle(snapshot: Snapshot, goal: Any) -> Array:
    """Return the numbers of `HANDLE_FIELDS`, (B, 23), of the first grasp of each target's handle.

    They are in the frame of the robot's base, for what the robot has to do does not depend on where it stands.

    Args:
        snapshot: of B environments.
        goal: their `CabinetGoal`.
    """
    xp, at = namespace(snapshot.robot_qpos), (goal.row, goal.link)
    origin, rotation = snapshot.link_position_w[at], snapshot.link_rotation_w[at]
    grasp = origin + rotate(rotation, goal.grasp_positions[:, 0])
    forward, across = (rotate(rotation, goal.grasp_rotations[:, 0, :, axis]) for axis in (2, 1))
    axis = rotate(rotation, goal.joint_axis)
    lever = grasp - origin - rotate(rotation, goal.joint_origin)
    velocity = xp.where(goal.turns[:, None], cross(axis, lever, xp), axis)
    base = base_position(snapshot)
    hand = snapshot.tool_rotation_w[:, 0]
    ways = (grasp - base, grasp - snapshot.tool_position_w[:, 0], forward, across, hand[:, :, 2], hand[:, :, 1])
    vectors = xp.stack((*ways, velocity), axis=1)  # (B, 7, 3)
    return xp.concat(
        (along_base_axes(snapshot, vectors), _opening(snapshot, goal)[:, None], goal.grasp_width_m[:, None]),
        axis=1,
    )


def hand_angle(link_w: Array, hand_w: Array, grasps: Array) -> Array:
    """Return the angle between a hand and the nearest of a handle's grasp poses, over pi: (B,) in [0, 1].

    Args:
        link_w: (B, 3, 3) rotation of the link that carries the handle.
        hand_w: (B, 3, 3) rotation of the hand.
        grasps: (B, G, 3, 3) rotations of the grasp poses.
    """
    xp = namespace(hand_w)
    hand = matmul(xp.matrix_transpose(link_w), hand_w)  # in the link's frame
    trace = amax(dot(xp.reshape(hand, (-1, 1, 9)), xp.reshape(grasps, (*grasps.shape[:2], 9))))
    return arccos(clip(0.5 * trace - 0.5, -1.0, 1.0)) / xp.pi


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


def _check_batch(snapshot: Snapshot, goal: Any) -> None:
    """Raise what arrays of different length raise: kernels would read beyond the shorter one."""
    if len(goal.link) != len(snapshot.object_qpos):
        raise ValueError(f"a goal of {len(goal.link)} environments for a snapshot of {len(snapshot.object_qpos)}")


def _link_poses(snapshot: Snapshot) -> tuple[np.ndarray, ...]:
    """Return positions and orientations of all links, now and one step ago."""
    poses = (
        snapshot.link_position_w,
        snapshot.previous_link_position_w,
        snapshot.link_quaternion_w,
        snapshot.previous_link_quaternion_w,
    )
    return tuple(map(np.ascontiguousarray, poses))


@kernel
def _motion_kernel(link: Any, poses: Any, step_s: Any, out: Any) -> None:
    """Fill `out` (2, B) as `target_motion` has it."""
    for b in range(link.shape[0]):
        out[0, b], out[1, b] = _speeds(b, link[b], poses, step_s)


@inlined_kernel
def _speeds(b: Any, link: Any, poses: Any, step_s: Any) -> Any:
    """Return speed and angular speed of a link, as `Snapshot` defines them."""
    position, before, quaternion, quaternion_before = poses
    squares, cosine = 0.0, 0.0
    for i in range(3):
        moved = position[b, link, i] - before[b, link, i]
        squares += moved * moved
    for i in range(4):
        cosine += quaternion_before[b, link, i] * quaternion[b, link, i]
    return np.sqrt(squares) / step_s, math.acos(min(abs(cosine), 1.0)) * (2.0 / step_s)


@allocating_kernel
def _measure_kernel(
    links: Any, poses: Any, step_s: Any, joints: Any, motions: Any, hands: Any, handles: Any, limits: Any, out: Any
) -> None:
    """Fill `out` (B, M).

    Args:
        links: (B,) of the targets.
        poses: of all links, now and one step ago.
        step_s: the time between.
        joints: (B,) of the targets.
        motions: of all joints value and velocity, of the targets' lower and open value.
        hands: rotations of all links, the fingers' lines, the hands' rotations and places.
        handles: points, planes, grasps, places to push at, and the weights of the points between the fingers.
        limits: what counts as close and as still, and from where to where as ajar.
        out: is filled.
    """
    object_qpos, object_qvel, lower, open_qpos = motions
    link_rotation, finger_line, tool_rotation, tool_position = hands
    points, planes, grasps, places, weights = handles
    close_m, slow_m_s, slow_rad_s, first_ajar, last_ajar = limits
    ends, sample, hand = np.empty((4, 3)), np.empty(3), np.empty((3, 3))
    for b in range(links.shape[0]):
        link, joint = links[b], joints[b]
        speed, angular_speed = _speeds(b, link, poses, step_s)
        rotation = link_rotation[b, link]
        _into_link(finger_line[b], poses[0][b, link], rotation, ends)
        first = _segment_distance(ends[0], ends[1], points[b])
        second = _segment_distance(ends[2], ends[3], points[b])
        for i in range(3):
            for j in range(3):
                hand[i, j] = 0.0
                for k in range(3):
                    hand[i, j] += rotation[k, i] * tool_rotation[b, 0, k, j]
        cosine = 0.5 * _grasp_trace(hand, grasps[b]) - 0.5
        out[b, 0] = math.acos(min(max(cosine, -1.0), 1.0)) / math.pi
        out[b, 1] = 0.5 * (first + second)
        out[b, 2] = _middle_depth(ends, weights, planes[b], sample)
        out[b, 3] = max(first, second) / close_m
        out[b, 4] = object_qvel[b, joint]
        opening = (object_qpos[b, joint] - lower[b]) / (open_qpos[b] - lower[b])
        out[b, 5] = opening
        out[b, 6] = speed / slow_m_s
        squares = 0.0  # of the way from where the link is pushed to the hand
        for i in range(3):
            gap = tool_position[b, 0, i] - poses[0][b, link, i]
            for k in range(3):
                gap -= rotation[i, k] * places[b, k]
            squares += gap * gap
        out[b, 7] = np.sqrt(squares) + CLOSED_M
        out[b, 8] = angular_speed / slow_rad_s
        if opening > first_ajar:
            ajar = min((opening - first_ajar) / (last_ajar - first_ajar), 1.0)
            out[b, 7] -= CLOSED_M * ajar
            out[b, 2] = max(out[b, 2], (ajar - _HELD) / _RANGES_PER_M)
            out[b, 3] = min(out[b, 3], 1.0 - _GAP_PER_RANGE * (ajar - _HELD))


@kernel
def _into_link(lines: Any, origin: Any, rotation: Any, out: Any) -> None:
    """Fill `out` (4, 3): start and tip of the first two finger lines, in the link's frame."""
    for i in range(4):
        for k in range(3):
            out[i, k] = 0.0
            for j in range(3):
                out[i, k] += (lines[i // 2, i % 2, j] - origin[j]) * rotation[j, k]


@kernel
def _middle_depth(ends: Any, weights: Any, planes: Any, sample: Any) -> Any:
    """Return the greatest depth of the fingers' mid-line in a hull; `sample` (3,) is overwritten."""
    depth = -np.inf
    for i in range(weights.shape[0]):
        for k in range(3):
            sample[k] = 0.0
            for j in range(4):
                sample[k] += weights[i, j] * ends[j, k]
        depth = max(depth, -_plane_height(sample, planes))
    return depth


@kernel
def _grasp_trace(hand: Any, grasps: Any) -> Any:
    """Return the greatest trace of the rotations between a hand (3, 3) and grasp poses (G, 3, 3)."""
    most = -np.inf
    for g in range(grasps.shape[0]):
        summed = 0.0
        for i in range(3):
            for j in range(3):
                summed += hand[i, j] * grasps[g, i, j]
        most = max(most, summed)
    return most


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
    first, ones, place, turn = np.zeros(1, np.int64), np.ones(1), np.ones((1, 1, 3)), np.ones((1, 1, 4))
    poses, rotation, one = (place, place, turn, turn), np.ones((1, 1, 3, 3)), np.ones((1, 1))
    _motion_kernel(first, poses, 1.0, np.empty((2, 1)))
    hands = rotation, np.ones((1, 2, 2, 3)), rotation, place
    handles = np.ones((1, 3, 1)), turn, rotation, np.ones((1, 3)), _MIDDLE_WEIGHTS
    measured = np.empty((1, len(MEASURES)))
    limits = (1.0, 1.0, 1.0, *NEVER_AJAR)
    _measure_kernel(first, poses, 1.0, first, (one, one, ones, ones), hands, handles, limits, measured)
