"""The expert of MoveBucket: press the bucket from two sides below its lip, lift it, carry it over the platform.

Where to press is chosen anew in every step, until the hands are there. Bail and ears stay untouched.
"""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.config import (
    CONFIG_DIR,
    check_inside,
    check_not_negative,
    check_positive,
    check_value,
    load_config,
)
from artiskill.experts.clearances import Cylinder
from artiskill.experts.frames import curved, limited, ramp, wrapped
from artiskill.experts.pressing import Body, PressingConfig, PressingHands, View
from artiskill.experts.walls import Press, Wall, wall_of
from artiskill.experts.whole_body import Command
from artiskill.geometry.arrays import arctan2, norm, small_product
from artiskill.robots.config import RobotConfig
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.grasp_candidates import OUTLINE_LEVELS
from artiskill.tasks.move_bucket import BucketGoal

_LIFTED_M = (0.01, 0.03)  # the bottom's height from which a bucket counts in no way, and fully, as held


@dataclass(frozen=True)
class PressConfig:
    """What makes a pair of places good."""

    # the robot prefers to stand so far aside of where it has the bucket between itself and the platform,
    # counter-clockwise
    side_rad: float
    side_weight: float  # cost of a radian from there; of n radians n^2 as much. 0: it goes the shortest way
    share: float  # best height, as a share of the body's
    least_height_m: float  # hands do not go lower, for the ground is there
    bail_clearance_m: float  # a bail at least this far above or below the hands is not in their way
    bail_band_m: float  # nor is one this far beside their axis
    turn_weight: float  # cost of a radian that the robot has to go around the bucket; of n radians n^2 as much
    width_weight: float  # cost of a metre by which the bucket is wider there than at its narrowest
    height_weight: float  # cost of a whole body's height of distance from the best height
    bail_weight: float  # cost of a metre that is missing to the bail's clearance
    platform_weight: float  # cost of a metre by which a hand that is above the platform, or near it, is too low
    platform_half_m: float  # half the width of the square that counts as such
    palm_m: float  # the palm is so far out from the place, and must not be above the platform either
    platform_clear_m: float  # height of a hand that is high enough
    platform_side_rad: float  # the robot stays beyond the bucket as seen from the platform, up to this far aside

    def __post_init__(self) -> None:
        check_inside("side_rad", self.side_rad, (-math.pi, math.pi))
        check_inside("share", self.share, (0, 1))
        check_not_negative(self, "least_height_m", "bail_clearance_m", "bail_band_m", "platform_side_rad")
        check_not_negative(self, "turn_weight", "side_weight", "width_weight", "height_weight", "bail_weight")
        check_not_negative(self, "platform_weight", "platform_half_m", "palm_m", "platform_clear_m")


@dataclass(frozen=True)
class MoveBucketExpertConfig:
    """Where to press, how, and how to carry."""

    carry_gain_s: float  # bucket velocity per distance to its goal
    lift_speed_m_s: float  # of the bucket, upwards
    carry_speed_m_s: float  # of the bucket, sideways
    rise_m: float  # how high the bucket is lifted
    clear_m: float  # it moves sideways once it is this high
    inner_distance_m: float  # how far from the platform's middle, on the robot's side, it is held
    aside_m: float  # how far from there to the robot's left
    curve_rad_m: float  # it is carried this far aside of that place, per metre from it: in a curve
    keeps_clear: bool  # where it is out of place, its hands and base keep clear of the bucket, hands of the robot
    press: PressConfig  # where to press
    hands: PressingConfig  # how

    def __post_init__(self) -> None:
        check_positive(self, "carry_gain_s", "lift_speed_m_s", "carry_speed_m_s", "rise_m", "clear_m")
        check_not_negative(self, "inner_distance_m")
        for name in ("aside_m", "curve_rad_m"):
            check_value(self, name, math.isfinite(getattr(self, name)), "must be finite")


class MoveBucketExpert:
    """Carries buckets pressed between two hands.

    Args:
        robot: who acts, with two arms.
        config: values; by default those that come with the package.

    Attributes:
        controller: carries out its commands.
    """

    phases = ("approach", "close", "lift", "carry")

    def __init__(self, robot: RobotConfig, config: MoveBucketExpertConfig | None = None) -> None:
        self.config = config or load_config(MoveBucketExpertConfig, CONFIG_DIR / "experts" / "move_bucket.yaml")
        self._hands = PressingHands(robot, self.config.hands)
        self.controller = self._hands.controller

    def reset(self, snapshot: Snapshot, goal: BucketGoal) -> None:
        """Begin an episode: nothing is remembered."""

    def act(self, snapshot: Snapshot, goal: BucketGoal) -> np.ndarray:
        """Return the action for a state (B = 1), (R,) in [-1, 1]."""
        return self.controller.action(snapshot, self.command(snapshot, goal))

    def command(self, snapshot: Snapshot, goal: BucketGoal) -> Command:
        """Return what the robot shall do in a state (B = 1)."""
        wall = bucket_wall(goal, self.config.hands.spread_m)
        position = snapshot.link_position_w[0, 0]
        body = Body(
            position,
            snapshot.link_rotation_w[0, 0],
            wall,
            held=ramp(position[2] + goal.box[0, 0, 2], *_LIFTED_M),
            around=_cylinder(position, goal) if self.config.keeps_clear else None,
        )
        view = self._hands.view(snapshot, body, lambda: choose_press(snapshot, goal, wall, self.config.press))
        phase = 0 if view.off > 0.3 else 1
        if view.carry > 0.5:
            phase = 3 if position[2] > self.config.clear_m else 2
        return self._hands.command(snapshot, view, body, self._velocity(position, view), phase)

    def _velocity(self, position: np.ndarray, view: View) -> np.ndarray:
        """Return the bucket's velocity (3,): up first, then to the platform's near side."""
        config = self.config
        way = (-config.inner_distance_m * view.heading + config.aside_m * view.axis - position)[:2]
        flat = limited(config.carry_gain_s * way, config.carry_speed_m_s)
        flat = curved(flat, config.curve_rad_m * float(norm(way)))
        flat = flat * ramp(position[2], 0.6 * config.clear_m, 1.6 * config.clear_m)
        up = config.carry_gain_s * (config.rise_m - position[2])
        return np.array((*flat, min(max(up, -config.lift_speed_m_s), config.lift_speed_m_s)))


