"""Commands to the whole robot, and how they become actions: base, lift and arms follow twists of the hands.

That is differential inverse kinematics, a damped least-squares problem with bounds: follow the twists, prefer a
posture, stay within velocity and position limits. Carrying a command out takes the robot's own state and nothing
else. So a policy can learn commands from an expert and act without any privilege.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Protocol

import numpy as np

from artiskill.config import check_not_negative, check_positive
from artiskill.envs.control import ActionScale, action_scale
from artiskill.geometry.arrays import Array, norm, small_product
from artiskill.geometry.kernel import allocating_kernel, kernel
from artiskill.robots.arm_config import load_arm
from artiskill.robots.config import RobotConfig
from artiskill.robots.operational_space import solve

TRUNK = 4  # base x, y and yaw; then the lift; then the arms' joints
_BASE = 3
_FINGERS = 2
_LIFT = 3
_TOLERANCE = 1e-9  # of bounds, and of what to leave one is worth


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
    turned: np.ndarray = small_product(twists_w.reshape(-1, 2, 3), turn).reshape(-1, 6)
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
        self._arms = arms
        inside = np.array((config.limit_margin_rad, -config.limit_margin_rad))
        ranges = np.array([joint.range_rad for joint in arm.joints]) + inside
        free = np.array([(-np.inf, np.inf)] * _BASE)
        self._limits = np.concatenate((free, [robot.lift.range_m], *[ranges] * arms))  # (n, 2)
        self.max_speed = self.scale.half_range[self.columns]
        trunk = [config.base_damping] * 2 + [config.yaw_damping, config.lift_damping]
        self._damping = np.array(trunk + [config.arm_damping] * (arms * self.arm_joints))
        self._weights = np.tile(np.repeat((1.0, config.rotation_weight_m), 3), arms)  # of twists
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
        matrix = np.concatenate((self.jacobian(state) * self._weights[:, None], np.diag(self._damping)))
        target = np.concatenate((twists_w.reshape(-1) * self._weights, self._damping * posture_qvel))
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
        linear = self.jacobian(state).reshape(self._arms, 6, -1)[:, :3]  # (A, 3, n)
        push = small_product(forces_w.reshape(-1), linear.reshape(forces_w.size, -1)) / self._drive_damping
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

    def twists_w(self, state: RobotState, qvel: np.ndarray) -> np.ndarray:
        """Return the twists (A, 6) of the hands, world frame, that joint velocities (n,) make."""
        return small_product(self.jacobian(state), qvel).reshape(self._arms, 6)

    def jacobian(self, state: RobotState) -> np.ndarray:
        """Geometric Jacobian of the tools' centres, (6 A, n); of each, linear rows first."""
        found: np.ndarray = self.jacobians(state)[0]
        return found

    def jacobians(self, state: RobotState) -> np.ndarray:
        """Return those of B states, (B, 6 A, n)."""
        axis = np.take(state.robot_joint_axis_w, self.columns, axis=1)
        anchor = np.take(state.robot_joint_anchor_w, self.columns, axis=1)
        tool = state.tool_position_w[:, : self._arms]
        found = np.zeros((len(axis), self._arms, 6, self.num_joints))
        _fill_jacobians(axis, anchor, np.ascontiguousarray(tool), found)
        return found.reshape(len(axis), -1, self.num_joints)


