"""Steps of robots that stand elsewhere than the demonstrator's, and what leads back: correction without an expert.

Demonstrations show few states beside the expert's way, so what imitates them does not find back to it. The robot's
kinematics is known, and a cloud shows what does not move with the robot. So a step can be told anew with the robot
moved a little: joints, hands and points follow, and the command is the demonstrated one plus a motion back. Hands
move less near what they work on, where a moved one would stand inside of it; base and posture vary all the same.
A single open hand turns wherever it is, as fingers that lie askew when they close miss a handle. Its fingers stand
elsewhere now and then: after a miss they are closed.
"""

import numpy as np

from artiskill.config import check
from artiskill.experts.whole_body import TRUNK, Grip, WholeBodyController
from artiskill.learning.commands import CommandSpace
from artiskill.learning.observation import ObservationArrays
from artiskill.robots.arm_config import load_arm
from artiskill.robots.kinematics import RobotKinematics, RobotPose

_FINGERS = 2
_SLIDES, _YAW, _LIFT = [0, 1, 3], 2, 3  # of the trunk
_HAND_GAIN_S, _TRUNK_GAIN_S = 3.0, 1.0  # how strongly commands lead back, 1/s
_FREE_M = 0.25  # hands that are so far from all points move in full
# standard deviations of base and lift, and of yaw and arms, before all of them move for the hands
_BASE_M, _JOINT_RAD = 0.03, 0.06
_OTHER_WIDTHS = 0.3  # share of the open hands whose fingers stand elsewhere
_OUTWARDS = np.array([1.0, -1.0])  # of the fingers, along the hand's y axis
_NEWTON_STEPS, _DAMPING = 4, 1e-3
_NEAR = 0.01  # metres and radians: hands that are so near to where they shall be are there
_FAR_M = 1e3


