"""Forward kinematics: from the robot's proprioception to its joints and hands, without the engine.

A policy that sees `agent` only (docs/observations.md) finds out here where its hands are, and what inverse
kinematics needs. Frames are 4 x 4 matrices; the base's frame is on the floor below the base, x forward, z up.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.geometry.arrays import Array, namespace
from artiskill.geometry.rotations import quat_from_rpy, quat_to_matrix
from artiskill.robots.arm_config import load_arm
from artiskill.robots.config import RobotConfig

_BASE = 3  # base x, y and yaw; then the lift
_TRUNK = 4
_FINGERS = 2


@dataclass(frozen=True, eq=False)
class RobotPose:
    """What inverse kinematics needs of B robots, as in `Snapshot`: R joints, A arms, world frame.

    Attributes:
        step_s: duration of one environment step.
        robot_qpos: (B, R).
        robot_joint_anchor_w: (B, R, 3) a point on each joint's axis.
        robot_joint_axis_w: (B, R, 3) unit direction of each joint.
        tool_position_w: (B, A, 3) centre between the pads.
        tool_rotation_w: (B, A, 3, 3) columns: the hand's axes.
    """

    step_s: float
    robot_qpos: Array
    robot_joint_anchor_w: Array
    robot_joint_axis_w: Array
    tool_position_w: Array
    tool_rotation_w: Array


class RobotKinematics:
    """The chain of a robot's joints.

    Args:
        robot: whose.
    """

    def __init__(self, robot: RobotConfig) -> None:
        arm = load_arm(robot.arm)
        self.arms, self.arm_joints = len(robot.mounts), len(arm.joints)
        torso = np.asarray(robot.torso.position_m)
        mounts = [_frame(torso + mount.position_m, mount.rpy_rad) for mount in robot.mounts]
        inner = [_frame(joint.position_m, joint.rpy_rad) for joint in arm.joints[1:]]
        links = np.array([[mount, *inner] for mount in mounts])  # (A, n, 4, 4), each joint at 0
        # a link's frame at angle q is fixed + cos q * cosine + sin q * sine
        self._cosine, self._sine, self._fixed = (np.zeros_like(links) for _ in range(3))
        self._cosine[..., :2] = links[..., :2]
        self._sine[..., 0], self._sine[..., 1] = links[..., 1], -links[..., 0]
        self._fixed[..., 2:] = links[..., 2:]
        self._hand = _frame(arm.hand.position_m, arm.hand.rpy_rad)
        self._finger_m = np.asarray(arm.finger.position_m)
        self._tool_m = self._finger_m + arm.finger.pad_m  # both in the hand's frame

    def joints(self, agent: Array) -> tuple[Array, Array]:
        """Return positions and velocities of the joints, each (B, R), from the proprioception (B, S).

        NumPy or torch. Base x and y are along the world's axes, as in `Snapshot`.
        """
        xp, tips = namespace(agent), 12 * self.arms
        others = 1 + self.arms * (self.arm_joints + _FINGERS)
        start = tips + 2 * _BASE
        qpos = xp.concat((agent[:, tips : tips + _BASE], agent[:, start : start + others]), axis=1)
        qvel = xp.concat((agent[:, tips + _BASE : start], agent[:, start + others :]), axis=1)
        return qpos, qvel

    def with_joints(self, agent: np.ndarray, qpos: np.ndarray) -> np.ndarray:
        """Return proprioception (B, S) with joints at other positions (B, R), and all else as it was."""
        found, tips = agent.copy(), 12 * self.arms
        start = tips + 2 * _BASE
        found[:, tips : tips + _BASE] = qpos[:, :_BASE]
        found[:, start : start + qpos.shape[1] - _BASE] = qpos[:, _BASE:]
        return found

    def tools(self, qpos: Array) -> tuple[Array, Array]:
        """Return where the hands are in the base's frame: (B, A, 3) and (B, A, 3, 3), of joints at (B, R).

        NumPy or torch.
        """
        hand = self._chain(qpos)[-1]
        return self._point(hand, self._tool_m), hand[..., :3, :3]

    def pose(self, agent: np.ndarray, step_s: float) -> RobotPose:
        """Return joints and hands in the world; of NumPy arrays.

        Args:
            agent: (B, S) proprioception.
            step_s: duration of one environment step.
        """
        return self.pose_at(self.joints(agent)[0], step_s)

    def pose_at(self, qpos: np.ndarray, step_s: float) -> RobotPose:
        """Return what `pose` does, of joints at (B, R)."""
        chain = self._chain(qpos)
        count, hand = len(qpos), chain[-1]
        anchors, axes = (np.zeros((count, qpos.shape[1], 3)) for _ in range(2))
        anchors[:, 1, 0] = qpos[:, 0]  # base y is a slide on base x
        anchors[:, 2:_TRUNK, :2] = qpos[:, None, :2]
        axes[:, 0, 0] = axes[:, 1, 1] = axes[:, 2, 2] = axes[:, 3, 2] = 1.0
        own = (count, self.arms, self.arm_joints + _FINGERS, 3)  # what is the arms' own
        anchor, axis = anchors[:, _TRUNK:].reshape(own), axes[:, _TRUNK:].reshape(own)
        for i, frame in enumerate(chain[:-1]):
            anchor[:, :, i], axis[:, :, i] = frame[..., :3, 3], frame[..., :3, 2]
        anchor[:, :, self.arm_joints :] = self._point(hand, self._finger_m)[:, :, None]
        axis[:, :, self.arm_joints], axis[:, :, -1] = hand[..., :3, 1], -hand[..., :3, 1]
        back = np.zeros((count, 3, 3))  # from rows in the base's axes to the world's
        back[:, 0, 0] = back[:, 1, 1] = np.cos(qpos[:, 2])
        back[:, 0, 1] = np.sin(qpos[:, 2])
        back[:, 1, 0], back[:, 2, 2] = -back[:, 0, 1], 1.0
        origin = anchors[:, 2:3]
        anchors[:, _TRUNK:] = anchor.reshape(count, -1, 3) @ back + origin
        axes[:, _TRUNK:] = axis.reshape(count, -1, 3) @ back
        tool = self._point(hand, self._tool_m) @ back + origin
        return RobotPose(step_s, qpos, anchors, axes, tool, back.swapaxes(1, 2)[:, None] @ hand[..., :3, :3])

    def _chain(self, qpos: Array) -> list[Array]:
        """Return the frames of each joint's link, then of the hand, (B, A, 4, 4) each, in the base's frame."""
        xp = namespace(qpos)
        cosine, sine, fixed, hand = (
            self._as_array(xp, one, qpos) for one in (self._cosine, self._sine, self._fixed, self._hand)
        )
        angles = xp.reshape(qpos[:, _TRUNK:], (qpos.shape[0], self.arms, -1))[..., : self.arm_joints, None, None]
        links = fixed + xp.cos(angles) * cosine + xp.sin(angles) * sine  # (B, A, n, 4, 4)
        links[..., 0, 2, 3] += qpos[:, 3:_TRUNK]  # the lift
        found = [links[..., 0, :, :]]
        for i in range(1, self.arm_joints):
            found.append(found[-1] @ links[..., i, :, :])
        return [*found, found[-1] @ hand]

    def _point(self, frame: Array, position_m: np.ndarray) -> Array:
        """Return a point (..., 3) of frames (..., 4, 4)."""
        x, y, z = position_m.tolist()
        return frame[..., :3, 0] * x + frame[..., :3, 1] * y + frame[..., :3, 2] * z + frame[..., :3, 3]

    @staticmethod
    def _as_array(xp: Any, values: np.ndarray, like: Array) -> Array:
        return values if xp is np else xp.asarray(values, dtype=like.dtype, device=like.device)


def _frame(position_m: Any, rpy_rad: Any) -> np.ndarray:
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = quat_to_matrix(quat_from_rpy(rpy_rad)), position_m
    return frame
