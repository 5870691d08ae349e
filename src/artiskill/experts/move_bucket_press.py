"""Where two hands press a bucket: at which height and from which two opposite sides."""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.config import check_inside, check_not_negative, check_positive
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.grasp_candidates import OUTLINE_LEVELS
from artiskill.tasks.move_bucket import BucketGoal


@dataclass(frozen=True)
class PressConfig:
    """What makes a pair of places good.

    Attributes:
        side_bias_rad: the side to stand on is chosen as if the robot stood so far around the bucket,
            counter-clockwise; 0 for the nearest one.
        pad_to_tip_m: how far the fingertips are ahead of the tool's centre.
        spread_m: the open fingertips touch the wall up to this far beside the hand's axis.
        share: best height, as a share of the body's.
        least_height_m: hands do not go lower, for the ground is there.
        bail_clearance_m: a bail at least this far above or below the hands is not in their way.
        bail_band_m: nor is one this far beside their axis.
        turn_weight: cost of a radian that the robot has to go around the bucket; of n radians n^2 as much.
        width_weight: cost of a metre by which the bucket is wider there than at its narrowest.
        height_weight: cost of a whole body's height of distance from the best height.
        bail_weight: cost of a metre that is missing to the bail's clearance.
        platform_side_rad: the robot stays beyond the bucket as seen from the platform, up to this far aside.
    """

    side_bias_rad: float
    pad_to_tip_m: float
    spread_m: float
    share: float
    least_height_m: float
    bail_clearance_m: float
    bail_band_m: float
    turn_weight: float
    width_weight: float
    height_weight: float
    bail_weight: float
    platform_side_rad: float

    def __post_init__(self) -> None:
        check_inside("side_bias_rad", self.side_bias_rad, (-math.pi, math.pi))
        check_inside("share", self.share, (0, 1))
        check_positive(self, "spread_m")
        check_not_negative(self, "pad_to_tip_m", "least_height_m", "bail_clearance_m", "bail_band_m")
        check_not_negative(
            self, "turn_weight", "width_weight", "height_weight", "bail_weight", "platform_side_rad"
        )


@dataclass(frozen=True, eq=False)
class Press:
    """Two opposite places on a bucket's wall, in its root's frame.

    Attributes:
        height_m: of both.
        direction_rad: from the root's z axis to the left hand's place; the right hand's is opposite.
        reach_m: (2,) distance of the places of right and left hand from the axis.
        outline_m: (D,) how far the body reaches out at this height, in directions evenly around from +x on.
    """

    height_m: float
    direction_rad: float
    reach_m: np.ndarray
    outline_m: np.ndarray

    def clearance_m(self, points: np.ndarray) -> np.ndarray:
        """How far points (N, 3) in the root's frame are outside the body, seen from its axis, (N,)."""
        step = 2 * np.pi / len(self.outline_m)
        angles = np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi)
        rim = np.interp(
            angles, step * np.arange(len(self.outline_m) + 1), np.append(self.outline_m, self.outline_m[0])
        )
        clearance: np.ndarray = np.hypot(points[:, 0], points[:, 1]) - rim
        return clearance


