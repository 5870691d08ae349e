"""The expert of PushChair: take the seat between two hands and push the chair with them to its target.

Hands that press the seat from both sides can push, pull, steer and brake, whatever stands below it.
"""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.config import CONFIG_DIR, check_inside, check_not_negative, check_positive, check_value, load_config
from artiskill.experts.frames import curved, limited, ramp, wrapped
from artiskill.experts.pressing import Body, PressingConfig, PressingHands
from artiskill.experts.walls import Press, wall_of
from artiskill.experts.whole_body import Command
from artiskill.geometry.arrays import norm, small_product
from artiskill.robots.config import RobotConfig
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.push_chair import ChairGoal

_HALF_THICKNESS_M = 0.004  # of what the hands aim for: about the middle of the seat's edge
_MOVES_M_S = (0.03, 0.1)  # speed from which a chair between the hands counts in no way, and fully, as held


@dataclass(frozen=True)
class SeatConfig:
    """Which places of a seat's edge are good."""

    side_rad: float  # the robot prefers to face so far aside of where the chair shall go, counter-clockwise
    side_weight: float  # cost of a radian from there; of n radians n^2 as much
    turn_weight: float  # likewise, by which the robot has to go around the chair
    front_weight: float  # likewise, by which it does not face the chair's front
    width_weight: float  # cost of a metre by which the seat is wider there than at its narrowest
    blocked_weight: float  # cost of a metre that fingertips would be from the seat, because of what the hand meets

    def __post_init__(self) -> None:
        check_inside("side_rad", self.side_rad, (-math.pi, math.pi))
        check_not_negative(self, "side_weight", "turn_weight", "front_weight", "width_weight", "blocked_weight")


@dataclass(frozen=True)
class PushChairExpertConfig:
    """Where to take the seat, how, and how to drive."""

    drive_speed_m_s: float  # of the chair, at most
    drive_gain_s: float  # its speed per distance from the target
    stop_m: float  # distance to the target at which it rests
    curve_rad_m: float  # the chair is driven this far aside of its target, per metre from it: in a curve
    seat: SeatConfig  # where to press
    hands: PressingConfig  # how

    def __post_init__(self) -> None:
        check_positive(self, "drive_speed_m_s", "drive_gain_s", "stop_m")
        check_value(self, "curve_rad_m", math.isfinite(self.curve_rad_m), "must be finite")


class PushChairExpert:
    """Takes a chair to its target by its seat.

    Args:
        robot: who acts, with two arms.
        config: values; by default those that come with the package.

    Attributes:
        controller: carries out its commands.
    """

    phases = ("approach", "close", "drive", "hold")

    def __init__(self, robot: RobotConfig, config: PushChairExpertConfig | None = None) -> None:
        self.config = config or load_config(PushChairExpertConfig, CONFIG_DIR / "experts" / "push_chair.yaml")
        self._hands = PressingHands(robot, self.config.hands)
        self.controller = self._hands.controller

    def reset(self, snapshot: Snapshot, goal: ChairGoal) -> None:
        """Begin an episode: nothing is remembered."""

    def act(self, snapshot: Snapshot, goal: ChairGoal) -> np.ndarray:
        """Return the action for a state (B = 1), (R,) in [-1, 1]."""
        return self.controller.action(snapshot, self.command(snapshot, goal))

    def command(self, snapshot: Snapshot, goal: ChairGoal) -> Command:
        """Return what the robot shall do in a state (B = 1)."""
        config, chair = self.config, snapshot.link_position_w[0, 0, :2]
        seat = seat_body(snapshot, goal, config.hands)
        view = self._hands.view(snapshot, seat, lambda: choose_press(snapshot, seat, config.seat))
        away = float(norm(chair))
        velocity = limited(-config.drive_gain_s * chair, config.drive_speed_m_s)
        velocity = curved(velocity, config.curve_rad_m * away) * ramp(away, 0.4 * config.stop_m, config.stop_m)
        phase = 0 if view.off > 0.3 else 1
        if view.carry > 0.5:
            phase = 2 if away > config.stop_m else 3
        return self._hands.command(snapshot, view, seat, np.array((*velocity, 0.0)), phase)


def seat_body(snapshot: Snapshot, goal: ChairGoal, hands: PressingConfig) -> Body:
    """Return the seat as it is now (B = 1)."""
    link = int(goal.seat_link[0])
    turn = snapshot.link_rotation_w[0, link]
    heights = np.array((-_HALF_THICKNESS_M, _HALF_THICKNESS_M))
    outline, hand_outline = np.repeat(goal.seat_outline[0, :, None], 2, axis=1)
    speed = float(norm(snapshot.root_velocity_w[0, :2]))
    return Body(
        position=snapshot.link_position_w[0, link] + small_product(turn, goal.seat_position[0]),
        rotation=small_product(turn, goal.seat_rotation[0]),
        wall=wall_of(heights, outline, hands.spread_m, hand_outline),
        held=ramp(speed, *_MOVES_M_S),
    )


def choose_press(snapshot: Snapshot, seat: Body, config: SeatConfig) -> Press:
    """Return the best pair of places for a robot that stands where it does (B = 1)."""
    wall, chair = seat.wall, snapshot.link_position_w[0, 0, :2]
    half = len(wall.directions_rad) // 2
    width = wall.reach_m[0] + np.roll(wall.reach_m[0], -half)
    yaw = math.atan2(seat.rotation[1, 0], seat.rotation[0, 0])
    heading = wall.directions_rad + yaw - np.pi / 2  # the robot's, with that to its left
    way = seat.position[:2] - snapshot.robot_qpos[0, :2]
    turn = np.abs(wrapped(heading - math.atan2(way[1], way[0])))
    aside = wrapped(heading - math.atan2(-chair[1], -chair[0]) - config.side_rad)
    front = wrapped(heading - yaw)  # a chair faces its -x
    cost = config.width_weight * (width - width.min()) + config.turn_weight * turn**2
    cost += config.blocked_weight * (wall.blocked_m[0] + np.roll(wall.blocked_m[0], -half))
    cost += config.side_weight * aside**2 + config.front_weight * front**2
    return wall.place(0, int(np.argmin(cost)))
