"""Steps of robots that stand elsewhere than the demonstrator's, and what leads back: correction without an expert.

Demonstrations show few states beside the expert's way, so that what imitates them does not find back to it. The
robot's kinematics is known, and the cloud shows what stands still. So a step can be told anew with the robot moved
a little: joints, hands and points follow, and the command is the demonstrated one and a motion back. Hands move
less near what they work on, where a moved one would stand inside of it; base and posture vary all the same.
Open hands turn wherever they are: that the fingers lie askew when they close is how a handle is missed. And their
fingers stand elsewhere now and then, also closed, as after that.
"""

import numpy as np

from artiskill.experts.whole_body import TRUNK, Grip
from artiskill.learning.commands import CommandSpace
from artiskill.learning.observation import ObservationArrays
from artiskill.robots.arm_config import load_arm
from artiskill.robots.kinematics import RobotKinematics, RobotPose

_FINGERS, _BASE, _TWIST = 2, 3, 6
_SLIDES, _YAW = (0, 1, 3), 2  # of the trunk
_HAND_GAIN_S, _TRUNK_GAIN_S = 3.0, 1.0  # how strongly commands lead back, 1/s
_FREE_M = 0.25  # hands that are so far from all points move in full
_BASE_M, _JOINT_RAD = 0.03, 0.06  # standard deviations of base and lift, and of yaw and arms, whatever hands do
_FINGERS_SHARE = 0.3  # of the open hands, those whose fingers stand elsewhere
_APART = np.array([1.0, -1.0])  # along the hand's y axis the fingers go outwards
_NEWTON_STEPS, _DAMPING = 4, 1e-3
_FAR_M = 1e3


