"""What two hands can press of an object: its wall, and opposite places on it."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from artiskill.geometry.arrays import arctan2

_CACHED_WALLS = 256
_DIRECTIONS = 72  # of presses, every five degrees
_HALF_HAND_M = 0.035  # half the width of a hand whose fingers are one above the other
_HAND_TO_TIP_M = 0.045  # how far fingertips are ahead of their hand


@dataclass(frozen=True, eq=False)
class Press:
    """Two opposite places on an object's wall, in its frame.

    Attributes:
        height_m: of both.
        direction_rad: from the z axis to the left hand's place; the right hand's is opposite.
        reach_m: (2,) distance of the places of right and left hand from the axis.
        outline_m: (D,) how far the object reaches out at this height, in directions evenly around from +x on.
    """

    height_m: float
    direction_rad: float
    reach_m: np.ndarray
    outline_m: np.ndarray

    def clearance_m(self, points: np.ndarray) -> np.ndarray:
        """Return how far points (N, 3) in the object's frame are outside it, seen from its axis, (N,)."""
        step = 2 * np.pi / len(self.outline_m)
        angles = arctan2(points[:, 1], points[:, 0]) % (2 * np.pi)
        rim = np.interp(
            angles, step * np.arange(len(self.outline_m) + 1), np.append(self.outline_m, self.outline_m[0])
        )
        clearance: np.ndarray = np.hypot(points[:, 0], points[:, 1]) - rim
        return clearance


@dataclass(frozen=True, eq=False)
class Wall:
    """What can be pressed of an object; Z heights, D directions of its outlines, K directions of presses.

    Attributes:
        heights_m: (Z,) rising, in the object's frame.
        outline_m: (Z, D) how far it reaches out there from the z axis, in directions evenly around from +x on.
        hand_outline_m: (Z, D) the same of all that a hand would meet, which is larger than its fingertips.
        spread_m: half the width of the fingertips.
        directions_rad: (K,) of the left hand's place.
        reach_m: (Z, K) how far from the axis fingertips are that touch the wall, or whose hand does.
        blocked_m: (Z, K) how far fingertips are from the wall then.
    """

    heights_m: np.ndarray
    outline_m: np.ndarray
    hand_outline_m: np.ndarray
    spread_m: float
    directions_rad: np.ndarray
    reach_m: np.ndarray
    blocked_m: np.ndarray

    def place(self, level: int, direction: int) -> Press:
        """Return the places at one of the heights and directions."""
        opposite = (direction + len(self.directions_rad) // 2) % len(self.directions_rad)
        reach = self.reach_m[level, [opposite, direction]]
        return Press(
            float(self.heights_m[level]), float(self.directions_rad[direction]), reach, self.outline_m[level]
        )

    def between(self, height_m: float, direction_rad: float) -> Press:
        """Return the places at any height and direction; beyond the heights, those of the nearest one."""
        height_m = min(max(height_m, float(self.heights_m[0])), float(self.heights_m[-1]))
        at = float(np.interp(height_m, self.heights_m, np.arange(len(self.heights_m))))
        low = min(int(at), len(self.heights_m) - 2)
        outline, hand = (
            (1 - at + low) * one[low] + (at - low) * one[low + 1] for one in (self.outline_m, self.hand_outline_m)
        )
        turned = np.array((direction_rad + np.pi, direction_rad))
        tips, hands = _reach(outline[None], hand[None], turned, self.spread_m)
        return Press(height_m, direction_rad, np.maximum(tips, hands)[0], outline)


def wall_of(
    heights_m: np.ndarray, outline_m: np.ndarray, spread_m: float, hand_outline_m: np.ndarray | None = None
) -> Wall:
    """Return the wall with outlines (Z, D) at heights (Z,); walls are kept, for this takes a while."""
    hand = np.zeros_like(outline_m) if hand_outline_m is None else hand_outline_m
    return _wall(heights_m.tobytes(), outline_m.tobytes(), hand.tobytes(), spread_m)


@lru_cache(maxsize=_CACHED_WALLS)
def _wall(heights: bytes, outline: bytes, hand_outline: bytes, spread_m: float) -> Wall:
    levels = np.frombuffer(heights)
    found = np.frombuffer(outline).reshape(len(levels), -1)
    hand = np.frombuffer(hand_outline).reshape(found.shape)
    # rays that pass between two staves reach as far as their neighbours
    found = np.where(found > 0, found, np.maximum(np.roll(found, 1, axis=1), np.roll(found, -1, axis=1)))
    directions = 2 * np.pi / _DIRECTIONS * np.arange(_DIRECTIONS)
    tips, hands = _reach(found, hand, directions, spread_m)
    reach = np.maximum(tips, hands)
    return Wall(levels, found, hand, spread_m, directions, reach, reach - tips)


def _reach(
    outline: np.ndarray, hand_outline: np.ndarray, directions_rad: np.ndarray, spread_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return how far from the axis fingertips are, (Z, K), that touch outlines (Z, D), and whose hand does."""
    tips = _support(outline, directions_rad, spread_m)
    return tips, _support(hand_outline, directions_rad, _HALF_HAND_M) - _HAND_TO_TIP_M


def _support(outline: np.ndarray, directions_rad: np.ndarray, spread_m: float) -> np.ndarray:
    """Return how far from the axis a plate, twice `spread_m` wide, is that touches outlines (Z, D), (Z, K)."""
    rays = 2 * np.pi / outline.shape[1] * np.arange(outline.shape[1])
    turn = rays[None, :] - directions_rad[:, None]  # (K, D): of each ray against each direction
    along, across = outline[:, None] * np.cos(turn), outline[:, None] * np.sin(turn)  # (Z, K, D)
    touched = (np.abs(across) <= spread_m) & (along > 0)
    found: np.ndarray = np.where(touched, along, 0.0).max(axis=-1)
    return found
