"""Poses and motions of the hand as an expert reckons with them: one environment, world frame."""

import math
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from artiskill.geometry.arrays import arctan2, norm, small_product
from artiskill.geometry.rotations import quat_from_matrix, quat_to_rotation_vector
from artiskill.sim.snapshot import Snapshot

_MOST_ASIDE_RAD = 1.2
_STRAIGHT = 1e-4


@dataclass(frozen=True, eq=False)
class Frame:
    """A pose of the tool in the world: position (3,) and rotation (3, 3), whose columns are the hand's axes."""

    position: np.ndarray
    rotation: np.ndarray

    @property
    def forward(self) -> np.ndarray:
        """(3,) from the wrist to the fingertips."""
        return self.rotation[:, 2]


@dataclass(frozen=True, eq=False)
class Motion:
    """Where the hand goes.

    Attributes:
        wanted: the pose that it heads for.
        speed_m_s: at most, towards that pose.
        feed_m_s: (3,) velocity on top of that.
        feed_rad_s: (3,) likewise, angular.
    """

    wanted: Frame
    speed_m_s: float
    feed_m_s: np.ndarray = field(default_factory=lambda: np.zeros(3))
    feed_rad_s: np.ndarray = field(default_factory=lambda: np.zeros(3))


def head_for(wanted: Frame, speed_m_s: float) -> Motion:
    """Towards a pose that is at rest."""
    return Motion(wanted, speed_m_s)


def tool_frame(snapshot: Snapshot) -> Frame:
    """Return where the first arm's hand is (B = 1)."""
    return Frame(snapshot.tool_position_w[0, 0], snapshot.tool_rotation_w[0, 0])


def axis_rotation(axis: np.ndarray, angle_rad: float) -> np.ndarray:
    """Rotation (3, 3) about an axis of any length but zero."""
    # one number after the other: thrice as fast as array calls
    x, y, z = (axis / math.sqrt(small_product(axis, axis))).tolist()
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    rest = 1.0 - cos
    return np.array(
        (
            (cos + rest * x * x, rest * x * y - sin * z, rest * x * z + sin * y),
            (rest * x * y + sin * z, cos + rest * y * y, rest * y * z - sin * x),
            (rest * x * z - sin * y, rest * y * z + sin * x, cos + rest * z * z),
        )
    )


def yaw_rotation(angle_rad: float) -> np.ndarray:
    """Rotation (3, 3) about the vertical."""
    return axis_rotation(np.array((0.0, 0.0, 1.0)), angle_rad)


def rotation_error(current: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Rotation vector (3,) that turns `current` into `wanted`, both (3, 3), in the world frame."""
    m = small_product(wanted, current.T)
    ((a, b, c), (d, e, f), (g, h, i)) = m.tolist()
    twice = math.sqrt((h - f) ** 2 + (c - g) ** 2 + (d - b) ** 2)  # of the angle's sine
    if twice < _STRAIGHT:  # none, or half a turn, whose axis the differences do not show
        return cast(np.ndarray, quat_to_rotation_vector(quat_from_matrix(m)))
    return np.array((h - f, c - g, d - b)) * (math.atan2(twice, a + e + i - 1.0) / twice)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the cross product of two vectors (3,): the same bits as NumPy's, in a fraction of the time."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx))


def limited(vector: np.ndarray, length: float) -> np.ndarray:
    """Return the vector, shortened to a length if it is longer."""
    return vector * min(1.0, length / max(float(norm(vector)), 1e-9))


def ramp(value: float, low: float, high: float) -> float:
    """Return 0 at `low` or beyond, 1 at `high` or beyond, linear in between; `low` may be above `high`."""
    return min(max((float(value) - low) / (high - low), 0.0), 1.0)


def wrapped(angle_rad: np.ndarray) -> np.ndarray:
    """Return angles within half a turn of 0."""
    return arctan2(np.sin(angle_rad), np.cos(angle_rad))


def curved(velocity: np.ndarray, angle_rad: float) -> np.ndarray:
    """Return a velocity on the floor, (2,), turned aside by at most 1.2 rad: it must come nearer to its target."""
    angle = min(max(angle_rad, -_MOST_ASIDE_RAD), _MOST_ASIDE_RAD)
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array((cos * velocity[0] - sin * velocity[1], sin * velocity[0] + cos * velocity[1]))
