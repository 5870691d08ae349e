"""Commands to the whole robot, and how they become actions: base, lift and arms follow twists of the hands.

That is differential inverse kinematics, a damped least-squares problem with bounds: follow the twists, prefer a
posture, stay within velocity and position limits. Carrying a command out takes the robot's own state and nothing
else. So a policy can learn commands from an expert and act without any privilege.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

import numpy as np

from artiskill.config import check_not_negative, check_positive
from artiskill.envs.control import ActionScale, action_scale
from artiskill.geometry.arrays import Array
from artiskill.geometry.rotations import cross
from artiskill.robots.arm_config import load_arm
from artiskill.robots.config import RobotConfig

TRUNK = 4  # base x, y and yaw; then the lift; then the arms' joints
_BASE = 3
_FINGERS = 2
_SLIDES = [0, 1, 3]


@dataclass(frozen=True)
class WholeBodyConfig:
    """Weights of the least-squares problem."""

    rotation_weight_m: float = 0.3  # how many metres of position error a radian of orientation error is worth
    # cost of a base velocity that differs from the posture's, relative to the hand's error
    base_damping: float = 0.12
    yaw_damping: float = 0.12  # likewise, of its yaw rate
    lift_damping: float = 0.12  # likewise
    arm_damping: float = 0.06  # likewise, of each arm joint
    limit_margin_rad: float = 0.03  # arm joints stay this far inside their limits

    def __post_init__(self) -> None:
        check_positive(self, "rotation_weight_m", "base_damping", "yaw_damping", "lift_damping", "arm_damping")
        check_not_negative(self, "limit_margin_rad")


class RobotState(Protocol):
    """What inverse kinematics needs of the robot, B = 1, as in `Snapshot`; R joints, arms with a tool each."""

    @property
    def step_s(self) -> float:
        """Duration of one environment step."""

    @property
    def robot_qpos(self) -> Array:
        """(1, R)."""

    @property
    def robot_joint_anchor_w(self) -> Array:
        """(1, R, 3)."""

    @property
    def robot_joint_axis_w(self) -> Array:
        """(1, R, 3)."""

    @property
    def tool_position_w(self) -> Array:
        """(1, arms, 3)."""

    @property
    def tool_rotation_w(self) -> Array:
        """(1, arms, 3, 3)."""


class Grip(IntEnum):
    """What the fingers of a hand do."""

    OPEN = 0  # each finger goes to the command's width
    CLOSING = 1  # both close slowly, lest they penetrate what they meet
    SHUT = 2  # both close with all their force


@dataclass(frozen=True, eq=False)
class Command:
    """What is asked of trunk, hands and fingers in one step; A hands are moved.

    Attributes:
        phase: which part of the work this is, an index into the expert's `phases`.
        twists: (A, 6) linear (m/s) and angular (rad/s) velocity of each tool's centre, in that hand's own axes.
        trunk_qvel: (4,) preferred velocity of the base forward and to its left (m/s), of its yaw (rad/s) and
            of the lift (m/s).
        arm_gain_s: how strongly the arms strive for their posture, 1/s.
        grip: (A,) values of `Grip`.
        width_m: (A,) how far each finger of an open hand is from the middle.
        press_n: force with which two hands press towards each other, along the level line between them.
    """

    phase: int
    twists: np.ndarray
    trunk_qvel: np.ndarray
    arm_gain_s: float
    grip: np.ndarray
    width_m: np.ndarray
    press_n: float = 0.0


def in_hand_axes(state: RobotState, twists_w: np.ndarray) -> np.ndarray:
    """Return twists (A, 6) of the hands in their own axes, given in the world's."""
    turn = state.tool_rotation_w[0, : len(twists_w)]  # (A, 3, 3)
    turned: np.ndarray = np.einsum("aji,akj->aki", turn, twists_w.reshape(-1, 2, 3)).reshape(-1, 6)
    return turned


def in_base_axes(state: RobotState, trunk_w: np.ndarray) -> np.ndarray:
    """Return velocities (4,) of the trunk with base x and y along the base's axes, given along the world's."""
    cos, sin = np.cos(state.robot_qpos[0, 2]), np.sin(state.robot_qpos[0, 2])
    return np.array(
        (cos * trunk_w[0] + sin * trunk_w[1], cos * trunk_w[1] - sin * trunk_w[0], trunk_w[2], trunk_w[3])
    )


def in_world_axes(state: RobotState, trunk: np.ndarray) -> np.ndarray:
    """Return velocities (4,) of the trunk with base x and y along the world's axes, given along the base's."""
    cos, sin = np.cos(state.robot_qpos[0, 2]), np.sin(state.robot_qpos[0, 2])
    return np.array((cos * trunk[0] - sin * trunk[1], sin * trunk[0] + cos * trunk[1], trunk[2], trunk[3]))