class Displacement:
    """Moves robots, and corrects what they were commanded.

    Args:
        space: of the commands.
        frame: of the points: `world` or `robot`.
        hand_m: standard deviation of where hands are, in each direction.
        hand_rad: that of each component of their rotation vectors; small, as turns are taken for small.

    Raises:
        ConfigError: the commands leave an arm of the robot alone.
    """

    def __init__(self, space: CommandSpace, frame: str, hand_m: float, hand_rad: float) -> None:
        self._space, self._frame = space, frame
        self._kinematics = RobotKinematics(space.robot)
        mounted = self._kinematics.arms
        check(space.arms == mounted, f"displace is for commands of all {mounted} arms, not of {space.arms}")
        self._hand_std = np.tile(np.repeat((hand_m, hand_rad), 3), space.arms)
        self._body = WholeBodyController(space.robot, space.whole_body, space.arms)
        self._joint_std = np.full(self._body.num_joints, _JOINT_RAD)
        self._joint_std[_SLIDES] = _BASE_M
        arm = load_arm(space.robot.arm)
        limits = np.array([joint.range_rad for joint in arm.joints] * space.arms)
        self._low, self._high = np.concatenate(([space.robot.lift.range_m], limits)).T  # from the lift on
        self._open_m = arm.finger.range_m[1]

    def __call__(
        self, seen: ObservationArrays, labels: np.ndarray, rng: np.random.Generator
    ) -> tuple[ObservationArrays, np.ndarray]:
        """Return B steps, at least one, with robots that are moved: what is seen, and commands (B, V).

        The robot's own points are missing; velocities, and how the points were chosen, are as they were.
        """
        agent = seen.agent.astype(np.float64)
        valid = seen.valid & (seen.masks[..., -1] == 0)  # the last mask is the robot's
        pose = self._kinematics.pose(agent, self._space.step_s)
        are_free = self._are_free(labels)
        joints = rng.normal(0.0, 1.0, (len(agent), self._body.num_joints)) * self._joint_std
        hands = rng.normal(0.0, 1.0, (len(agent), len(self._hand_std))) * self._hand_std
        hands *= self._shares(pose, seen.points, valid, are_free)
        qpos = self._reached(pose, joints, hands)
        wider = self._move_fingers(qpos, are_free, rng)
        moved = self._kinematics.with_joints(agent, qpos)
        other = self._kinematics.pose_at(qpos, self._space.step_s)
        count, tips = len(agent), 6 * self._space.arms
        places = agent[:, :tips].reshape(count, self._space.arms, _FINGERS, 3)
        places = places + (wider * _OUTWARDS)[..., None] * pose.tool_rotation_w[:, :, None, :, 1]
        moved[:, :tips] = _carried(places, pose, other).reshape(count, -1)
        points = seen.points
        if self._frame != "world":
            points = _in_base_frame(_in_world_frame(points, pose.robot_qpos), qpos)
        return seen._replace(
            points=points.astype(np.float32), valid=valid, agent=moved.astype(np.float32)
        ), self._corrected(labels, pose, other)

    def _are_free(self, labels: np.ndarray) -> np.ndarray:
        """Return which hands hold nothing, by commands (B, V): (B, A). Of two, open ones may press as well."""
        start, arms = self._space.motion_size + self._space.arms, self._space.arms
        found: np.ndarray = (labels[:, start : start + arms] == int(Grip.OPEN)) & (arms == 1)
        return found

    def _shares(self, pose: RobotPose, points: np.ndarray, valid: np.ndarray, are_free: np.ndarray) -> np.ndarray:
        """Return which share of its motion each hand makes, (B, 6 A): less, the nearer it is to what it sees."""
        tools = pose.tool_position_w
        if self._frame != "world":
            tools = _in_base_frame(tools, pose.robot_qpos)
        gaps = np.linalg.norm(tools[:, :, None] - points[:, None], axis=-1)  # (B, A, N)
        gaps = np.where(valid[:, None], gaps, _FAR_M).min(axis=-1)
        near = np.clip(gaps / _FREE_M, 0.0, 1.0)
        turning = np.where(are_free, 1.0, near)
        return np.repeat(np.stack((near, turning), axis=2), 3, axis=2).reshape(len(tools), -1)

    def _move_fingers(self, qpos: np.ndarray, are_free: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Move fingers of some free hands in joints (B, R); return how far each has moved outwards, (B, A, 2)."""
        drawn, widths = rng.random(are_free.shape), rng.uniform(0.0, self._open_m, are_free.shape)
        chosen = are_free & (drawn < _OTHER_WIDTHS)
        columns = self._body.finger_columns
        before = qpos[:, columns]
        qpos[:, columns] = np.where(chosen[..., None], widths[..., None], before)
        found: np.ndarray = qpos[:, columns] - before
        return found

    def _reached(self, pose: RobotPose, joints: np.ndarray, hands: np.ndarray) -> np.ndarray:
        """Return joints (B, R) some way off (B, n), at which hands have moved as they shall (B, 6 A).

        Where the lift would leave its range, it stays, and the arms do its part. Robots whose hands do not come
        there stay as they are.
        """
        jacobian = self._body.jacobians(pose)
        qpos = self._solved(pose, jacobian, joints, hands)
        stays = (qpos[:, _LIFT] < self._low[0]) | (qpos[:, _LIFT] > self._high[0])
        jacobian[stays, :, _LIFT], joints = 0.0, joints.copy()
        joints[stays, _LIFT] = 0.0
        qpos = np.where(stays[:, None], self._solved(pose, jacobian, joints, hands), qpos)
        reached = self._kinematics.pose_at(qpos, pose.step_s)
        missed = np.abs(hands - _hand_motions(pose, reached)).max(axis=1) > _NEAR
        return np.where(missed[:, None], pose.robot_qpos, qpos)

    def _solved(self, pose: RobotPose, jacobian: np.ndarray, joints: np.ndarray, hands: np.ndarray) -> np.ndarray:
        """Return joints (B, R) by Newton's method; those of the arms keep their ranges."""
        square = jacobian @ jacobian.swapaxes(1, 2) + _DAMPING * np.eye(jacobian.shape[1])
        inverse = jacobian.swapaxes(1, 2) @ np.linalg.inv(square)
        arms = self._body.columns[TRUNK:]
        qpos = np.array(pose.robot_qpos)
        qpos[:, self._body.columns] += joints
        qpos[:, arms] = np.clip(qpos[:, arms], self._low[1:], self._high[1:])
        for _ in range(_NEWTON_STEPS):
            reached = self._kinematics.pose_at(qpos, pose.step_s)
            missing = hands - _hand_motions(pose, reached)
            qpos[:, self._body.columns] += (inverse @ missing[..., None])[..., 0]
            qpos[:, arms] = np.clip(qpos[:, arms], self._low[1:], self._high[1:])
        return qpos

    def _corrected(self, labels: np.ndarray, pose: RobotPose, other: RobotPose) -> np.ndarray:
        """Return commands (B, V) that lead back to where the robots were while they do what they did."""
        space, count = self._space, len(labels)
        twists, trunk = space.motions(labels)
        shape = (count, space.arms, 2, 3)
        world = np.einsum("baij,bakj->baki", pose.tool_rotation_w, twists.reshape(shape))
        world = world - _HAND_GAIN_S * _hand_motions(pose, other).reshape(shape)
        twists = np.einsum("baji,bakj->baki", other.tool_rotation_w, world).reshape(count, -1)
        before, after = pose.robot_qpos[:, :TRUNK], other.robot_qpos[:, :TRUNK]
        trunk = _turned(trunk, before[:, _YAW]) - _TRUNK_GAIN_S * (after - before)
        return space.with_motions(labels, twists, _turned(trunk, -after[:, _YAW])).astype(np.float32)


def _hand_motions(pose: RobotPose, other: RobotPose) -> np.ndarray:
    """Return how hands have moved and turned, (B, 6 A); turns are small."""
    moved = other.tool_position_w - pose.tool_position_w
    turn = other.tool_rotation_w @ pose.tool_rotation_w.swapaxes(2, 3)  # (B, A, 3, 3)
    skew = (turn - turn.swapaxes(2, 3)) / 2
    angles = np.stack((skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]), axis=-1)
    return np.stack((moved, angles), axis=2).reshape(len(moved), -1)


