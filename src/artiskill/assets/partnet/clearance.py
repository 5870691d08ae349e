"""Grasp poses at which the open gripper has room: less deep behind the handle, further along it, or across it.

The usual pose takes a handle's middle 10 mm behind its face; a handle that stands near to its panel leaves the
fingertips no room there. Here the gripper is tried, as boxes, against the collision shapes of the object at rest.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from artiskill.assets.articulated_object import Handle
from artiskill.geometry.meshes import ConvexHull
from artiskill.geometry.primitives import box
from artiskill.geometry.rotations import quat_from_axis_angle, quat_multiply, quat_to_matrix

# The hand and one finger, closed, as boxes: middle from the point between the pads (x along the handle, y to that
# finger, z to the tips), half extents, turn about x. As configs/robots/panda.yaml has them; a test compares.
HAND = ((0.0, 0.0, -0.0704), (0.03, 0.1, 0.033), 0.0)
FINGER = (
    ((0.0, 0.0075, 0.0), (0.0085, 0.0075, 0.0085), 0.0),
    ((0.0, 0.0145, -0.0165), (0.0085, 0.004, 0.011), 0.25),
    ((0.0, 0.0185, -0.034), (0.01, 0.0075, 0.0075), 0.0),
)
OPEN_M = 0.04  # of each finger
# Each pad beside the handle: where the open fingers do not fit, and shortly before they close on it. What touches
# less than the last is no contact.
_NARROW_M, _TOUCH_M, _NONE_M = 0.018, 0.003, 1e-5
_STEP_M, _LEAST_DEPTH_M = 0.001, 0.002
_PLACES = (0.0, 0.25, -0.25, 0.5, -0.5)  # along the handle, shares of its half length
_HALF_TURN = quat_from_axis_angle((0, 0, 1), np.pi)
_QUARTER_TURN = quat_from_axis_angle((0, 0, 1), np.pi / 2)


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A collision shape in the frame of a handle's link, and the name of its link; empty for the handle's own."""

    hull: ConvexHull
    link: str


@dataclass(frozen=True, eq=False)
class _Candidate:
    position: np.ndarray
    quaternion: np.ndarray
    width_m: float


def with_room(handle: Handle, vertices: np.ndarray, obstacles: Sequence[Obstacle]) -> tuple[Handle, list[str]]:
    """The handle with its grasp poses where the gripper has room, and what to say of it.

    Tried are, the usual one first, less depth, other places along the handle and the hand turned by a quarter.
    Where none has room, the pose that is least in the way stays, and a warning says so.

    Args:
        handle: with its usual poses.
        vertices: (V, 3) of its drawn surface, in its link's frame.
        obstacles: of the whole object at rest.
    """
    best: tuple[float, str, _Candidate] | None = None
    for number, candidate in enumerate(_candidates(handle, vertices)):
        depth, link = _in_the_way(candidate, obstacles)
        if depth <= _NONE_M:
            if number == 0:
                return handle, []
            moved = 1e3 * float(np.linalg.norm(candidate.position - handle.grasp_positions[0]))
            said = (
                f"a handle of {handle.link!r} has no room for the usual grasp: its pose is {moved:.0f} mm from it"
            )
            return _with_pose(handle, candidate), [said]
        if best is None or depth < best[0]:
            best = depth, link, candidate
    assert best is not None
    depth, link, candidate = best
    said = (
        f"a handle of {handle.link!r} has no room for the gripper: at its best grasp pose, the open gripper runs "
        f"{1e3 * depth:.0f} mm into {link!r}"
    )
    return _with_pose(handle, candidate), [said]


def _with_pose(handle: Handle, pose: _Candidate) -> Handle:
    return replace(
        handle,
        grasp_positions=np.repeat(pose.position[None], 2, axis=0),
        grasp_quaternions=np.stack((pose.quaternion, quat_multiply(pose.quaternion, _HALF_TURN))),
        grasp_width_m=pose.width_m,
    )