class WholeBodyController:
    """Twists of the hands to actions of the robot.

    Its n joints are base x, y (world frame), yaw, lift, and the joints of the arms that it moves, one after the
    other. A is the number of these arms.

    Args:
        robot: who acts.
        config: weights.
        arms: how many of the robot's arms it moves, the first one first; the others rest.

    Attributes:
        columns: (n,) where its joints stand among all R.
        finger_columns: (A, 2) where the fingers of these arms do.
    """

    def __init__(self, robot: RobotConfig, config: WholeBodyConfig, arms: int = 1) -> None:
        assert arms <= len(robot.mounts), "it moves arms that the robot has"
        self.config = config
        self.scale: ActionScale = action_scale(robot)
        arm = load_arm(robot.arm)
        self.arm_joints = len(arm.joints)
        self.num_joints = TRUNK + arms * self.arm_joints
        starts = TRUNK + np.arange(arms) * (self.arm_joints + _FINGERS)
        own = (starts[:, None] + np.arange(self.arm_joints)).reshape(-1)
        self.columns = np.concatenate((np.arange(TRUNK), own))
        self.finger_columns = starts[:, None] + self.arm_joints + np.arange(_FINGERS)
        self._arms = [
            slice(start, start + self.arm_joints) for start in range(TRUNK, self.num_joints, self.arm_joints)
        ]
        inside = np.array((config.limit_margin_rad, -config.limit_margin_rad))
        ranges = np.array([joint.range_rad for joint in arm.joints]) + inside
        free = np.array([(-np.inf, np.inf)] * _BASE)
        self._limits = np.concatenate((free, [robot.lift.range_m], *[ranges] * arms))  # (n, 2)
        self.max_speed = self.scale.half_range[self.columns]
        trunk = [config.base_damping] * 2 + [config.yaw_damping, config.lift_damping]
        self._damping = np.array(trunk + [config.arm_damping] * (arms * self.arm_joints))
        self._drive_damping = robot.drives.arm_damping

    def qpos(self, state: RobotState) -> np.ndarray:
        """Return where the n joints are (B = 1), (n,)."""
        found: np.ndarray = state.robot_qpos[0, self.columns]
        return found

    def joint_velocities(self, state: RobotState, twists_w: np.ndarray, posture_qvel: np.ndarray) -> np.ndarray:
        """Joint velocities that make every hand follow its twist.

        Args:
            state: of one environment (B = 1).
            twists_w: (A, 6) linear (m/s) and angular (rad/s) velocity of each tool's centre, world frame.
            posture_qvel: (n,) joint velocities preferred where the twists leave a choice.

        Returns:
            (n,) velocities within speed and position limits.
        """
        weights = np.tile(np.repeat((1.0, self.config.rotation_weight_m), 3), len(self._arms))
        matrix = np.concatenate((self.jacobian(state) * weights[:, None], np.diag(self._damping)))
        target = np.concatenate((twists_w.reshape(-1) * weights, self._damping * posture_qvel))
        qpos = self.qpos(state)
        lower = np.maximum(-self.max_speed, (self._limits[:, 0] - qpos) / state.step_s)
        upper = np.minimum(self.max_speed, (self._limits[:, 1] - qpos) / state.step_s)
        return bounded_least_squares(matrix, target, np.minimum(lower, 0.0), np.maximum(upper, 0.0))

    def pushing_velocities(self, state: RobotState, forces_w: np.ndarray) -> np.ndarray:
        """Return what to add to joint velocities so that hands that are held up push with given forces.

        A drive's torque is its damping times the velocity that is missing; so the arms' joints are asked for J' F
        over the damping more. Forces that cancel leave the trunk alone.

        Args:
            state: of one environment.
            forces_w: (A, 3) of each hand on what it touches, N, world frame.

        Returns:
            (n,) velocities, 0 for the trunk.
        """
        linear = self.jacobian(state).reshape(len(self._arms), 6, -1)[:, :3]  # (A, 3, n)
        push = np.einsum("ain,ai->n", linear, forces_w) / self._drive_damping
        push[:TRUNK] = 0.0
        return push

    def to_action(self, state: RobotState, qvel: np.ndarray, finger_position_m: np.ndarray) -> np.ndarray:
        """Return the action that asks for joint velocities and finger positions.

        Args:
            state: of one environment.
            qvel: (n,) as `joint_velocities` returns them.
            finger_position_m: (A, 2) of each hand's fingers, 0 (closed) to 0.04.

        Returns:
            (R,) action; joints of an arm that is not moved rest, its fingers stay where they are.
        """
        targets = np.zeros_like(self.scale.center)
        targets[-_FINGERS:] = state.robot_qpos[0, -_FINGERS:]
        targets[self.columns] = qvel
        targets[:TRUNK] = in_base_axes(state, qvel[:TRUNK])
        targets[self.finger_columns] = finger_position_m
        return self.scale.to_actions(targets)

    def closing_m(self, state: RobotState, speed_m_s: float) -> np.ndarray:
        """Return positions to ask the fingers for that close them at this speed, (A, 2), with B = 1."""
        fingers = state.robot_qpos[0, self.finger_columns]
        return np.maximum(fingers - speed_m_s * state.step_s, 0.0)

    def jacobian(self, state: RobotState) -> np.ndarray:
        """Geometric Jacobian of the tools' centres, (6 A, n); of each, linear rows first."""
        found: np.ndarray = self.jacobians(state)[0]
        return found

    def jacobians(self, state: RobotState) -> np.ndarray:
        """Return those of B states, (B, 6 A, n)."""
        axis = state.robot_joint_axis_w[:, self.columns]
        anchor = state.robot_joint_anchor_w[:, self.columns]
        found = np.zeros((len(axis), self.num_joints, len(self._arms), 2, 3))
        for arm in range(len(self._arms)):
            linear, angular = cross(axis, state.tool_position_w[:, arm, None] - anchor, np), axis.copy()
            linear[:, _SLIDES], angular[:, _SLIDES] = axis[:, _SLIDES], 0.0
            for other in self._arms[:arm] + self._arms[arm + 1 :]:
                linear[:, other], angular[:, other] = 0.0, 0.0
            found[:, :, arm, 0], found[:, :, arm, 1] = linear, angular
        return found.reshape(len(axis), self.num_joints, -1).swapaxes(1, 2)