class Displacement:
    """Moves robots, and corrects what they were commanded.

    Args:
        space: of the commands.
        frame: of the points: `world` or `robot`.
        shift_m: standard deviation of where hands are, in each direction.
        turn_rad: that of their rotation vector.
    """

    def __init__(self, space: CommandSpace, frame: str, shift_m: float, turn_rad: float) -> None:
        self._space, self._frame = space, frame
        self._way_std = np.tile(np.repeat((shift_m, turn_rad), 3), space.arms)
        self._kinematics = RobotKinematics(space.robot)
        self._count = TRUNK + space.arms * self._kinematics.arm_joints
        self._std = np.full(self._count, _JOINT_RAD)
        self._std[list(_SLIDES)] = _BASE_M
        own = self._kinematics.arm_joints + _FINGERS
        arms = [TRUNK + own * arm + np.arange(self._kinematics.arm_joints) for arm in range(space.arms)]
        self._columns = np.concatenate((np.arange(TRUNK), *arms))  # of all joints: those that are moved
        arm = load_arm(space.robot.arm)
        self._low, self._high = np.tile(np.array([joint.range_rad for joint in arm.joints]).T, space.arms)
        ends = TRUNK + own * np.arange(1, space.arms + 1)
        self._fingers = ends[:, None] - _FINGERS + np.arange(_FINGERS)  # (A, 2) likewise
        self._open_m = arm.finger.range_m[1]

    def __call__(
        self, seen: ObservationArrays, labels: np.ndarray, rng: np.random.Generator
    ) -> tuple[ObservationArrays, np.ndarray]:
        """Return B steps with robots that are moved: what is seen, and commands (B, V).

        The robot's own points are missing; velocities, and how the points were chosen, are as they were.
        """
        agent = seen.agent.astype(np.float64)
        pose = self._kinematics.pose(agent, self._space.step_s)
        jacobian = self._jacobian(pose)
        drawn = rng.normal(0.0, 1.0, (len(agent), self._count)) * self._std
        ways = rng.normal(0.0, 1.0, (len(agent), len(self._way_std))) * self._way_std
        ways *= self._shares(pose, seen, labels)
        qpos = self._reached(pose, jacobian, drawn, ways)
        wider = self._move_fingers(qpos, self._are_open(labels), rng)
        moved = self._with_joints(agent, qpos)
        other = self._kinematics.pose(moved, self._space.step_s)
        count, tips = len(agent), 6 * self._space.arms
        places = agent[:, :tips].reshape(count, self._space.arms, _FINGERS, 3)
        places = places + (wider * _APART)[..., None] * pose.tool_rotation_w[:, :, None, :, 1]
        moved[:, :tips] = _carried(places, pose, other).reshape(count, -1)
        masks, valid = seen.masks, seen.valid
        if masks.shape[2] > 1:  # the last one is the robot's
            valid = valid & (masks[..., -1] == 0)
        points = seen.points if self._frame == "world" else _seen_from(seen.points, qpos, pose.robot_qpos)
        commands = self._corrected(labels, pose, other)
        return seen._replace(
            points=points.astype(np.float32), valid=valid, agent=moved.astype(np.float32)
        ), commands.astype(np.float32)

    def _jacobian(self, pose: RobotPose) -> np.ndarray:
        """Return that of the hands, (B, 6 A, n): of each, linear rows first."""
        arms, each = self._space.arms, self._kinematics.arm_joints
        axis, anchor = (one[:, self._columns] for one in (pose.robot_joint_axis_w, pose.robot_joint_anchor_w))
        found = np.zeros((len(axis), arms, 2, 3, self._count))
        slides = list(_SLIDES)
        for arm in range(arms):
            linear, angular = np.cross(axis, pose.tool_position_w[:, arm, None] - anchor), axis.copy()
            linear[:, slides], angular[:, slides] = axis[:, slides], 0.0
            others = np.flatnonzero((np.arange(TRUNK, self._count) - TRUNK) // each != arm) + TRUNK
            linear[:, others], angular[:, others] = 0.0, 0.0
            found[:, arm, 0], found[:, arm, 1] = linear.swapaxes(1, 2), angular.swapaxes(1, 2)
        return found.reshape(len(axis), _TWIST * arms, self._count)

    def _shares(self, pose: RobotPose, seen: ObservationArrays, labels: np.ndarray) -> np.ndarray:
        """Return which share of its way each hand moves, (B, 6 A): less, the nearer it is to what it sees."""
        tools = pose.tool_position_w
        if self._frame != "world":
            tools = _seen_from(tools, pose.robot_qpos)
        own = seen.valid & (seen.masks[..., -1] == 0) if seen.masks.shape[2] > 1 else seen.valid
        gaps = np.linalg.norm(tools[:, :, None] - seen.points[:, None], axis=-1)  # (B, A, N)
        gaps = np.where(own[:, None], gaps, _FAR_M).min(axis=-1)
        near = np.clip(gaps / _FREE_M, 0.0, 1.0)
        turning = np.where(self._are_open(labels), 1.0, near)
        return np.repeat(np.stack((near, turning), axis=2), 3, axis=2).reshape(len(tools), -1)

    def _are_open(self, labels: np.ndarray) -> np.ndarray:
        """Return which hands are told to open by commands (B, V): (B, A)."""
        start = self._space.motion_size + self._space.arms
        found: np.ndarray = labels[:, start : start + self._space.arms] == int(Grip.OPEN)
        return found

    def _move_fingers(self, qpos: np.ndarray, are_open: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Move fingers of some open hands in joints (B, R); return how far each has moved outwards, (B, A, 2)."""
        drawn, widths = rng.random(are_open.shape), rng.uniform(0.0, self._open_m, are_open.shape)
        chosen = are_open & (drawn < _FINGERS_SHARE)
        before = qpos[:, self._fingers]
        qpos[:, self._fingers] = np.where(chosen[..., None], widths[..., None], before)
        found: np.ndarray = qpos[:, self._fingers] - before
        return found

    def _reached(self, pose: RobotPose, jacobian: np.ndarray, drawn: np.ndarray, ways: np.ndarray) -> np.ndarray:
        """Return joints (B, R) near those drawn, at which hands have come their ways (B, 6 A)."""
        square = jacobian @ jacobian.swapaxes(1, 2) + _DAMPING * np.eye(jacobian.shape[1])
        inverse = jacobian.swapaxes(1, 2) @ np.linalg.inv(square)
        qpos = np.array(pose.robot_qpos)
        qpos[:, self._columns] += drawn
        for step in range(_NEWTON_STEPS + 1):
            arm = self._columns[TRUNK:]
            qpos[:, arm] = np.clip(qpos[:, arm], self._low, self._high)
            if step < _NEWTON_STEPS:
                there = self._kinematics.pose(self._agent_of(qpos), pose.step_s)
                left = ways - _ways(pose, there, self._space.arms)
                qpos[:, self._columns] += (inverse @ left[..., None])[..., 0]
        return qpos

    def _agent_of(self, qpos: np.ndarray) -> np.ndarray:
        """Return proprioception (B, S) of joints at (B, R), of which nothing else is asked."""
        size = 12 * self._kinematics.arms + 2 * qpos.shape[1]
        return self._with_joints(np.zeros((len(qpos), size)), qpos)

    def _with_joints(self, agent: np.ndarray, qpos: np.ndarray) -> np.ndarray:
        """Return proprioception (B, S) with joints at (B, R), see `RobotKinematics.joints`."""
        found, tips = agent.copy(), 12 * self._kinematics.arms
        found[:, tips : tips + _BASE] = qpos[:, :_BASE]
        start = tips + 2 * _BASE
        found[:, start : start + qpos.shape[1] - _BASE] = qpos[:, _BASE:]
        return found

    def _corrected(self, labels: np.ndarray, pose: RobotPose, other: RobotPose) -> np.ndarray:
        """Return commands (B, V) that lead back to where the robots were while they do what they did."""
        space, count = self._space, len(labels)
        twists, trunk = space.motions(labels)
        shape = (count, space.arms, 2, 3)
        world = np.einsum("baij,bakj->baki", pose.tool_rotation_w, twists.reshape(shape))
        world = world - _HAND_GAIN_S * _ways(pose, other, space.arms).reshape(shape)
        twists = np.einsum("baji,bakj->baki", other.tool_rotation_w, world).reshape(count, -1)
        before, after = pose.robot_qpos[:, :TRUNK], other.robot_qpos[:, :TRUNK]
        trunk = _turned(trunk, before[:, _YAW]) - _TRUNK_GAIN_S * (after - before)
        return space.with_motions(labels, twists, _turned(trunk, -after[:, _YAW]))


def _ways(pose: RobotPose, other: RobotPose, arms: int) -> np.ndarray:
    """Return how hands have moved and turned, (B, 6 A); turns are small."""
    moved = other.tool_position_w - pose.tool_position_w
    turn = other.tool_rotation_w @ pose.tool_rotation_w.swapaxes(2, 3)  # (B, A, 3, 3)
    skew = (turn - turn.swapaxes(2, 3)) / 2
    angles = np.stack((skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]), axis=-1)
    return np.stack((moved, angles), axis=2)[:, :arms].reshape(len(moved), -1)


def _carried(places: np.ndarray, pose: RobotPose, other: RobotPose) -> np.ndarray:
    """Return world points (B, A, K, 3) that have moved with the hands."""
    turn = other.tool_rotation_w @ pose.tool_rotation_w.swapaxes(2, 3)
    arms = places.shape[1]
    own = places - pose.tool_position_w[:, :arms, None]
    return own @ turn[:, :arms].swapaxes(2, 3) + other.tool_position_w[:, :arms, None]


def _seen_from(points: np.ndarray, qpos: np.ndarray, given: np.ndarray | None = None) -> np.ndarray:
    """Return points (B, N, 3) in the base's frame at joints (B, R), given in the world's, or another base's."""
    found = points.astype(np.float64)
    if given is not None:
        found = _turned(found, given[:, None, _YAW])
        found[..., :2] += given[:, None, :2]
    found[..., :2] -= qpos[:, None, :2]
    return _turned(found, -qpos[:, None, _YAW])


def _turned(vectors: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Return vectors (..., n) of which the first two numbers, x and y, have turned about z."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    found = vectors.copy()
    found[..., 0] = cos * vectors[..., 0] - sin * vectors[..., 1]
    found[..., 1] = sin * vectors[..., 0] + cos * vectors[..., 1]
    return found
