"""The expert of PushChair: grip the chair low, by its column or by two legs, and carry it along with the base.

A hand that has closed around an upright column can push, pull, steer and brake, whatever stands on it. A chair
on casters follows, one that slides too; the pull is low, so that nothing tips. The other hand stays near.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from artiskill.config import CONFIG_DIR, load_config
from artiskill.experts.frames import Frame, curved, limited, rotation_error, yaw_rotation
from artiskill.experts.push_chair_plan import (
    RIGHT,
    GripPlan,
    PushChairExpertConfig,
    hand_rotation,
    make_plan,
    steered,
    to_base_frame,
    to_world_frame,
)
from artiskill.experts.whole_body import TRUNK, WholeBodyController
from artiskill.robots.config import RobotConfig
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.push_chair import ChairGoal

_ARMS = 2
# What makes the left arm the right one's mirror image, but for the hand, which is turned by half a turn about its
# own axis (the same for the fingers): the last joint is symmetric about pi / 4.
_MIRROR = np.array((-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0))
_HALF_TURN = np.array((0.0,) * 6 + (math.pi / 2,))


class ChairPhase(Enum):
    """What the robot is doing."""

    CARRY = "carry"  # drives to its side of the chair, the hands low and apart
    ALIGN = "align"
    REACH = "reach"
    RETREAT = "retreat"  # straight back, after a hand strayed
    GRIP = "grip"
    DRIVE = "drive"
    HOLD = "hold"  # brakes, and stays as it is


@dataclass(frozen=True, eq=False)
class _Aim:
    """The plan at this instant, in the world.

    Attributes:
        hands: per hand, the pose in which it grips.
        base_xy: (2,) where the base belongs.
        heading_rad: which way it faces there.
        center_xy: (2,) what it would drive around.
    """

    hands: tuple[Frame, Frame]
    base_xy: np.ndarray
    heading_rad: float
    center_xy: np.ndarray


class PushChairExpert:
    """Takes a chair to its target by a grip on its columns.

    Args:
        robot: who acts; it has two arms.
        config: values; by default those that come with the package.
    """

    def __init__(self, robot: RobotConfig, config: PushChairExpertConfig | None = None) -> None:
        self.config = config or load_config(PushChairExpertConfig, CONFIG_DIR / "experts" / "push_chair.yaml")
        self.controller = WholeBodyController(robot, self.config.whole_body, _ARMS)
        right = np.asarray(self.config.arm_rad)
        self._arms = np.concatenate((right, _MIRROR * right - _HALF_TURN))
        self._open = float(2 * self.controller.scale.half_range[-1])
        self.phase = ChairPhase.CARRY
        self._steps_in_phase = 0
        self._velocity = np.zeros(2)
        self._held: list[Frame] = []
        self._plan: GripPlan | None = None

    def reset(self, snapshot: Snapshot, goal: ChairGoal) -> None:
        """Begin an episode at its first state (B = 1)."""
        self.phase, self._steps_in_phase = ChairPhase.CARRY, 0
        self._velocity = np.zeros(2)
        self._plan = make_plan(snapshot, goal, self.config)

    def act(self, snapshot: Snapshot, goal: ChairGoal) -> np.ndarray:
        """Return the next action, (R,) in [-1, 1]."""
        assert self._plan is not None
        if self.phase is ChairPhase.DRIVE and self._steers:
            self._plan = steered(self._plan, snapshot, self.config)
        aim = self._aim(snapshot, self._plan)
        self._advance_phase(snapshot, aim, self._plan)
        if self._is_in_vain(snapshot, aim):
            aim = self._try_anew(snapshot, goal)
        trunk = self._trunk_velocity(snapshot, aim)
        twists = np.stack([self._twist(snapshot, aim, hand, trunk) for hand in range(_ARMS)])
        gain = self.config.arm_gain_s if len(self._hands) == 1 else self.config.pair_arm_gain_s
        if self.phase in (ChairPhase.DRIVE, ChairPhase.HOLD):
            gain = 0.0
        arms = gain * (self._arms - self.controller.qpos(snapshot)[TRUNK:])
        qvel = self.controller.joint_velocities(snapshot, twists, np.concatenate((trunk, arms)))
        return self.controller.to_action(snapshot, qvel, self._fingers(snapshot))

    def _fingers(self, snapshot: Snapshot) -> np.ndarray:
        """Return positions that the fingers of both hands are asked for, (2, 2)."""
        fingers, hands = np.full((_ARMS, 2), self._open), list(self._hands)
        if self.phase is ChairPhase.GRIP:
            fingers[hands] = self.controller.closing_m(snapshot, self.config.close_speed_m_s)[hands]
        elif self.phase in (ChairPhase.DRIVE, ChairPhase.HOLD):
            fingers[hands] = 0.0
        return fingers

    def _is_in_vain(self, snapshot: Snapshot, aim: _Aim) -> bool:
        """Return whether it has been reaching for long, or is back from where a hand strayed to."""
        if self.phase not in (ChairPhase.REACH, ChairPhase.RETREAT):
            return False
        nearest = min(float(self._gap(snapshot, aim, hand)[2]) for hand in self._hands)
        is_back = self.phase is ChairPhase.RETREAT and nearest > self.config.standoff_m
        return is_back or self._steps_in_phase >= self.config.reach_steps

    def _try_anew(self, snapshot: Snapshot, goal: ChairGoal) -> _Aim:
        """Something is in the way: begin again where it is now, with the usual hold of that side."""
        self.phase, self._steps_in_phase = ChairPhase.CARRY, 0
        self._plan = make_plan(snapshot, goal, replace(self.config, oblique_rad=0.0, grip_height_share=0.0))
        return self._aim(snapshot, self._plan)

    def _aim(self, snapshot: Snapshot, plan: GripPlan) -> _Aim:
        rotation, position = snapshot.link_rotation_w[0, 0], snapshot.link_position_w[0, 0]
        points = position + plan.points @ rotation.T
        side = plan.side_rad
        if len(plan.hands) == _ARMS:
            side += math.atan2(rotation[1, 0], rotation[0, 0])
        outward = np.array((math.cos(side), math.sin(side)))
        heading = side + math.pi
        toe_in, pitch = self.config.toe_in_rad, self.config.pitch_rad
        if len(plan.hands) == _ARMS:
            toe_in, pitch = self.config.pair_toe_in_rad, 0.0
        hands = []
        for hand in range(_ARMS):
            yaw = heading + (toe_in if hand == RIGHT else -toe_in)
            hands.append(Frame(points[hand], hand_rotation(yaw, pitch, hand)))
        middle = points[:, :2].mean(axis=0)
        base = middle + self.config.base_distance_m * outward
        return _Aim((hands[0], hands[1]), base, heading, position[:2])

    def _advance_phase(self, snapshot: Snapshot, aim: _Aim, plan: GripPlan) -> None:
        before, config = self.phase, self.config
        gaps = [self._gap(snapshot, aim, hand) for hand in plan.hands]  # in the hands' frames
        turns = [self._turn(snapshot, aim, hand) for hand in plan.hands]
        aside = max(float(np.abs(gap[1])) for gap in gaps)
        ahead = max(float(np.abs(gap[2])) for gap in gaps)
        if before is ChairPhase.CARRY:
            self.phase = ChairPhase.ALIGN if self._carried(snapshot, aim) else before
        elif before is ChairPhase.ALIGN:
            patience = 1 + self._steps_in_phase / config.patience_steps
            away = max(float(np.linalg.norm(gap - (0, 0, config.standoff_m))) for gap in gaps)
            ready = away < patience * config.aligned_m and max(turns) < patience * config.aligned_rad
            self.phase = ChairPhase.REACH if ready else before
        elif before is ChairPhase.REACH and ahead < config.grip_m and aside < config.grip_m:
            self.phase = ChairPhase.GRIP
        elif before is ChairPhase.REACH and aside > config.stray_m:
            self.phase = ChairPhase.RETREAT
        elif before is ChairPhase.GRIP and self._steps_in_phase >= config.grip_steps:
            self.phase = ChairPhase.DRIVE
            self._held = [to_base_frame(snapshot, hand) for hand in range(_ARMS)]
        elif before in (ChairPhase.DRIVE, ChairPhase.HOLD):
            away = float(np.linalg.norm(snapshot.link_position_w[0, 0, :2]))
            self.phase = (
                ChairPhase.HOLD
                if away < (config.stop_m if before is ChairPhase.DRIVE else config.leave_m)
                else ChairPhase.DRIVE
            )
            if max(aside, ahead) > config.slip_m and self.phase is ChairPhase.DRIVE:
                self.phase, self._velocity = ChairPhase.ALIGN, np.zeros(2)
        self._steps_in_phase = self._steps_in_phase + 1 if self.phase is before else 0

    def _carried(self, snapshot: Snapshot, aim: _Aim) -> bool:
        low = max(
            abs(float(snapshot.tool_position_w[0, hand, 2] - aim.hands[hand].position[2])) for hand in range(_ARMS)
        )
        away = float(np.linalg.norm(aim.base_xy - snapshot.robot_qpos[0, :2]))
        return max(low, away) < self.config.carried_m

    @staticmethod
    def _gap(snapshot: Snapshot, aim: _Aim, hand: int) -> np.ndarray:
        """Return (3,): from the hand to its grip, in the axes of the grip."""
        grip = aim.hands[hand]
        return grip.rotation.T @ (grip.position - snapshot.tool_position_w[0, hand])

    @staticmethod
    def _turn(snapshot: Snapshot, aim: _Aim, hand: int) -> float:
        wanted = aim.hands[hand].rotation
        return float(np.linalg.norm(rotation_error(snapshot.tool_rotation_w[0, hand], wanted)))

    def _trunk_velocity(self, snapshot: Snapshot, aim: _Aim) -> np.ndarray:
        """Preferred velocities of base x, y, yaw and the lift, (4,)."""
        config, qpos = self.config, snapshot.robot_qpos[0, :TRUNK]
        place = self._way_around(snapshot, aim) if self.phase is ChairPhase.CARRY else aim.base_xy
        turn = math.remainder(self._facing(snapshot, aim) - qpos[2], math.tau)
        height = max(0.0, max(float(h.position[2]) for h in aim.hands) - config.shoulder_above_m)
        speed = self.controller.scale.half_range[:TRUNK]
        if self.phase is ChairPhase.HOLD:
            return np.concatenate((self._drive(snapshot), np.zeros(2)))
        velocity = limited(config.posture_gain_s * (place - qpos[:2]), config.base_speed_share * float(speed[0]))
        rest = np.clip(config.posture_gain_s * np.array((turn, height - qpos[3])), -speed[2:], speed[2:])
        if self.phase is ChairPhase.DRIVE:
            velocity = self._drive(snapshot)
            if self._steers:  # around the column, for the hand keeps its place
                x, y = qpos[:2] - aim.hands[self._hands[0]].position[:2]
                velocity = velocity + rest[0] * np.array((-y, x))
        return np.concatenate((velocity, rest))

    def _facing(self, snapshot: Snapshot, aim: _Aim) -> float:
        """Return where the base faces: as in its place; on the way around, not too far away from the chair."""
        if self.phase is not ChairPhase.CARRY:
            return aim.heading_rad
        way = aim.center_xy - snapshot.robot_qpos[0, :2]
        toward, most = math.atan2(way[1], way[0]), self.config.around_face_rad
        away = math.remainder(aim.heading_rad - toward, math.tau)
        return aim.heading_rad if abs(away) <= most else toward + math.copysign(most, away)

    def _way_around(self, snapshot: Snapshot, aim: _Aim) -> np.ndarray:
        """Return (2,): where the base drives next: on a circle around the chair until it is on its side."""
        here, there = snapshot.robot_qpos[0, :2] - aim.center_xy, aim.base_xy - aim.center_xy
        angle = math.atan2(here[1], here[0])
        left = math.remainder(math.atan2(there[1], there[0]) - angle, math.tau)
        if abs(left) < self.config.around_step_rad:
            return aim.base_xy
        angle += math.copysign(self.config.around_step_rad, left)
        return aim.center_xy + self.config.around_distance_m * np.array((math.cos(angle), math.sin(angle)))

    def _drive(self, snapshot: Snapshot) -> np.ndarray:
        """Return (2,): the chair's velocity: towards the target, slower near it."""
        config, step = self.config, self.config.drive_acceleration_m_s2 * snapshot.step_s
        chair = snapshot.link_position_w[0, 0, :2]
        wanted = limited(-config.drive_gain_s * chair, config.drive_speed_m_s)
        wanted = curved(wanted, config.curve_rad_m * float(np.linalg.norm(chair)))
        if self.phase is ChairPhase.HOLD:
            wanted = np.zeros(2)
        self._velocity = self._velocity + limited(wanted - self._velocity, step)
        return self._velocity

    def _twist(self, snapshot: Snapshot, aim: _Aim, hand: int, trunk: np.ndarray) -> np.ndarray:
        """Return the hand's velocity in this phase, (6,)."""
        config, tool = self.config, Frame(snapshot.tool_position_w[0, hand], snapshot.tool_rotation_w[0, hand])
        wanted, speed = aim.hands[hand], config.hand_speed_m_s
        feed = np.zeros(3)
        if self.phase is ChairPhase.CARRY:
            wanted = self._carry_frame(snapshot, aim, hand)
            feed = np.append(trunk[:2], 0.0)
        elif self.phase is ChairPhase.ALIGN or hand not in self._hands:
            away = config.standoff_m if hand in self._hands else config.idle_m
            wanted = Frame(wanted.position - away * wanted.forward, wanted.rotation)
        elif self.phase is ChairPhase.REACH:
            speed = config.reach_speed_m_s
        elif self.phase is ChairPhase.RETREAT:
            wanted = Frame(tool.position - config.standoff_m * tool.forward, wanted.rotation)
        if self.phase in (ChairPhase.DRIVE, ChairPhase.HOLD):
            feed = np.append(self._velocity, 0.0)
            wanted = to_world_frame(snapshot, self._held[hand])
        linear = feed + limited(config.position_gain_s * (wanted.position - tool.position), speed)
        turn = config.rotation_gain_s * rotation_error(tool.rotation, wanted.rotation)
        return np.concatenate((linear, limited(turn, config.turn_speed_rad_s)))

    @property
    def _hands(self) -> tuple[int, ...]:
        assert self._plan is not None
        return self._plan.hands

    @property
    def _steers(self) -> bool:
        return len(self._hands) == 1 and self.config.steer_rad_s > 0

    def _carry_frame(self, snapshot: Snapshot, aim: _Aim, hand: int) -> Frame:
        x, y, yaw = snapshot.robot_qpos[0, :3]
        forward, aside = self.config.carry_m
        offset = yaw_rotation(yaw) @ np.array((forward, -aside if hand == RIGHT else aside, 0.0))
        position = np.array((x, y, aim.hands[hand].position[2])) + offset
        turned = yaw_rotation(yaw - aim.heading_rad) @ aim.hands[hand].rotation
        return Frame(position, turned)
