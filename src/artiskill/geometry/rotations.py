"""Rotations and poses as batched array functions, the same code on NumPy and on torch.

Shapes are written for one leading batch `(...)`; every function broadcasts. Quaternions are (w, x, y, z), unit.
"""

import math
from typing import Any

import numpy as np

from artiskill.geometry.arrays import Array, arcsin, arctan2, namespace, norm


def quat_multiply(a: Array, b: Array) -> Array:
    """Hamilton product `a * b`: first rotate by `b`, then by `a`. (..., 4) x (..., 4) -> (..., 4)."""
    xp = namespace(a, b)
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    return xp.stack(
        (
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ),
        axis=-1,
    )


def quat_conjugate(q: Array) -> Array:
    """The inverse rotation. (..., 4) -> (..., 4)."""
    xp = namespace(q)
    return q * xp.asarray((1.0, -1.0, -1.0, -1.0), dtype=q.dtype)


def quat_rotate(q: Array, v: Array) -> Array:
    """Rotate vectors: (..., 4) x (..., 3) -> (..., 3)."""
    xp = namespace(q, v)
    w, u = q[..., :1], q[..., 1:]
    t = 2.0 * cross(u, v, xp)
    return v + w * t + cross(u, t, xp)


def cross(a: Array, b: Array, xp: Any) -> Array:
    """Cross product over the last axis, with broadcasting."""
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    return xp.stack((a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0), axis=-1)


def quat_to_matrix(q: Array) -> Array:
    """(..., 4) -> rotation matrices (..., 3, 3), whose columns are the rotated axes."""
    xp = namespace(q)
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return xp.stack([xp.stack(row, axis=-1) for row in rows], axis=-2)


def quat_angle(a: Array, b: Array) -> Array:
    """Angle of the rotation between two orientations, in [0, pi]. (..., 4) x (..., 4) -> (...)."""
    xp = namespace(a, b)
    # the chord between unit quaternions is 2 sin(angle / 4): accurate at small angles, where acos is not
    return 4.0 * arcsin(0.5 * xp.minimum(norm(a - b), norm(a + b)))


def quat_to_rotation_vector(q: Array) -> Array:
    """Axis times angle, the angle in [0, pi]. (..., 4) -> (..., 3)."""
    xp = namespace(q)
    q = xp.where(q[..., :1] < 0, -q, q)
    sine = xp.sqrt(xp.sum(q[..., 1:] ** 2, axis=-1, keepdims=True))
    angle = 2.0 * arctan2(sine, q[..., :1])
    scale = xp.where(sine > 1e-12, angle / xp.where(sine > 1e-12, sine, xp.ones_like(sine)), 2.0)
    return q[..., 1:] * scale


def transform_points(position: Array, quaternion: Array, points: Array) -> Array:
    """Points of a body frame to the frame in which its pose is given. (..., 3), (..., 4), (..., N, 3)."""
    return quat_rotate(quaternion[..., None, :], points) + position[..., None, :]


def quat_from_axis_angle(axis: Any, angle_rad: float) -> np.ndarray:
    """Rotation by an angle about an axis of any length but zero. -> (4,)."""
    axis = np.asarray(axis, dtype=float)
    axis = axis / norm(axis)
    return np.concatenate(([np.cos(angle_rad / 2)], np.sin(angle_rad / 2) * axis))


def quat_from_rpy(rpy_rad: Any) -> np.ndarray:
    """Roll, pitch, yaw about the fixed x, y, z axes, in that order, as in URDF. (3,) -> (4,)."""
    roll, pitch, yaw = (float(a) for a in rpy_rad)
    qx = quat_from_axis_angle((1, 0, 0), roll)
    qy = quat_from_axis_angle((0, 1, 0), pitch)
    qz = quat_from_axis_angle((0, 0, 1), yaw)
    return quat_multiply(qz, quat_multiply(qy, qx))


def quat_to_rpy(quaternion: Any) -> tuple[float, float, float]:
    """Return roll, pitch, yaw about the fixed x, y, z axes of a rotation (4,)."""
    m = quat_to_matrix(np.asarray(quaternion, dtype=float))
    across = math.hypot(m[0, 0], m[1, 0])
    pitch = math.atan2(-m[2, 0], across)
    if across < 1e-9:  # looking straight up or down: only the difference of roll and yaw is determined
        return math.atan2(-m[1, 2], m[1, 1]), pitch, 0.0
    return math.atan2(m[2, 1], m[2, 2]), pitch, math.atan2(m[1, 0], m[0, 0])


def quat_from_matrix(matrix: Any) -> np.ndarray:
    """A rotation matrix (3, 3) to its quaternion (4,), scalar part not negative (Shepperd's method)."""
    m = np.asarray(matrix, dtype=float)
    squares = np.array(
        [
            1 + m[0, 0] + m[1, 1] + m[2, 2],
            1 + m[0, 0] - m[1, 1] - m[2, 2],
            1 - m[0, 0] + m[1, 1] - m[2, 2],
            1 - m[0, 0] - m[1, 1] + m[2, 2],
        ]
    )
    largest = int(np.argmax(squares))
    a, b, c = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    d, e, f = m[1, 0] + m[0, 1], m[0, 2] + m[2, 0], m[2, 1] + m[1, 2]
    table = np.array([[0, a, b, c], [a, 0, d, e], [b, d, 0, f], [c, e, f, 0]], dtype=float)
    q = table[largest]
    q[largest] = squares[largest]
    q = q / norm(q)
    return -q if q[0] < 0 else q