@kernel
def _fill_jacobians(axis: Any, anchor: Any, tool: Any, out: Any) -> None:
    """Of joints (B, n, 3) and tools (B, A, 3), into zeros (B, A, 6, n); the trunk comes first, then each arm."""
    own = (axis.shape[1] - TRUNK) // tool.shape[1]
    for b in range(axis.shape[0]):
        for n in range(axis.shape[1]):
            x, y, z = axis[b, n, 0], axis[b, n, 1], axis[b, n, 2]
            for arm in range(tool.shape[1]):
                if n >= TRUNK and (n - TRUNK) // own != arm:
                    continue
                linear, angular = out[b, arm, :3], out[b, arm, 3:]
                if n in (0, 1, _LIFT):
                    linear[0, n], linear[1, n], linear[2, n] = x, y, z
                    continue
                lever_x, lever_y = tool[b, arm, 0] - anchor[b, n, 0], tool[b, arm, 1] - anchor[b, n, 1]
                lever_z = tool[b, arm, 2] - anchor[b, n, 2]
                linear[0, n] = y * lever_z - z * lever_y
                linear[1, n] = z * lever_x - x * lever_z
                linear[2, n] = x * lever_y - y * lever_x
                angular[0, n], angular[1, n], angular[2, n] = x, y, z


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
        grip = command.grip[:, None]
        fingers = np.where(
            grip == Grip.OPEN, command.width_m[:, None], np.where(grip == Grip.CLOSING, closing, 0.0)
        )
        return body.to_action(state, qvel, fingers)

    def posture_twists(self, state: RobotState, command: Command) -> np.ndarray:
        """Return the twists (A, 6), in the hands' axes, of a robot that only followed its posture."""
        body = self.whole_body
        qvel = np.clip(self._posture_qvel(state, command), -body.max_speed, body.max_speed)
        return in_hand_axes(state, body.twists_w(state, qvel))

    @staticmethod
    def _twists_w(state: RobotState, command: Command) -> np.ndarray:
        turn = state.tool_rotation_w[0, : len(command.twists)]  # (A, 3, 3)
        halves = command.twists.reshape(-1, 2, 3)
        turned: np.ndarray = small_product(halves, turn.swapaxes(1, 2)).reshape(-1, 6)
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
        force = press_n * way / max(float(norm(way)), 1e-6)
        return np.stack((force, -force))


def bounded_least_squares(
    matrix: np.ndarray, target: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Least squares within a box, by an active set: violated bounds join it, needless ones leave.

    Args:
        matrix: (m, n) of full rank.
        target: (m,).
        lower: (n,).
        upper: (n,) at least `lower`.

    Returns:
        (n,); nan where something given is.
    """
    x = np.zeros(matrix.shape[1])
    _solve_within(np.ascontiguousarray(matrix), target, lower, upper, x)
    return x


@allocating_kernel
def _solve_within(matrix: Any, target: Any, lower: Any, upper: Any, x: Any) -> None:
    """Do what `bounded_least_squares` does; not by LAPACK, whose last bits depend on the processor."""
    n = len(x)
    gram, rhs = np.zeros((n, n)), np.zeros(n)
    for r in range(len(target)):
        for i in range(n):
            if matrix[r, i] != 0.0:
                rhs[i] += matrix[r, i] * target[r]
                for j in range(n):
                    gram[i, j] += matrix[r, i] * matrix[r, j]
    free = np.ones(n, dtype=np.bool_)
    for _ in range(3 * n):
        _solve_free(gram, rhs, free, x)
        if _join_bounds(free, x, lower, upper):
            continue
        worst = _bound_to_leave(gram, rhs, free, x, lower, upper)
        if worst < 0:
            break
        free[worst] = True


@kernel
def _join_bounds(free: Any, x: Any, lower: Any, upper: Any) -> Any:
    """Limit x, of which what was beyond its bounds is free no longer; return whether there was any."""
    have_joined = False
    for i in range(len(x)):
        if free[i] and (x[i] < lower[i] - _TOLERANCE or x[i] > upper[i] + _TOLERANCE):
            free[i], have_joined = False, True
        if x[i] < lower[i]:  # a nan stays one
            x[i] = lower[i]
        elif x[i] > upper[i]:
            x[i] = upper[i]
    return have_joined


@kernel
def _bound_to_leave(gram: Any, rhs: Any, free: Any, x: Any, lower: Any, upper: Any) -> Any:
    """Return which bound it is worth most to leave; -1: none."""
    worst, most = -1, _TOLERANCE
    for i in range(len(x)):
        if free[i] or lower[i] == upper[i]:
            continue
        slope = -rhs[i]
        for j in range(len(x)):
            slope += gram[i, j] * x[j]
        inwards = -slope if x[i] <= lower[i] else slope
        if inwards > most:
            worst, most = i, inwards
    return worst


@allocating_kernel
def _solve_free(gram: Any, rhs: Any, free: Any, x: Any) -> None:
    """Set the free ones of x (n,) so that gram x = rhs, with all others as they are."""
    chosen = np.flatnonzero(free)
    matrix, right = np.empty((len(chosen), len(chosen))), np.empty(len(chosen))
    for a in range(len(chosen)):
        i = chosen[a]
        right[a] = rhs[i]
        for j in range(len(x)):
            if not free[j]:
                right[a] -= gram[i, j] * x[j]
        for b in range(len(chosen)):
            matrix[a, b] = gram[i, chosen[b]]
    solve(matrix, right)
    for a in range(len(chosen)):
        x[chosen[a]] = right[a]
