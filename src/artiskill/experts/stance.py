"""Where the base stands while the hand works, and from which side the hand comes."""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.config import check_value
from artiskill.experts.frames import Frame, yaw_rotation

_NEAR_M, _FAR_M = (
    0.15,
    0.6,
)  # distances from where the hand heads for: no detour from here on, all of it up to here
_LEAST_HEIGHT_M = 0.3  # of a detour: the forearm stays above the floor
_MOST_BEARING_RAD = 1.0
_SWING = 1  # the arm's joint that swings it sideways, about the vertical, at its rest posture


@dataclass(frozen=True)
class StanceConfig:
    """The usual stance, all values 0, is the rest posture, straight in front of the hand's goal.

    Attributes:
        bearing_rad: until a door is let go, the base stands turned so far from where the hand points, and the arm
            swings back as far.
        via_side_m: the hand makes a detour to its left on its way to the handle, this far at first.
        via_up_m: likewise, upwards.
    """

    bearing_rad: float
    via_side_m: float
    via_up_m: float

    def __post_init__(self) -> None:
        rule = f"must lie in [-{_MOST_BEARING_RAD}, {_MOST_BEARING_RAD}]"
        check_value(self, "bearing_rad", abs(self.bearing_rad) <= _MOST_BEARING_RAD, rule)
        for name in ("via_side_m", "via_up_m"):
            check_value(self, name, math.isfinite(getattr(self, name)), "must be finite")


@dataclass(frozen=True, eq=False)
class Posture:
    """Where base and lift stand for a wanted pose of the hand, and how the arm is bent.

    Attributes:
        arm: (7,) its joints.
        tool_offset: (3,) of the tool from the base, in the base's frame, the lift being at 0.
        bearing_rad: yaw of the base from where the hand points.
    """

    arm: np.ndarray
    tool_offset: np.ndarray
    bearing_rad: float = 0.0

    def turned(self, bearing_rad: float, shoulder: np.ndarray) -> "Posture":
        """The rest posture with the base turned, and the arm swung back about the vertical through the shoulder.

        Args:
            bearing_rad: by so much.
            shoulder: (3,) of the arm's mount in the base's frame; its height does not matter.
        """
        arm, offset = self.arm.copy(), self.tool_offset.copy()
        arm[_SWING] -= bearing_rad
        lever = (offset - shoulder)[:2]
        offset[:2] += yaw_rotation(-bearing_rad)[:2, :2] @ lever - lever
        return Posture(arm, offset, bearing_rad)

    def joints(self, wanted: Frame) -> np.ndarray:
        """Base x, y and yaw, lift and arm from which the hand has a wanted pose, (11,)."""
        yaw = float(np.arctan2(wanted.forward[1], wanted.forward[0])) + self.bearing_rad
        base = wanted.position[:2] - (yaw_rotation(yaw) @ self.tool_offset)[:2]
        lift = max(0.0, wanted.position[2] - self.tool_offset[2])
        return np.concatenate((base, (yaw, lift), self.arm))


def approach_point(config: StanceConfig, goal: Frame, position: np.ndarray) -> np.ndarray:
    """(3,) where a hand that is at a position goes on its way to a goal: the detour fades as it comes near."""
    if not config.via_side_m and not config.via_up_m:
        return goal.position
    distance = math.dist(goal.position, position)
    share = min(max((distance - _NEAR_M) / (_FAR_M - _NEAR_M), 0.0), 1.0)
    x, y, _ = goal.forward
    left = np.array((-y, x, 0.0)) / max(math.hypot(x, y), 0.1)
    point = goal.position + share * (config.via_side_m * left + np.array((0.0, 0.0, config.via_up_m)))
    point[2] = max(point[2], min(_LEAST_HEIGHT_M, goal.position[2]))
    return point