def _cylinder(position_w: np.ndarray, goal: BucketGoal) -> Cylinder:
    """Return a cylinder around a goal's bucket (B = 1)."""
    return Cylinder(position_w, float(np.abs(goal.box[0, :, :2]).max()), float(goal.box[0, 1, 2]))


def bucket_wall(goal: BucketGoal, spread_m: float) -> Wall:
    """Return what hands of this half width can press of a goal's bucket (B = 1)."""
    return wall_of(goal.outline_height[0], goal.outline[0], spread_m)


def choose_press(snapshot: Snapshot, goal: BucketGoal, wall: Wall, config: PressConfig) -> Press:
    """Return the best pair of places for a robot that stands where it does (B = 1)."""
    half = len(wall.directions_rad) // 2
    width = wall.reach_m + np.roll(wall.reach_m, -half, axis=1)
    cost = config.width_weight * (width - width.min(axis=1, keepdims=True))
    cost += (config.height_weight * np.abs(np.array(OUTLINE_LEVELS) - config.share))[:, None]
    cost += np.where(wall.heights_m < config.least_height_m, 100.0, 0.0)[:, None]
    cost += _turn_cost(snapshot, wall.directions_rad, config)
    missing = config.bail_weight * _missing_clearance(snapshot, goal, wall, config)
    missing += config.platform_weight * _too_low(snapshot, wall, config)
    cost += missing + np.roll(missing, -half, axis=1)
    level, direction = np.unravel_index(int(np.argmin(cost)), cost.shape)
    return wall.place(int(level), int(direction))


def _turn_cost(snapshot: Snapshot, directions: np.ndarray, config: PressConfig) -> np.ndarray:
    """Return (D,): how far around the bucket the robot has to go, and whether the platform is in the way there."""
    bucket, base = snapshot.link_position_w[0, 0, :2], snapshot.robot_qpos[0, :2]
    x_axis = snapshot.link_rotation_w[0, 0, :2, 0]
    heading = directions + arctan2(x_axis[1], x_axis[0]) - np.pi / 2  # the robot's, with that to its left
    now, outwards = (arctan2(*v[::-1]) for v in (bucket - base, bucket))
    turn, aside = np.abs(wrapped(heading - now)), wrapped(heading + np.pi - outwards)
    too_far = np.maximum(np.abs(aside) - config.platform_side_rad, 0.0)
    cost = config.turn_weight * turn**2 + config.side_weight * wrapped(aside - config.side_rad) ** 2
    return cost + 10 * too_far + np.where(turn > np.pi / 2, 100.0, 0.0)


def _missing_clearance(snapshot: Snapshot, goal: BucketGoal, wall: Wall, config: PressConfig) -> np.ndarray:
    """Return by how much the nearest part of the bail in front of a place is too near in height, (Z, D)."""
    link = goal.point_link[0]
    moving = np.flatnonzero(link > 0)
    if not len(moving):
        return np.zeros_like(wall.reach_m)
    points = small_product(snapshot.link_rotation_w[0, link[moving]], goal.points[0, moving, :, None])[..., 0]
    points = points + snapshot.link_position_w[0, link[moving]] - snapshot.link_position_w[0, 0]
    points = small_product(points, snapshot.link_rotation_w[0, 0])  # in the root's frame, (M, 3)
    cos, sin = np.cos(wall.directions_rad)[:, None], np.sin(wall.directions_rad)[:, None]
    along, across = cos * points[:, 0] + sin * points[:, 1], cos * points[:, 1] - sin * points[:, 0]  # (D, M)
    before = (np.abs(across) < config.bail_band_m) & (along > wall.reach_m[:, :, None] - 0.01)  # (Z, D, M)
    gap = np.where(before, np.abs(points[:, 2] - wall.heights_m[:, None, None]), np.inf)
    missing: np.ndarray = np.maximum(config.bail_clearance_m - gap.min(axis=-1), 0.0)
    return missing


def _too_low(snapshot: Snapshot, wall: Wall, config: PressConfig) -> np.ndarray:
    """Return by how much a place is too low for a hand, if the platform is beneath it or its palm, (Z, K)."""
    turn, ways = snapshot.link_rotation_w[0, 0].T, np.zeros((len(wall.directions_rad), 3))
    ways[:, 0], ways[:, 1] = np.cos(wall.directions_rad), np.sin(wall.directions_rad)
    places = wall.reach_m[..., None] * ways  # (Z, K, 3)
    places[..., 2] = wall.heights_m[:, None]
    places = small_product(places, turn) + snapshot.link_position_w[0, 0]
    palms = places[..., :2] + config.palm_m * small_product(ways, turn)[:, :2]
    nearest = np.minimum(np.abs(places[..., :2]).max(axis=-1), np.abs(palms).max(axis=-1))
    missing = np.maximum(config.platform_clear_m - places[..., 2], 0.0)
    low: np.ndarray = (nearest < config.platform_half_m) * missing
    return low
