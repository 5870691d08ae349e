"""Shapes between two points: what is touched of wires, rods and straps."""

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.geometry.arrays import norm
from artiskill.geometry.rotations import quat_from_axis_angle, quat_from_matrix

_TURNS = {"x": quat_from_axis_angle((0, 1, 0), np.pi / 2), "y": quat_from_axis_angle((1, 0, 0), -np.pi / 2)}
_X = np.array((1.0, 0.0, 0.0))


def turn_to(axis: str) -> np.ndarray:
    """The quaternion that turns z onto `x` or `y`."""
    return _TURNS[axis]


def rod(start: np.ndarray, end: np.ndarray, radius_m: float, part: str) -> CollisionShape:
    """A capsule whose ends' centres are two points."""
    along = end - start
    length = float(norm(along))
    return CollisionShape("capsule", (radius_m, length / 2), (start + end) / 2, _turn(along), part=part)


def slab(start: np.ndarray, end: np.ndarray, half_x_m: float, half_m: float, part: str) -> CollisionShape:
    """A flat bar between two points of the plane x = 0, so wide along x and so thick across it."""
    along = end - start
    size = (half_x_m, half_m, float(norm(along)) / 2)
    return CollisionShape("box", size, (start + end) / 2, _turn(along), part=part)


def _turn(along: np.ndarray) -> np.ndarray:
    """A turn that brings z onto a direction, and keeps x where it can."""
    z = along / norm(along)
    helper = _X if abs(z[0]) < 0.9 else np.array((0.0, 1.0, 0.0))
    y = np.cross(z, helper)
    y /= norm(y)
    return quat_from_matrix(np.stack((np.cross(y, z), y, z), axis=1))
