"""Operational space: hand twists and a null-space rate in place of arm joint velocities, and back.

An arm of seven joints has one motion that leaves the hand where it is. Twist and rate along it together are as
many numbers as joints, so that away from singular arm poses the two interfaces can be turned into one another
without loss. Near singular poses, where no joint velocities of reasonable size make some twists, the inverse is
damped (Nakamura and Hanafusa, 1986): the hand then follows in part. Plain loops and no LAPACK, which gives other
bits on other processors.
"""

from typing import Any

import numpy as np

from artiskill.geometry.arrays import matmul
from artiskill.geometry.kernel import allocating_kernel, kernel
from artiskill.robots.arm_config import load_arm
from artiskill.robots.config import RobotConfig

TRUNK = 4  # base x, y, yaw and lift come first in both interfaces
TWIST = 6
FINGERS = 2
# Below this manipulability, sqrt(det(J J')), damping sets in: at the arm's start it is 0.024, in one of a hundred
# poses within 0.4 rad of it less than 0.003. The damping grows to this factor at a singular pose, where a twist of
# 1 m/s then asks for at most 8 rad/s.
LEAST_MANIPULABILITY = 0.003
_GREATEST_DAMPING = 0.06


class OperationalSpace:
    """Both interfaces of one robot; B environments, A arms of J = 7 joints.

    Joint values are drive targets, (B, R): base x, y, yaw, lift, then per arm J joint velocities and two finger
    positions. Operational values, (B, R) too, have per arm the hand's twist in its own frame (linear m/s, then
    angular rad/s, of the point between the pads, relative to the torso), the rate along the arm's null motion
    (rad/s) and the same two finger positions.

    Args:
        robot: whose arms have seven joints.
    """

    def __init__(self, robot: RobotConfig) -> None:
        self.arms, self.joints = len(robot.mounts), len(load_arm(robot.arm).joints)
        assert self.joints == TWIST + 1, "one null motion is what makes the two interfaces equally large"
        self.scale = operational_half_range(robot)

    def to_joint(self, values: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        """Operational values to joint values, (B, R) -> (B, R); `jacobian` as `hand_jacobians` returns it."""
        return self._convert(values, jacobian, _twist_to_joints)

    def to_operational(self, targets: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        """Joint values to operational values, (B, R) -> (B, R)."""
        return self._convert(targets, jacobian, _joints_to_twist)

    def _convert(self, given: np.ndarray, jacobian: np.ndarray, convert: Any) -> np.ndarray:
        found = np.array(given, dtype=np.float64)
        arms = found[:, TRUNK:].reshape(len(found), self.arms, self.joints + FINGERS).copy()
        rates = arms[..., : self.joints].copy()  # never a view: the kernel reads it while it writes
        convert(rates, np.ascontiguousarray(jacobian), arms)
        found[:, TRUNK:] = arms.reshape(len(found), -1)
        return found


def operational_half_range(robot: RobotConfig) -> np.ndarray:
    """What an operational action of 1 means for one arm's twist and null rate, (7,)."""
    actions = robot.actions
    linear, angular = [actions.hand_velocity_m_s] * 3, [actions.hand_rate_rad_s] * 3
    return np.array([*linear, *angular, actions.null_rate_rad_s])


def hand_jacobians(
    anchor_w: np.ndarray, axis_w: np.ndarray, tool_position_w: np.ndarray, tool_rotation_w: np.ndarray
) -> np.ndarray:
    """Jacobians of the hands' twists, in their own frames, with respect to their arms' joints.

    Args:
        anchor_w: (B, R, 3) a point on each robot joint's axis, as in `Snapshot.robot_joint_anchor_w`.
        axis_w: (B, R, 3) its direction.
        tool_position_w: (B, A, 3) the points between the pads.
        tool_rotation_w: (B, A, 3, 3) columns: the hands' axes.

    Returns:
        (B, A, 6, 7), linear rows first.
    """
    arms = tool_position_w.shape[1]
    per_arm = (anchor_w.shape[1] - TRUNK) // arms
    parts = []
    for arm in range(arms):
        start = TRUNK + arm * per_arm
        joints = slice(start, start + per_arm - FINGERS)
        axis = axis_w[:, joints]
        linear = np.cross(axis, tool_position_w[:, arm, None] - anchor_w[:, joints])  # (B, 7, 3)
        turn = tool_rotation_w[:, arm]
        parts.append(np.concatenate((matmul(linear, turn), matmul(axis, turn)), axis=-1).swapaxes(-1, -2))
    return np.stack(parts, axis=1)


def load_kernels() -> None:
    """Compile the kernels, or read them from the disk's cache, now: no step has to wait for them later."""
    jacobian, rates = np.zeros((1, 1, TWIST, TWIST + 1)), np.zeros((1, 1, TWIST + 1))
    for convert in (_twist_to_joints, _joints_to_twist):
        convert(rates, jacobian, np.zeros((1, 1, TWIST + 1 + FINGERS)))


@allocating_kernel
def _twist_to_joints(rates: Any, jacobian: Any, out: Any) -> None:
    """Fill the first seven of `out` (B, A, 9) from twists and null rates (B, A, 7)."""
    null, gram, y = np.empty(TWIST + 1), np.empty((TWIST, TWIST)), np.empty(TWIST)
    for b in range(rates.shape[0]):
        for a in range(rates.shape[1]):
            jac = jacobian[b, a]
            null_motion(jac, null)
            for i in range(TWIST):
                for j in range(TWIST):
                    gram[i, j] = 0.0
                    for k in range(TWIST + 1):
                        gram[i, j] += jac[i, k] * jac[j, k]
            damp(gram)
            for i in range(TWIST):
                y[i] = rates[b, a, i]
            solve(gram, y)
            for k in range(TWIST + 1):
                out[b, a, k] = null[k] * rates[b, a, TWIST]
                for i in range(TWIST):
                    out[b, a, k] += jac[i, k] * y[i]


@allocating_kernel
def _joints_to_twist(rates: Any, jacobian: Any, out: Any) -> None:
    """Fill the first seven of `out` (B, A, 9) from joint velocities (B, A, 7)."""
    null = np.empty(TWIST + 1)
    for b in range(rates.shape[0]):
        for a in range(rates.shape[1]):
            jac = jacobian[b, a]
            null_motion(jac, null)
            for i in range(TWIST):
                out[b, a, i] = 0.0
                for k in range(TWIST + 1):
                    out[b, a, i] += jac[i, k] * rates[b, a, k]
            out[b, a, TWIST] = 0.0
            for k in range(TWIST + 1):
                out[b, a, TWIST] += null[k] * rates[b, a, k]


@allocating_kernel
def null_motion(jac: Any, null: Any) -> None:
    """Unit vector (7,) that a Jacobian (6, 7) maps to zero: its signed minors, so that it changes smoothly."""
    minor = np.empty((TWIST, TWIST))
    length = 0.0
    for k in range(TWIST + 1):
        for i in range(TWIST):
            for j in range(TWIST):
                minor[i, j] = jac[i, j if j < k else j + 1]
        null[k] = determinant(minor) * (1.0 if k % 2 == 0 else -1.0)
        length += null[k] * null[k]
    length = np.sqrt(length)
    for k in range(TWIST + 1):
        null[k] = null[k] / length if length > 0.0 else 0.0


@allocating_kernel
def damp(gram: Any) -> None:
    """Add what keeps J J' (6, 6) far from singular, and nothing where it is far."""
    manipulability = np.sqrt(max(determinant(gram.copy()), 0.0))
    if manipulability < LEAST_MANIPULABILITY:
        factor = _GREATEST_DAMPING * (1.0 - manipulability / LEAST_MANIPULABILITY)
        for i in range(TWIST):
            gram[i, i] += factor * factor


@kernel
def determinant(matrix: Any) -> Any:
    """Of a square matrix, which is overwritten."""
    value = 1.0
    count = matrix.shape[0]
    for c in range(count):
        pivot = c
        for r in range(c + 1, count):
            if abs(matrix[r, c]) > abs(matrix[pivot, c]):
                pivot = r
        if matrix[pivot, c] == 0.0:
            return 0.0
        if pivot != c:
            value = -value
            for j in range(count):
                matrix[c, j], matrix[pivot, j] = matrix[pivot, j], matrix[c, j]
        value *= matrix[c, c]
        for r in range(c + 1, count):
            factor = matrix[r, c] / matrix[c, c]
            for j in range(c, count):
                matrix[r, j] -= factor * matrix[c, j]
    return value


@kernel
def solve(matrix: Any, right: Any) -> None:
    """Solve a positive definite system in place, by Cholesky's method; `right` becomes the solution."""
    count = matrix.shape[0]
    for i in range(count):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = np.sqrt(total) if i == j else total / matrix[j, j]
    for i in range(count):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
