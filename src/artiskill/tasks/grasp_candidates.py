"""Where controllers can take hold of an object: between two hands, a chair by its seat, a bucket by its wall.

Rewards and success do not depend on these; they are part of goals for the sake of experts.
"""

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape
from artiskill.assets.kinematics import link_poses
from artiskill.geometry.arrays import matmul, rotate
from artiskill.geometry.meshes import convex_hull
from artiskill.geometry.rotations import quat_to_matrix, transform_points

_CACHED_OBJECTS = 256

OUTLINE_DIRECTIONS = 72  # every five degrees, from the root's +x on
OUTLINE_LEVELS = (0.3, 0.4, 0.5, 0.6, 0.7)  # shares of the body's height

SEAT_DIRECTIONS = 360  # the same for a seat, beside which thin things stand
_SEAT_M = (0.25, 0.75)  # heights of seats' middles
_SEAT_AHEAD_M = 0.1  # hands take a seat so far ahead of its middle: most armrests' posts stand further back
_HALF_FINGERS_M, _HALF_HAND_M = 0.015, 0.1  # half the height of closed fingers, and of a hand turned on its side
_SECTIONS = 15  # through a seat, for each of the two
# so far above or below the seat's middle, fingers that are a little too high or low meet what stands out by more
_LEDGE_HEIGHT_M, _LEDGE_M = 0.018, 0.01


@dataclass(frozen=True, eq=False)
class Seat:
    """A chair's seat and what stands beside it, seen from above.

    Attributes:
        link: index of the link that it belongs to.
        position: (3,) a little ahead of its middle, halfway between its top and its bottom, in that link's frame.
        rotation: (3, 3) of its axes there: those of the root while the chair is at rest.
        outline: (2, D) how far the chair reaches out from there, in directions evenly around from +x on: where
            fingertips meet it, and where a whole hand would.
    """

    link: int
    position: np.ndarray
    rotation: np.ndarray
    outline: np.ndarray


@lru_cache(maxsize=_CACHED_OBJECTS)
def seat_of(obj: ArticulatedObject) -> Seat:
    """Return a chair's seat: what is widest, seen from above, at a height to sit on."""
    positions, quaternions = link_poses(obj, obj.rest_qpos)
    corners = [
        (i, np.asarray(transform_points(positions[i], quaternions[i], _corners(shape))))
        for i, link in enumerate(obj.links)
        for shape in link.collisions
    ]
    link, seat = max(corners, key=lambda one: _seat_area(one[1]))
    middle = (seat.min(axis=0) + seat.max(axis=0)) / 2 - (_SEAT_AHEAD_M, 0.0, 0.0)
    hulls = [convex_hull(points).mesh for _, points in corners]
    triangles = np.concatenate([hull.vertices[hull.faces] for hull in hulls]) - middle
    tips, ledge, hand = (
        np.max([_section_reach(triangles, z, SEAT_DIRECTIONS) for z in heights], axis=0)
        for heights in (
            np.linspace(-_HALF_FINGERS_M, _HALF_FINGERS_M, _SECTIONS),
            (-_LEDGE_HEIGHT_M, _LEDGE_HEIGHT_M),
            np.linspace(-_HALF_HAND_M, _HALF_HAND_M, _SECTIONS),
        )
    )
    tips = np.where(ledge > tips + _LEDGE_M, ledge, tips)
    turn = quat_to_matrix(quaternions[link])
    return Seat(link, rotate(turn.T, middle - positions[link]), turn.T, np.stack((tips, np.maximum(tips, hand))))


def _seat_area(corners: np.ndarray) -> float:
    """Return the area, seen from above, of the box around corners (V, 3); 0 at heights where no seat is."""
    size, height = np.ptp(corners, axis=0), float(corners[:, 2].min() + corners[:, 2].max()) / 2
    return float(size[0] * size[1]) if _SEAT_M[0] < height < _SEAT_M[1] else 0.0


@lru_cache(maxsize=_CACHED_OBJECTS)
def body_outline(obj: ArticulatedObject, bottom_m: float, top_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return where rays from the root's z axis leave the root link's collision shapes, at some heights.

    What is touched counts, not what is drawn: a round wall is touched as a polygon. Shapes that are neither hulls
    nor boxes count as the boxes around them.

    Args:
        obj: the object.
        bottom_m: of its body, in the root's frame.
        top_m: of its body, in the root's frame.

    Returns:
        (Z,) heights in the root's frame and (Z, D) distances from the axis, 0 where a ray meets nothing.
    """
    hulls = [convex_hull(_corners(shape)).mesh for shape in obj.links[0].collisions]
    triangles = np.concatenate([hull.vertices[hull.faces] for hull in hulls])  # (T, 3, 3)
    heights = bottom_m + np.array(OUTLINE_LEVELS) * (top_m - bottom_m)
    return heights, np.stack([_section_reach(triangles, z) for z in heights])


def _corners(shape: CollisionShape) -> np.ndarray:
    """Return the corners of a hull, or of the box around any other shape, (V, 3) in the link's frame."""
    if shape.vertices is not None:
        local = shape.vertices
    else:
        local = np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * _half_extents(shape)
    return np.asarray(transform_points(shape.position, shape.quaternion, local))


def _half_extents(shape: CollisionShape) -> tuple[float, ...]:
    if shape.kind == "box":
        return shape.size
    radius = shape.size[0]
    if shape.kind == "sphere":
        return (radius, radius, radius)
    return (radius, radius, shape.size[1] + (radius if shape.kind == "capsule" else 0.0))


def _section_reach(triangles: np.ndarray, z: float, directions: int = OUTLINE_DIRECTIONS) -> np.ndarray:
    """Return how far the section at a height reaches out from the axis, (D,)."""
    above = triangles[:, :, 2] > z
    crossing = triangles[above.any(axis=1) & ~above.all(axis=1)]
    start, end = crossing, np.roll(crossing, -1, axis=1)  # (T, 3 edges, 3)
    cut = (start[:, :, 2] > z) != (end[:, :, 2] > z)  # two edges of each triangle
    a, b = start[cut], end[cut]
    share = (z - a[:, 2]) / (b[:, 2] - a[:, 2])
    points = (a[:, :2] + share[:, None] * (b[:, :2] - a[:, :2])).reshape(-1, 2, 2)  # segments of the section
    angles = 2 * np.pi / directions * np.arange(directions)
    along = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    across = np.stack((-np.sin(angles), np.cos(angles)), axis=-1)
    side, out = matmul(points, across.T), matmul(points, along.T)  # (S, 2, D)
    met = (side[:, 0] > 0) != (side[:, 1] > 0)
    width = np.where(met, side[:, 0] - side[:, 1], 1.0)
    reach = out[:, 0] + side[:, 0] / width * (out[:, 1] - out[:, 0])
    found: np.ndarray = np.where(met, reach, 0.0).max(axis=0, initial=0.0)
    return found
