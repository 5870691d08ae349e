"""How a two-armed robot that is out of place gets its hands to an object without knocking it over.

Hands that somebody left behind the robot's own column, on its base, or in the object or near it come out of there
first, and a base that is too near backs off. Where the robot is in order, none of this does anything.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from artiskill.experts.frames import ramp
from artiskill.experts.whole_body import in_base_axes, in_world_axes
from artiskill.geometry.arrays import norm, small_product
from artiskill.sim.snapshot import Snapshot

_UP = np.array((0.0, 0.0, 1.0))
_SIDES = (-1.0, 1.0)  # an arm's own side, left is positive: the first arm is the right one
_PALM_M = 0.1  # the palm is so far behind the tool's centre
_FREE_M_S = 0.6  # speed of a hand that comes out from behind the column
_RISE_M_S = 0.4  # likewise, from the base
_LEAVE_M_S = 0.3  # likewise, from the object
_SLOWER = 0.4  # by this share of what it would do beside that it is slower

# Where a measure counts for nothing, and where in full (`ramp`); places on the robot are from its base's middle
_BEHIND_M = (0.0, -0.1)  # a hand so little ahead has the column in its way
_BESIDE_M = (0.5, 0.35)  # likewise, so far to its own side
_ON_BASE_M = (0.45, 0.35)  # a hand so little ahead has the base in its way, if it is as near sideways
_LOW_M = (0.3, 0.2)  # likewise, above the ground
_AT_OBJECT_M = (0.2, 0.08)  # a hand is so near to the object

_NEAREST_BASE_M = 0.5  # the base's middle comes so near to the object without harm,
_SHORT_M = 0.15  # or so much nearer than it shall be for the hold, if that is less;
_MORE_M = 0.1  # still nearer by this, and it backs off in full


@dataclass(frozen=True)
class Cylinder:
    """An upright cylinder around an object that stands: its foot (3,) in the world, its radius and its height."""

    foot_w: np.ndarray
    radius_m: float
    height_m: float

    def way_out(self, point_w: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the direction (3,) that leads away from it at a point, and the distance; inside, up and 0.

        At its side the direction jumps, from up to level: a hand inside is within the walls.
        """
        offset = point_w - self.foot_w
        beside = float(norm(offset[:2]))
        aside, above = max(beside - self.radius_m, 0.0), max(float(offset[2]) - self.height_m, 0.0)
        way = np.array((*(aside / max(beside, 1e-6) * offset[:2]), above))
        distance = float(norm(way))
        return (way / distance if distance > 1e-6 else _UP), distance


def base_too_near(snapshot: Snapshot, middle_w: np.ndarray, hold_distance_m: float) -> float:
    """Return how far the base is too near to an object's middle (3,) for a hold from this distance, 0 to 1."""
    distance = float(norm(middle_w[:2] - snapshot.robot_qpos[0, :2]))
    nearest = min(_NEAREST_BASE_M, hold_distance_m - _SHORT_M)
    return ramp(distance, nearest, nearest - _MORE_M)


def clear_of_object(snapshot: Snapshot, velocities: np.ndarray, cylinder: Cylinder) -> np.ndarray:
    """Return velocities (2, 3) of hands: out of the object's cylinder where they are in it or near, and slower."""
    found = velocities.copy()
    for arm in range(len(found)):
        tool, palm = snapshot.tool_position_w[0, arm], _PALM_M * snapshot.tool_rotation_w[0, arm, :, 2]
        way, distance = min((cylinder.way_out(point) for point in (tool, tool - palm)), key=lambda one: one[1])
        near, outwards = ramp(distance, *_AT_OBJECT_M), float(small_product(found[arm], way))
        missing = max(_LEAVE_M_S - outwards, 0.0)
        found[arm] += near * (missing * way - _SLOWER * (found[arm] - outwards * way))
    return found


def clear_of_robot(snapshot: Snapshot, twists: np.ndarray, carried: Callable[[], np.ndarray]) -> np.ndarray:
    """Return twists (2, 6) of hands: out from behind the column on their own side, and up from the base.

    They come out as seen from the robot: `carried` returns the twists (2, 6) of hands that the trunk takes along.
    """
    found = twists.copy()
    base_x, base_y = snapshot.robot_qpos[0, :2]
    for arm, side in enumerate(_SIDES):
        x, y, height = snapshot.tool_position_w[0, arm]
        ahead, left, *_ = in_base_axes(snapshot, np.array((x - base_x, y - base_y, 0.0, 0.0))).tolist()
        if ahead >= _ON_BASE_M[0]:
            continue
        behind = ramp(ahead, *_BEHIND_M) * ramp(side * left, *_BESIDE_M)
        if behind > 0.0:
            sideways = in_world_axes(snapshot, np.array((0.0, side * _FREE_M_S, 0.0, 0.0)))
            out = carried()[arm, :3] + np.array((*sideways[:2], 0.0))
            found[arm, :3] += behind * (out - found[arm, :3])
        low = ramp(ahead, *_ON_BASE_M) * ramp(abs(left), *_BESIDE_M) * ramp(float(height), *_LOW_M)
        found[arm, 2] += low * max(_RISE_M_S - float(found[arm, 2]), 0.0)
    return found
