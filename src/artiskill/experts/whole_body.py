"""Differential inverse kinematics of the whole robot: base, lift and one arm follow a twist of the hand.

A damped least-squares problem with bounds: follow the twist, prefer a posture, stay within velocity and position
limits. Everything it needs, joint axes included, stands in the snapshot.
"""

from dataclasses import dataclass

import numpy as np

from artiskill.config import check
from artiskill.robots.actions import ActionScale, action_scale
from artiskill.robots.arm_config import load_arm
from artiskill.robots.config import RobotConfig
from artiskill.sim.snapshot import Snapshot

_BASE = 3  # base x, y and yaw; then the lift; then the arm's joints
_ARM = 4


@dataclass(frozen=True)
class WholeBodyConfig:
    """Weights of the least-squares problem.

    Attributes:
        rotation_weight_m: how many metres of position error a radian of orientation error is worth.
        base_damping: cost of a base velocity that differs from the posture's, relative to the hand's error.
        yaw_damping: likewise, of its yaw rate.
        lift_damping: likewise.
        arm_damping: likewise, of each arm joint.
        limit_margin_rad: arm joints stay this far inside their limits.
    """

    rotation_weight_m: float = 0.3
    base_damping: float = 0.12
    yaw_damping: float = 0.12
    lift_damping: float = 0.12
    arm_damping: float = 0.06
    limit_margin_rad: float = 0.03

    def __post_init__(self) -> None:
        check(
            min(self.base_damping, self.yaw_damping, self.lift_damping, self.arm_damping) > 0,
            "whole-body dampings must be positive",
        )


class WholeBodyController:
    """Twists of the hand to actions of the robot, for its first arm.

    Args:
        robot: the robot.
        config: weights.
    """

    def __init__(self, robot: RobotConfig, config: WholeBodyConfig) -> None:
        self.config = config
        self.scale: ActionScale = action_scale(robot)
        arm = load_arm(robot.arm)
        self.num_joints = _ARM + len(arm.joints)
        ranges = np.array([j.range_rad for j in arm.joints])
        inside = np.array((config.limit_margin_rad, -config.limit_margin_rad))
        free = np.array([(-np.inf, np.inf)] * _BASE)
        self._limits = np.concatenate((free, [robot.lift.range_m], ranges + inside))  # (n, 2)
        self._max_speed = self.scale.half_range[: self.num_joints]
        dampings = [config.base_damping] * 2 + [config.yaw_damping, config.lift_damping]
        self._damping = np.array(dampings + [config.arm_damping] * len(arm.joints))

    def joint_velocities(self, snapshot: Snapshot, twist_w: np.ndarray, posture_qvel: np.ndarray) -> np.ndarray:
        """Joint velocities that make the hand follow a twist.

        Args:
            snapshot: one environment (B = 1).
            twist_w: (6,) linear (m/s) and angular (rad/s) velocity of the tool's centre, world frame.
            posture_qvel: (n,) joint velocities preferred where the twist leaves a choice.

        Returns:
            (n,) velocities of base x, y (world frame), yaw, lift and the arm's joints.
        """
        jacobian = self._jacobian(snapshot)
        weights = np.repeat((1.0, self.config.rotation_weight_m), 3)
        matrix = np.concatenate((jacobian * weights[:, None], np.diag(self._damping)))
        target = np.concatenate((twist_w * weights, self._damping * posture_qvel))
        qpos = snapshot.robot_qpos[0, : self.num_joints]
        lower = np.maximum(-self._max_speed, (self._limits[:, 0] - qpos) / snapshot.step_s)
        upper = np.minimum(self._max_speed, (self._limits[:, 1] - qpos) / snapshot.step_s)
        return bounded_least_squares(matrix, target, np.minimum(lower, 0.0), np.maximum(upper, 0.0))

    def to_action(self, snapshot: Snapshot, qvel: np.ndarray, finger_opening_m: float) -> np.ndarray:
        """The action that asks for joint velocities and a finger opening.

        Args:
            snapshot: one environment.
            qvel: (n,) as `joint_velocities` returns them.
            finger_opening_m: position of each finger, 0 (closed) to 0.04.

        Returns:
            (R,) action; joints of a second arm rest, its fingers stay where they are.
        """
        targets = np.zeros_like(self.scale.center)
        n = self.num_joints
        targets[:n] = qvel
        yaw = snapshot.robot_qpos[0, 2]
        cos, sin = np.cos(yaw), np.sin(yaw)
        targets[0], targets[1] = cos * qvel[0] + sin * qvel[1], -sin * qvel[0] + cos * qvel[1]
        targets[n : n + 2] = finger_opening_m
        targets[-2:] = snapshot.robot_qpos[0, -2:] if len(targets) > n + 2 else targets[-2:]
        return self.scale.to_actions(targets)

    def _jacobian(self, snapshot: Snapshot) -> np.ndarray:
        """Geometric Jacobian of the tool's centre, (6, n), linear rows first."""
        n = self.num_joints
        axis = snapshot.robot_joint_axis_w[0, :n]
        lever = snapshot.tool_position_w[0, 0] - snapshot.robot_joint_anchor_w[0, :n]
        linear, angular = np.cross(axis, lever), axis.copy()
        slides = [0, 1, 3]
        linear[slides], angular[slides] = axis[slides], 0.0
        return np.concatenate((linear.T, angular.T))


def bounded_least_squares(
    matrix: np.ndarray, target: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Least squares within a box: violated bounds become active one round at a time, the rest is solved anew."""
    x = np.zeros(matrix.shape[1])
    free = np.ones(len(x), dtype=bool)
    for _ in range(len(x)):
        rest = target - matrix[:, ~free] @ x[~free]
        columns = matrix[:, free]
        x[free] = np.linalg.solve(columns.T @ columns, columns.T @ rest)
        outside = free & ((x < lower - 1e-9) | (x > upper + 1e-9))
        if not outside.any():
            break
        x = np.clip(x, lower, upper)
        free &= ~outside
        if not free.any():
            break
    return np.clip(x, lower, upper)