def choose_press(snapshot: Snapshot, goal: BucketGoal, config: PressConfig) -> Press:
    """The best pair of places for a robot that stands where it does (B = 1)."""
    heights, outline = goal.outline_height[0], _without_gaps(goal.outline[0])  # (Z,), (Z, D)
    directions = 2 * np.pi / outline.shape[1] * np.arange(outline.shape[1])
    reach = _support(outline, directions, config.spread_m)
    opposite = np.roll(reach, -outline.shape[1] // 2, axis=1)
    width = reach + opposite
    cost = config.width_weight * (width - width.min(axis=1, keepdims=True))
    cost += (config.height_weight * np.abs(np.array(OUTLINE_LEVELS) - config.share))[:, None]
    cost += np.where(heights < config.least_height_m, 100.0, 0.0)[:, None]
    cost += _turn_cost(snapshot, directions, config)
    missing = _missing_clearance(snapshot, goal, (heights, directions, reach), config)
    cost += config.bail_weight * (missing + np.roll(missing, -outline.shape[1] // 2, axis=1))
    level, k = np.unravel_index(int(np.argmin(cost)), cost.shape)
    places = np.array((opposite[level, k], reach[level, k]), dtype=float)
    return Press(float(heights[level]), float(directions[k]), places, outline[level])


def _without_gaps(outline: np.ndarray) -> np.ndarray:
    """The outline (Z, D) where rays that pass between two staves reach as far as their neighbours."""
    beside = np.maximum(np.roll(outline, 1, axis=1), np.roll(outline, -1, axis=1))
    return np.where(outline > 0, outline, beside)


def _support(outline: np.ndarray, directions: np.ndarray, spread_m: float) -> np.ndarray:
    """How far from the axis something flat and twice `spread_m` wide is that touches the outline, (Z, D)."""
    turn = directions[None, :] - directions[:, None]  # (D, D): of each ray against each direction
    along, across = outline[:, None] * np.cos(turn), outline[:, None] * np.sin(turn)  # (Z, D, D)
    touched = (np.abs(across) <= spread_m) & (along > 0)
    found: np.ndarray = np.where(touched, along, 0.0).max(axis=-1)
    return found


def _turn_cost(snapshot: Snapshot, directions: np.ndarray, config: PressConfig) -> np.ndarray:
    """(D,) how far around the bucket the robot has to go, and whether the platform is in the way there."""
    bucket, base = snapshot.link_position_w[0, 0, :2], snapshot.robot_qpos[0, :2]
    x_axis = snapshot.link_rotation_w[0, 0, :2, 0]
    yaw = np.arctan2(x_axis[1], x_axis[0])
    heading = directions + yaw - np.pi / 2  # the robot's, whose left side the direction is
    now, outwards = (np.arctan2(*v[::-1]) for v in (bucket - base, bucket))
    turn, biased = np.abs(_wrapped(heading - now)), np.abs(_wrapped(heading - now - config.side_bias_rad))
    aside = np.abs(_wrapped(heading + np.pi - outwards))
    too_far = np.maximum(aside - config.platform_side_rad, 0.0)
    return config.turn_weight * biased**2 + 10 * too_far + np.where(turn > np.pi / 2, 100.0, 0.0)


def _missing_clearance(
    snapshot: Snapshot, goal: BucketGoal, places: tuple[np.ndarray, np.ndarray, np.ndarray], config: PressConfig
) -> np.ndarray:
    """(Z, D) by how much the nearest part of the bail in front of a place is too near in height."""
    heights, directions, reach = places
    link = goal.point_link[0]
    moving = np.flatnonzero(link > 0)
    if not len(moving):
        return np.zeros_like(reach)
    points = (snapshot.link_rotation_w[0, link[moving]] @ goal.points[0, moving, :, None])[..., 0]
    points = points + snapshot.link_position_w[0, link[moving]] - snapshot.link_position_w[0, 0]
    points = points @ snapshot.link_rotation_w[0, 0]  # in the root's frame, (M, 3)
    along = np.cos(directions)[:, None] * points[:, 0] + np.sin(directions)[:, None] * points[:, 1]  # (D, M)
    across = np.cos(directions)[:, None] * points[:, 1] - np.sin(directions)[:, None] * points[:, 0]
    before = (np.abs(across) < config.bail_band_m) & (along > reach[:, :, None] - 0.01)  # (Z, D, M)
    gap = np.where(before, np.abs(points[:, 2] - heights[:, None, None]), np.inf)
    missing: np.ndarray = np.maximum(config.bail_clearance_m - gap.min(axis=-1), 0.0)
    return missing


def _wrapped(angle: np.ndarray) -> np.ndarray:
    return np.arctan2(np.sin(angle), np.cos(angle))