@dataclass(frozen=True, eq=False)
class CommandController:
    """Turns commands into actions.

    Attributes:
        whole_body: inverse kinematics of trunk and hands.
        arm_qpos_rad: posture of the arms that are moved, one after the other.
        close_speed_m_s: of a finger that closes slowly.
        rolls: whether the last joint of each arm is free to turn, rather than striving for its posture.
    """

    whole_body: WholeBodyController
    arm_qpos_rad: np.ndarray
    close_speed_m_s: float
    rolls: bool = False

    def action(self, state: RobotState, command: Command) -> np.ndarray:
        """Return the action, (R,) in [-1, 1], of the control mode `joint`."""
        body = self.whole_body
        qvel = body.joint_velocities(state, self._twists_w(state, command), self._posture_qvel(state, command))
        if command.press_n:
            qvel = qvel + body.pushing_velocities(state, self._forces_w(state, command.press_n))
        closing = body.closing_m(state, self.close_speed_m_s)
        fingers = np.select(
            [command.grip[:, None] == Grip.OPEN, command.grip[:, None] == Grip.CLOSING],
            [np.repeat(command.width_m[:, None], 2, axis=1), closing],
            0.0,
        )
        return body.to_action(state, qvel, fingers)

    def posture_twists(self, state: RobotState, command: Command) -> np.ndarray:
        """Return the twists (A, 6), in the hands' axes, of a robot that only followed its posture."""
        body = self.whole_body
        qvel = np.clip(self._posture_qvel(state, command), -body.max_speed, body.max_speed)
        return in_hand_axes(state, (body.jacobian(state) @ qvel).reshape(-1, 6))

    @staticmethod
    def _twists_w(state: RobotState, command: Command) -> np.ndarray:
        turn = state.tool_rotation_w[0, : len(command.twists)]  # (A, 3, 3)
        halves = command.twists.reshape(-1, 2, 3)
        turned: np.ndarray = np.einsum("aij,akj->aki", turn, halves).reshape(-1, 6)
        return turned

    def _posture_qvel(self, state: RobotState, command: Command) -> np.ndarray:
        """Return (n,) preferred joint velocities, base x and y along the world's axes."""
        qpos = self.whole_body.qpos(state)
        trunk = in_world_axes(state, command.trunk_qvel)
        arms = command.arm_gain_s * (self.arm_qpos_rad - qpos[TRUNK:])
        if self.rolls:
            arms[self.whole_body.arm_joints - 1 :: self.whole_body.arm_joints] = 0.0
        return np.concatenate((trunk, arms))

    @staticmethod
    def _forces_w(state: RobotState, press_n: float) -> np.ndarray:
        """Return (2, 3) forces of both hands towards each other, level."""
        way = state.tool_position_w[0, 1] - state.tool_position_w[0, 0]
        way = np.array((way[0], way[1], 0.0))
        force = press_n * way / max(float(np.linalg.norm(way)), 1e-6)
        return np.stack((force, -force))


def bounded_least_squares(
    matrix: np.ndarray, target: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Least squares within a box, by an active set: violated bounds join it, needless ones leave."""
    gram, rhs = matrix.T @ matrix, matrix.T @ target
    x = np.zeros(matrix.shape[1])
    free = np.ones(len(x), dtype=bool)
    for _ in range(3 * len(x)):
        if free.any():
            bound = rhs[free] - gram[np.ix_(free, ~free)] @ x[~free]
            x[free] = np.linalg.solve(gram[np.ix_(free, free)], bound)
        outside = free & ((x < lower - 1e-9) | (x > upper + 1e-9))
        x = np.clip(x, lower, upper)
        if outside.any():
            free &= ~outside
            continue
        slope = gram @ x - rhs
        inwards = np.where(free | (lower == upper), 0.0, np.where(x <= lower, -slope, slope))
        worst = int(np.argmax(inwards))
        if inwards[worst] <= 1e-9:
            break
        free[worst] = True
    return x