def _candidates(handle: Handle, vertices: np.ndarray) -> list[_Candidate]:
    """Poses to try, the nearest to the usual one first: turned last, then less deep before further along."""
    usual, quaternion = handle.grasp_positions[0], handle.grasp_quaternions[0]
    axes = quat_to_matrix(quaternion)
    local = (vertices - usual) @ axes
    front, half = -float(local[:, 2].min()), float(np.ptp(local[:, 0])) / 2
    depths = np.append(np.arange(front, _LEAST_DEPTH_M, -_STEP_M), min(front, _LEAST_DEPTH_M))
    turned = quat_multiply(quaternion, _QUARTER_TURN)
    ways = [(quaternion, handle.grasp_width_m)]
    if 2 * half < 2 * OPEN_M - _STEP_M:
        ways.append((turned, 2 * half))
    found = []
    for (turn, width), share, depth in itertools.product(ways, _PLACES, depths):
        place = usual + axes @ np.array((share * half, 0.0, depth - front))
        found.append(_Candidate(place, turn, width))
    return found


def _in_the_way(pose: _Candidate, obstacles: Sequence[Obstacle]) -> tuple[float, str]:
    """How deep (metres) the gripper is in something, the better of two openings; and in which link."""
    narrow = min(OPEN_M, pose.width_m / 2 + _NARROW_M)
    beside = [obstacle for obstacle in obstacles if obstacle.link]
    closing = _deepest(pose, pose.width_m / 2 + _TOUCH_M, beside)
    return min(max(_deepest(pose, opening, obstacles), closing) for opening in (OPEN_M, narrow))


def _deepest(pose: _Candidate, opening_m: float, obstacles: Sequence[Obstacle]) -> tuple[float, str]:
    axes = quat_to_matrix(pose.quaternion)
    deepest = (0.0, "")
    for middle, half, turn in _boxes(opening_m):
        frame = axes @ turn
        corners = pose.position + (axes @ middle) + box(half).vertices @ frame.T
        low, high = corners.min(axis=0), corners.max(axis=0)
        for obstacle in obstacles:
            bounds = obstacle.hull.mesh.bounds
            if (low < bounds[1]).all() and (high > bounds[0]).all():
                deepest = max(deepest, (_depth(corners, frame, obstacle.hull), obstacle.link))
    return deepest


def _boxes(opening_m: float) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Middle (3,), half extents (3,) and axes (3, 3) of the open gripper's boxes, in the hand's axes."""
    found = [(np.array(HAND[0]), np.array(HAND[1]), np.eye(3))]
    for (x, y, z), half, turn in FINGER:
        for side in (1.0, -1.0):
            axes = quat_to_matrix(quat_from_axis_angle((1, 0, 0), side * turn))
            found.append((np.array((x, side * (y + opening_m), z)), np.array(half), axes))
    return found


def _depth(corners: np.ndarray, frame: np.ndarray, hull: ConvexHull) -> float:
    """How far a box must be moved to be free of a hull; 0 where it is: least overlap over all separating axes."""
    edges = hull.mesh.vertices[hull.mesh.faces] - hull.mesh.vertices[np.roll(hull.mesh.faces, 1, axis=1)]
    crossed = np.cross(edges.reshape(-1, 1, 3), frame.T).reshape(-1, 3)
    lengths = np.linalg.norm(crossed, axis=1)
    crossed = crossed[lengths > 1e-9] / lengths[lengths > 1e-9, None]
    axes = np.concatenate((frame.T, hull.planes[:, :3], crossed))
    ours, theirs = corners @ axes.T, hull.mesh.vertices @ axes.T
    overlaps = np.minimum(ours.max(axis=0) - theirs.min(axis=0), theirs.max(axis=0) - ours.min(axis=0))
    return max(float(overlaps.min()), 0.0)
