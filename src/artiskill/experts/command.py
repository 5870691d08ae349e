"""What an expert asks of the robot in one step, and how it becomes an action.

Carrying a command out takes the robot's own state and nothing else. So a policy can learn commands from an expert
and act without any privilege.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from artiskill.experts.whole_body import TRUNK, RobotState, WholeBodyController


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
        trunk = command.trunk_qvel.copy()
        cos, sin = np.cos(qpos[2]), np.sin(qpos[2])
        trunk[0] = cos * command.trunk_qvel[0] - sin * command.trunk_qvel[1]
        trunk[1] = sin * command.trunk_qvel[0] + cos * command.trunk_qvel[1]
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
