"""Forward kinematics: from the robot's proprioception to its joints and hands, without the engine.

A policy that sees `agent` only (docs/observations.md) finds out here where its hands are, and what inverse
kinematics needs. Frames are 4 x 4 matrices; the base's frame is on the floor below the base, x forward, z up.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.geometry.arrays import Array, matmul, namespace
from artiskill.geometry.kernel import inlined_kernel, kernel
from artiskill.geometry.rotations import quat_from_rpy, quat_to_matrix
from artiskill.robots.arm_config import load_arm
from artiskill.robots.config import RobotConfig

_BASE = 3  # base x, y and yaw; then the lift
_LIFT, _TRUNK = 3, 4
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
        finger = np.asarray(arm.finger.position_m)
        self._offsets_m = np.stack((finger, finger + arm.finger.pad_m))  # of finger and tool, in the hand's frame

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
        hand = self._hands(qpos)
        x, y, z = self._offsets_m[1].tolist()
        tool = hand[..., :3, 0] * x + hand[..., :3, 1] * y + hand[..., :3, 2] * z + hand[..., :3, 3]
        return tool, hand[..., :3, :3]

    def pose(self, agent: np.ndarray, step_s: float) -> RobotPose:
        """Return joints and hands in the world; of NumPy arrays.

        Args:
            agent: (B, S) proprioception.
            step_s: duration of one environment step.
        """
        return self.pose_at(self.joints(agent)[0], step_s)

    def pose_at(self, qpos: np.ndarray, step_s: float) -> RobotPose:
        """Return what `pose` does, of joints at (B, R)."""
        qpos = np.asarray(qpos, dtype=np.float64)
        count, arms = len(qpos), self.arms
        anchors, axes = np.zeros((2, count, qpos.shape[1], 3))
        tool, rotation = np.empty((count, arms, 3)), np.empty((count, arms, 3, 3))
        turn = np.stack((np.cos(qpos[:, 2]), np.sin(qpos[:, 2])), axis=1)
        _fill_pose(self._frames(qpos), qpos, turn, self._offsets_m, (anchors, axes, tool, rotation))
        return RobotPose(step_s, qpos, anchors, axes, tool, rotation)

    def _frames(self, qpos: np.ndarray) -> np.ndarray:
        """Return the frames of each joint's link, then of the hand, (B, A, n + 1, 4, 4), in the base's frame."""
        count, n = len(qpos), self.arm_joints
        angles = qpos[:, _TRUNK:].reshape(count, self.arms, -1)[..., :n].astype(np.float64)
        frames = np.empty((count, self.arms, n + 1, 4, 4))
        links = self._fixed, self._cosine, self._sine, self._hand
        _fill_frames(np.cos(angles), np.sin(angles), qpos[:, _LIFT].astype(np.float64), links, frames)
        return frames

    def _hands(self, qpos: Array) -> Array:
        """Return the frames of the hands, (B, A, 4, 4), in the base's frame; of NumPy or torch."""
        xp = namespace(qpos)
        if xp is np:
            return self._frames(qpos)[:, :, -1]
        cosine, sine, fixed, hand = (
            xp.asarray(one, dtype=qpos.dtype, device=qpos.device)
            for one in (self._cosine, self._sine, self._fixed, self._hand)
        )
        angles = xp.reshape(qpos[:, _TRUNK:], (qpos.shape[0], self.arms, -1))[..., : self.arm_joints, None, None]
        links = fixed + xp.cos(angles) * cosine + xp.sin(angles) * sine  # (B, A, n, 4, 4)
        links[..., 0, 2, 3] += qpos[:, _LIFT:_TRUNK]
        found = links[..., 0, :, :]
        for i in range(1, self.arm_joints):
            found = matmul(found, links[..., i, :, :])
        return matmul(found, hand)


