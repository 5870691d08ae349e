"""Differential inverse kinematics of a robot with two arms: base, lift and both arms follow two twists.

The same damped least-squares problem with bounds as `experts.whole_body`, with two hands in it.
"""

import numpy as np

from artiskill.experts.whole_body import WholeBodyConfig, bounded_least_squares
from artiskill.robots.actions import ActionScale, action_scale
from artiskill.robots.arm_config import load_arm
from artiskill.robots.config import RobotConfig
from artiskill.sim.snapshot import Snapshot

ARMS = 2
TRUNK = 4  # base x, y and yaw; then the lift
_BASE = 3
_FINGERS = 2
_SLIDES = [0, 1, 3]


class TwoArmController:
    """Twists of two hands to actions of the robot.

    Its n joints are base x, y (world frame), yaw, lift, the first arm's joints, the second arm's joints.

    Args:
        robot: with two arms.
        config: weights.
    """

    def __init__(self, robot: RobotConfig, config: WholeBodyConfig) -> None:
        assert len(robot.mounts) == ARMS, "this controller moves two arms"
        self.config = config
        self.scale: ActionScale = action_scale(robot)
        arm = load_arm(robot.arm)
        self.arm_joints = len(arm.joints)
        self.num_joints = TRUNK + ARMS * self.arm_joints
        starts = [TRUNK + k * (self.arm_joints + _FINGERS) for k in range(ARMS)]
        self._arms = [slice(TRUNK + k * self.arm_joints, TRUNK + (k + 1) * self.arm_joints) for k in range(ARMS)]
        own = [np.arange(start, start + self.arm_joints) for start in starts]
        self.columns = np.concatenate((np.arange(TRUNK), *own))  # (n,) where these joints stand among all R
        self._finger_columns = np.array([[s + self.arm_joints, s + self.arm_joints + 1] for s in starts])
        inside = np.array((config.limit_margin_rad, -config.limit_margin_rad))
        ranges = np.array([joint.range_rad for joint in arm.joints]) + inside
        free = np.array([(-np.inf, np.inf)] * _BASE)
        self._limits = np.concatenate((free, [robot.lift.range_m], *[ranges] * ARMS))  # (n, 2)
        self._max_speed = self.scale.half_range[self.columns]
        trunk = [config.base_damping] * 2 + [config.yaw_damping, config.lift_damping]
        self._damping = np.array(trunk + [config.arm_damping] * (ARMS * self.arm_joints))
        self._drive_damping = robot.drives.arm_damping

    def qpos(self, snapshot: Snapshot) -> np.ndarray:
        """Where the n joints are (B = 1), (n,)."""
        found: np.ndarray = snapshot.robot_qpos[0, self.columns]
        return found

    def joint_velocities(self, snapshot: Snapshot, twists_w: np.ndarray, posture_qvel: np.ndarray) -> np.ndarray:
        """Joint velocities that make both hands follow their twists.

        Args:
            snapshot: one environment (B = 1).
            twists_w: (2, 6) linear (m/s) and angular (rad/s) velocity of each tool's centre, world frame.
            posture_qvel: (n,) joint velocities preferred where the twists leave a choice.

        Returns:
            (n,) velocities within speed and position limits.
        """
        jacobian = self.jacobian(snapshot)
        weights = np.tile(np.repeat((1.0, self.config.rotation_weight_m), 3), ARMS)
        matrix = np.concatenate((jacobian * weights[:, None], np.diag(self._damping)))
        target = np.concatenate((twists_w.reshape(-1) * weights, self._damping * posture_qvel))
        qpos = self.qpos(snapshot)
        lower = np.maximum(-self._max_speed, (self._limits[:, 0] - qpos) / snapshot.step_s)
        upper = np.minimum(self._max_speed, (self._limits[:, 1] - qpos) / snapshot.step_s)
        return bounded_least_squares(matrix, target, np.minimum(lower, 0.0), np.maximum(upper, 0.0))

    def pushing_velocities(self, snapshot: Snapshot, forces_w: np.ndarray) -> np.ndarray:
        """What to add to joint velocities so that hands that are held up push with given forces.

        A drive's torque is its damping times the velocity that is missing; so the arms' joints are asked for J' F
        over the damping more. Forces that cancel leave the trunk alone.

        Args:
            snapshot: one environment.
            forces_w: (2, 3) of each hand on what it touches, N, world frame.

        Returns:
            (n,) velocities, 0 for the trunk.
        """
        linear = self.jacobian(snapshot).reshape(ARMS, 6, -1)[:, :3]  # (2, 3, n)
        push = np.einsum("ain,ai->n", linear, forces_w) / self._drive_damping
        push[:TRUNK] = 0.0
        return push

    def to_action(self, snapshot: Snapshot, qvel: np.ndarray, finger_position_m: np.ndarray) -> np.ndarray:
        """The action that asks for joint velocities and finger positions.

        Args:
            snapshot: one environment.
            qvel: (n,) as `joint_velocities` returns them.
            finger_position_m: (2,) of both fingers of each hand, 0 (closed) to 0.04.

        Returns:
            (R,) action.
        """
        targets = np.zeros_like(self.scale.center)
        targets[self.columns] = qvel
        cos, sin = np.cos(snapshot.robot_qpos[0, 2]), np.sin(snapshot.robot_qpos[0, 2])
        targets[0], targets[1] = cos * qvel[0] + sin * qvel[1], -sin * qvel[0] + cos * qvel[1]
        targets[self._finger_columns] = np.asarray(finger_position_m)[:, None]
        return self.scale.to_actions(targets)

    def jacobian(self, snapshot: Snapshot) -> np.ndarray:
        """Geometric Jacobian of both tools' centres, (12, n); of each, linear rows first."""
        axis = snapshot.robot_joint_axis_w[0, self.columns]
        anchor = snapshot.robot_joint_anchor_w[0, self.columns]
        parts = []
        for arm in range(ARMS):
            linear, angular = np.cross(axis, snapshot.tool_position_w[0, arm] - anchor), axis.copy()
            linear[_SLIDES], angular[_SLIDES] = axis[_SLIDES], 0.0
            other = self._arms[1 - arm]
            linear[other], angular[other] = 0.0, 0.0
            parts += [linear.T, angular.T]
        return np.concatenate(parts)
