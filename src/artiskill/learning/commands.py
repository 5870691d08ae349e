"""Commands as numbers that a network can give, and a command's way from there to an action.

A policy that learns commands (`artiskill.experts.whole_body`) gives several of them, and says which it is: one for
each phase of the work, and, of a single hand, for each way that the hand may roll, as handles can be gripped in
several rolls. The likeliest one acts; a regression would act by their mean, which leads nowhere. NumPy, or torch
where arrays are tensors; imports no torch.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from artiskill.config import check_positive, check_value, check_vector, from_mapping, merge_overrides, to_mapping
from artiskill.errors import PolicyError
from artiskill.experts.registry import make_expert
from artiskill.experts.whole_body import (
    TRUNK,
    Command,
    CommandController,
    Grip,
    WholeBodyConfig,
    WholeBodyController,
    in_hand_axes,
    in_world_axes,
)
from artiskill.robots.config import RobotConfig
from artiskill.robots.kinematics import RobotKinematics, RobotPose
from artiskill.tasks.task import Task

GRIPS = len(Grip)
GRIP_PHASES = tuple(grip.name.lower() for grip in Grip)  # where no expert says which phase it is in
_TWIST = 6
# what counts as 1 in a vector; typical, not the most
_LINEAR_M_S, _ANGULAR_RAD_S, _TRUNK_M_S, _GAIN_S, _PRESS_N, _WIDTH_M = 0.8, 3.0, 0.6, 2.0, 50.0, 0.02
_ROLL, _ROLLS, _SLOW_ROLL = 5, 3, 0.3  # place of the hand's roll in a motion; hardly, one way, the other; when
_SHUT_M = 5e-4  # positions of fingers that are nearer are the same
_MOST = 1.5  # of these: motions beyond are asked for nowhere, and a network need not tell how far


class CommandParts(NamedTuple):
    """The numbers of one kind of command; arrays or tensors."""

    motion: Any  # (B, M)
    width: Any  # (B, A)
    grip: Any  # (B, A, 3) logits


@dataclass(frozen=True)
class CommandSpace:
    """All that is needed to turn numbers into commands, and commands into actions."""

    robot: RobotConfig
    step_s: float  # duration of one environment step
    phases: tuple[str, ...]  # of the expert
    arms: int  # that are moved
    whole_body: WholeBodyConfig
    arm_qpos_rad: tuple[float, ...]  # posture of the arms that are moved
    close_speed_m_s: float  # of a finger that closes slowly
    rolls: bool  # whether the last joint of each arm is free to turn
    one_kind: bool = False  # kinds are not told apart: there is one

    def __post_init__(self) -> None:
        check_positive(self, "step_s", "close_speed_m_s", "arms")
        most = len(self.robot.mounts)
        check_value(self, "arms", self.arms <= most, f"must be at most {most}, those of the robot")
        check_vector(self, "arm_qpos_rad", size=self.arms * len(self.robot.initial.arm_qpos_rad))

    @property
    def motion_size(self) -> int:
        """How many numbers say how trunk and hands move: M."""
        return _TWIST * self.arms + TRUNK + 1 + (self.arms > 1)

    @property
    def kinds(self) -> int:
        """How many kinds of commands are told apart: phases, times ways to roll a single hand; or one."""
        return 1 if self.one_kind else len(self.phases) * self._rolls

    @property
    def _rolls(self) -> int:
        return _ROLLS if self.arms == 1 else 1

    @property
    def label_size(self) -> int:
        """How many numbers a command is: motion, widths, grips, kind."""
        return self.motion_size + 2 * self.arms + 1

    @property
    def output_size(self) -> int:
        """How many numbers a network gives: a logit and `CommandParts` for each kind."""
        return self.kinds * (1 + self.motion_size + (1 + GRIPS) * self.arms)

    @cached_property
    def _units(self) -> np.ndarray:
        """Return what counts as 1 in a motion, (M,)."""
        twist = [_LINEAR_M_S] * 3 + [_ANGULAR_RAD_S] * 3
        press = [_PRESS_N] if self.arms > 1 else []
        return np.array(twist * self.arms + [_TRUNK_M_S] * TRUNK + [_GAIN_S] + press)

    def encode(self, command: Command) -> np.ndarray:
        """Return a command as numbers, (`label_size`,) float32."""
        press = [command.press_n] if self.arms > 1 else []
        motion = (command.twists.reshape(-1), command.trunk_qvel, [command.arm_gain_s], press)
        scaled = np.concatenate(motion) / self._units
        width = np.asarray(command.width_m) / _WIDTH_M - 1.0
        kind = self._kind(np.array(command.phase), scaled)
        parts = (np.clip(scaled, -_MOST, _MOST), width, command.grip, [kind])
        return np.concatenate(parts).astype(np.float32)

    def _kind(self, phase: np.ndarray, scaled: np.ndarray) -> np.ndarray:
        """Return the kinds (...) of commands of these phases (...) with motions (..., M)."""
        if self.one_kind:
            return np.zeros_like(phase)
        if self.arms > 1:
            return phase
        roll = scaled[..., _ROLL]
        return phase * _ROLLS + np.where(np.abs(roll) < _SLOW_ROLL, 0, 1 + (roll < 0))

    def motions(self, labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the twists (B, 6 A) and the velocities of the trunk (B, 4) of commands (B, `label_size`)."""
        values = labels[:, : self.motion_size].astype(np.float64) * self._units
        return values[:, : _TWIST * self.arms], values[:, _TWIST * self.arms : _TWIST * self.arms + TRUNK]

    def with_motions(self, labels: np.ndarray, twists: np.ndarray, trunk_qvel: np.ndarray) -> np.ndarray:
        """Return commands (B, `label_size`) with other twists (B, 6 A) and velocities of the trunk (B, 4)."""
        found = labels.copy()
        motion = np.concatenate((twists, trunk_qvel), axis=1)
        scaled = motion / self._units[: motion.shape[1]]
        found[:, : motion.shape[1]] = np.clip(scaled, -_MOST, _MOST)
        found[:, -1] = self._kind(labels[:, -1] // self._rolls, scaled)
        return found

    def decode(self, label: np.ndarray) -> Command:
        """Return the command that numbers (`label_size`,) say; their grips and kind are whole."""
        m, a = self.motion_size, self.arms
        values = np.asarray(label, dtype=np.float64)
        motion = values[:m] * self._units
        return Command(
            phase=int(values[-1]) // self._rolls,
            twists=motion[: _TWIST * a].reshape(a, _TWIST),
            trunk_qvel=motion[_TWIST * a : _TWIST * a + TRUNK],
            arm_gain_s=max(0.0, float(motion[_TWIST * a + TRUNK])),
            grip=values[m + a : m + 2 * a].astype(np.int64),
            width_m=(values[m : m + a] + 1.0) * _WIDTH_M,
            press_n=max(0.0, float(motion[-1])) if a > 1 else 0.0,
        )

    def parts(self, outputs: Any, kind: Any) -> CommandParts:
        """Return the numbers of one kind, (B,) whole, of each row of a network's outputs (B, `output_size`)."""
        m, a, p = self.motion_size, self.arms, self.kinds
        each = outputs[:, p:].reshape(len(outputs), p, -1)
        chosen = each[range(len(outputs)), kind]
        return CommandParts(chosen[:, :m], chosen[:, m : m + a], chosen[:, m + a :].reshape(-1, a, GRIPS))

    def logits(self, outputs: Any) -> Any:
        """Return those of kinds, (B, K), of a network's outputs."""
        return outputs[:, : self.kinds]

    def likeliest(self, outputs: np.ndarray) -> np.ndarray:
        """Return the commands (B, `label_size`) of the likeliest kinds of a network's outputs."""
        return self.of_kinds(outputs, self.logits(outputs).argmax(1))

    def of_kinds(self, outputs: np.ndarray, kind: np.ndarray) -> np.ndarray:
        """Return the commands (B, `label_size`) of these kinds, (B,) whole, of a network's outputs."""
        found = self.parts(outputs, kind)
        return np.concatenate((found.motion, found.width, found.grip.argmax(2), kind[:, None]), axis=1)


class CommandActor:
    """Carries commands out by the robot's proprioception alone.

    Args:
        space: of the commands.

    Attributes:
        space: likewise.
        kinematics: of the robot.
    """

    def __init__(self, space: CommandSpace) -> None:
        self.space = space
        body = WholeBodyController(space.robot, space.whole_body, space.arms)
        posture = np.array(space.arm_qpos_rad)
        self._controller = CommandController(body, posture, space.close_speed_m_s, space.rolls)
        self.kinematics = RobotKinematics(space.robot)

    def place_w(self, agent: np.ndarray) -> np.ndarray:
        """Return where hands (x, y, z each) and base (x, y) of a robot (S,) are in the world, (3 A + 2,) m."""
        pose = self._pose(agent)
        return np.concatenate((pose.tool_position_w[0].ravel(), pose.robot_qpos[0, :2]))

    def action(self, agent: np.ndarray, label: np.ndarray) -> np.ndarray:
        """Return the action (R,), in the control mode `joint`, of a robot (S,) that is asked for a command."""
        return self._controller.action(self._pose(agent), self.space.decode(label))

    def _pose(self, agent: np.ndarray) -> RobotPose:
        return self.kinematics.pose(np.asarray(agent, dtype=np.float64)[None], self.space.step_s)


class ActionReader:
    """Tells which commands actions amount to; what an action cannot tell is 0, or the same for all.

    Kinds are what the first hand's fingers do, a force that hands press with is a motion towards each other, and
    what the arms strive for beside the hands' motion is not seen.

    Args:
        space: of the commands; its phases are those of `GRIP_PHASES`.
        arm_gain_s: of every command, 1/s.
    """

    def __init__(self, space: CommandSpace, arm_gain_s: float) -> None:
        self._space, self._arm_gain_s = space, arm_gain_s
        self._body = WholeBodyController(space.robot, space.whole_body, space.arms)
        self._kinematics = RobotKinematics(space.robot)

    def labels(self, agents: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """Return the commands (B, `label_size`) of actions (B, R), of mode `joint`, of robots (B, S)."""
        given = np.asarray(agents, dtype=np.float64)
        targets = self._body.scale.to_targets(np.asarray(actions, dtype=np.float64))
        poses = (self._kinematics.pose(given[row : row + 1], self._space.step_s) for row in range(len(given)))
        commands = (self._command(pose, target) for pose, target in zip(poses, targets, strict=True))
        return np.stack([self._space.encode(command) for command in commands])

    def _command(self, pose: RobotPose, targets: np.ndarray) -> Command:
        body, space = self._body, self._space
        qvel = targets[body.columns]
        trunk = qvel[:TRUNK].copy()  # base x and y along the base's axes, as targets have them
        qvel[:TRUNK] = in_world_axes(pose, trunk)
        fingers = targets[body.finger_columns]  # (A, 2) m
        closing = body.closing_m(pose, space.close_speed_m_s)
        grip = np.select(
            [fingers.max(axis=1) < _SHUT_M, np.abs(fingers - closing).max(axis=1) < _SHUT_M],
            [Grip.SHUT, Grip.CLOSING],
            Grip.OPEN,
        )
        return Command(
            phase=int(grip[0]),
            twists=in_hand_axes(pose, (body.jacobian(pose) @ qvel).reshape(-1, _TWIST)),
            trunk_qvel=trunk,
            arm_gain_s=self._arm_gain_s,
            grip=grip,
            width_m=fingers.mean(axis=1),
        )


def commanding_expert(task: Task, values: Mapping[str, Any]) -> Any:
    """Return the expert of a task, which says what it commands in any state, with some values changed.

    Raises:
        PolicyError: the task has no expert, or one that only acts.
        ConfigError: an unknown or illegal value.
    """
    expert: Any = make_expert(task.name, task.robot)
    missing = [name for name in ("command", "controller", "phases") if not hasattr(expert, name)]
    if missing:
        raise PolicyError(f"the expert of {task.name} gives no commands: it has no {missing[0]!r}")
    config = merge_overrides(to_mapping(expert.config), values)
    return make_expert(task.name, task.robot, from_mapping(type(expert.config), config, "algorithm.expert"))


def command_space(
    task: Task, controller: CommandController, phases: Sequence[str], one_kind: bool = False
) -> CommandSpace:
    """Return the space of a task's commands, of all kinds or of one."""
    body = controller.whole_body
    return CommandSpace(
        robot=task.robot,
        step_s=task.config.physics.step_s,
        phases=tuple(phases),
        arms=(body.num_joints - TRUNK) // body.arm_joints,
        whole_body=body.config,
        arm_qpos_rad=tuple(controller.arm_qpos_rad.tolist()),
        close_speed_m_s=controller.close_speed_m_s,
        rolls=controller.rolls,
        one_kind=one_kind,
    )