@kernel
def _fill_frames(cosine: Any, sine: Any, lift: Any, links: Any, out: Any) -> None:
    """Of joints (B, A, n) and lifts (B,), into (B, A, n + 1, 4, 4): each link's frame times all before it."""
    fixed, by_cosine, by_sine, hand = links
    for b in range(out.shape[0]):
        for a in range(out.shape[1]):
            for i in range(out.shape[2]):
                frame = out[b, a, i]
                for r in range(4):
                    for k in range(4):
                        if i == cosine.shape[2]:
                            frame[r, k] = hand[r, k]
                        else:
                            turned = fixed[a, i, r, k] + cosine[b, a, i] * by_cosine[a, i, r, k]
                            frame[r, k] = turned + sine[b, a, i] * by_sine[a, i, r, k]
                if i == 0:
                    frame[2, 3] += lift[b]
                else:
                    _multiply(out[b, a, i - 1], frame)


@inlined_kernel
def _multiply(before: Any, frame: Any) -> None:
    """Replace a frame (4, 4) by the product with the one before."""
    for k in range(4):
        x, y, z, w = frame[0, k], frame[1, k], frame[2, k], frame[3, k]
        for r in range(4):
            frame[r, k] = before[r, 0] * x + before[r, 1] * y + before[r, 2] * z + before[r, 3] * w


@kernel
def _fill_pose(frames: Any, qpos: Any, turn: Any, offsets: Any, out: Any) -> None:
    """Fill `RobotPose`: anchors and axes, which are zeros, places and axes of hands.

    Args:
        frames: (B, A, n + 1, 4, 4) in the base's frame.
        qpos: (B, R).
        turn: (B, 2) cosine and sine of the base's yaw.
        offsets: (2, 3) of finger and tool in the hand's frame, m.
        out: arrays of the pose.
    """
    anchors, axes, tool, rotation = out
    n = frames.shape[2] - 1
    for b in range(frames.shape[0]):
        x, y = qpos[b, 0], qpos[b, 1]
        cos, sin = turn[b, 0], turn[b, 1]
        anchors[b, 1, 0] = x  # base y is a slide on base x
        for j in range(2, _TRUNK):
            anchors[b, j, 0], anchors[b, j, 1] = x, y
        axes[b, 0, 0] = axes[b, 1, 1] = axes[b, 2, 2] = axes[b, 3, 2] = 1.0
        for a in range(frames.shape[1]):
            first = _TRUNK + a * (n + _FINGERS)
            hand = frames[b, a, n]
            for i in range(n):
                frame = frames[b, a, i]
                _turn(frame[0, 3], frame[1, 3], frame[2, 3], cos, sin, x, y, anchors[b, first + i])
                _turn(frame[0, 2], frame[1, 2], frame[2, 2], cos, sin, 0.0, 0.0, axes[b, first + i])
            for f in range(_FINGERS):  # along y, one to each side
                side = 1.0 - 2.0 * f
                _place(hand, offsets[0], cos, sin, x, y, anchors[b, first + n + f])
                own = axes[b, first + n + f]
                _turn(side * hand[0, 1], side * hand[1, 1], side * hand[2, 1], cos, sin, 0.0, 0.0, own)
            _place(hand, offsets[1], cos, sin, x, y, tool[b, a])
            for k in range(3):
                _turn(hand[0, k], hand[1, k], hand[2, k], cos, sin, 0.0, 0.0, rotation[b, a, :, k])


@inlined_kernel
def _place(frame: Any, point: Any, cos: Any, sin: Any, x: Any, y: Any, out: Any) -> None:
    """Fill (3,) with a point of a frame (4, 4), in the world."""
    u = frame[0, 0] * point[0] + frame[0, 1] * point[1] + frame[0, 2] * point[2] + frame[0, 3]
    v = frame[1, 0] * point[0] + frame[1, 1] * point[1] + frame[1, 2] * point[2] + frame[1, 3]
    w = frame[2, 0] * point[0] + frame[2, 1] * point[1] + frame[2, 2] * point[2] + frame[2, 3]
    _turn(u, v, w, cos, sin, x, y, out)


@inlined_kernel
def _turn(u: Any, v: Any, w: Any, cos: Any, sin: Any, x: Any, y: Any, out: Any) -> None:
    """Fill (3,) with what has turned about z, and moved by x and y."""
    out[0], out[1], out[2] = cos * u - sin * v + x, sin * u + cos * v + y, w


def _frame(position_m: Any, rpy_rad: Any) -> np.ndarray:
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = quat_to_matrix(quat_from_rpy(rpy_rad)), position_m
    return frame