def _carried(places: np.ndarray, pose: RobotPose, other: RobotPose) -> np.ndarray:
    """Return world points (B, A, K, 3) that have moved with the hands."""
    turn = other.tool_rotation_w @ pose.tool_rotation_w.swapaxes(2, 3)
    offsets = places - pose.tool_position_w[:, :, None]
    return offsets @ turn.swapaxes(2, 3) + other.tool_position_w[:, :, None]


def _in_base_frame(points: np.ndarray, qpos: np.ndarray) -> np.ndarray:
    """Return world points (B, N, 3) as bases see them, of robots with joints at (B, R)."""
    found = points.astype(np.float64)
    found[..., :2] -= qpos[:, None, :2]
    return _turned(found, -qpos[:, None, _YAW])


def _in_world_frame(points: np.ndarray, qpos: np.ndarray) -> np.ndarray:
    """Return points (B, N, 3) in the world, of such that bases see, of robots with joints at (B, R)."""
    found = _turned(points.astype(np.float64), qpos[:, None, _YAW])
    found[..., :2] += qpos[:, None, :2]
    return found


def _turned(vectors: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Return vectors (..., n) of which the first two numbers, x and y, have turned about z."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    found = vectors.copy()
    found[..., 0] = cos * vectors[..., 0] - sin * vectors[..., 1]
    found[..., 1] = sin * vectors[..., 0] + cos * vectors[..., 1]
    return found
