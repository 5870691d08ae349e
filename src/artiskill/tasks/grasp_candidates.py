"""Where controllers can take hold of an object: columns of chairs that a hand closes around, walls of buckets.

Rewards and success do not depend on these; they are part of goals for the sake of experts.
"""

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape
from artiskill.assets.kinematics import joint_values, link_poses
from artiskill.geometry.arrays import matmul, rotate
from artiskill.geometry.meshes import convex_hull
from artiskill.geometry.rotations import quat_to_matrix, transform_points

_CACHED_OBJECTS = 256

OUTLINE_DIRECTIONS = 72  # every five degrees, from the root's +x on
OUTLINE_LEVELS = (0.3, 0.4, 0.5, 0.6, 0.7)  # shares of the body's height

COLUMNS = 4  # slots: a frame has at most four
_THICKEST_M = 0.07  # the fingers open 0.08 m
_SHORTEST_M = 0.05  # free part of a column
_LEAST_UPRIGHT = math.cos(0.4)
_HANDS_WAY_M = 0.15  # what stands this near to a column blocks its height for a hand
_UPWARDS = 0.6  # of the free part: a hand is thicker than its fingers and tilted, what is below hinders it first
_BELOW_HAND_M, _ABOVE_HAND_M = 0.03, 0.075  # what a hand needs: below for itself, above for its wrist and tilt
_HEIGHTS_M = (0.08, 0.5)  # where a hand can grip


@dataclass(frozen=True, eq=False)
class GraspableColumns:
    """Where hands can grip the columns of a chair, on the columns' axes in the root's frame.

    Attributes:
        points: (COLUMNS, 3) the best place of each column; zero where there are fewer columns.
        ends: (COLUMNS, 2, 3) its lowest and its highest place.
        count: how many columns there are.
    """

    points: np.ndarray
    ends: np.ndarray
    count: int


@lru_cache(maxsize=_CACHED_OBJECTS)
def graspable_columns(obj: ArticulatedObject) -> GraspableColumns:
    """Return where hands can grip the columns of a chair."""
    solids = _solids(obj)
    found: list[np.ndarray] = []
    for column in sorted((s for s in solids if s.fixed and s.is_column), key=lambda s: -float(s.half[2])):
        places = _grasp_points(column, solids)
        if places is not None and len(found) < COLUMNS and not _near_any(places[0], found):
            found.append(places)
    slots = np.zeros((COLUMNS, 3, 3))
    slots[: len(found)] = np.reshape(found, (-1, 3, 3))
    return GraspableColumns(slots[:, 0], slots[:, 1:], len(found))


def _near_any(point: np.ndarray, others: list[np.ndarray]) -> bool:
    return any(math.dist(point[:2], other[0, :2]) < _THICKEST_M for other in others)


@dataclass(frozen=True, eq=False)
class _Solid:
    """A collision shape of the chair at rest, in the chair's frame.

    Attributes:
        center: (3,).
        half: (3,) half extents of its axis-parallel box.
        axis: (3,) upwards along it.
        fixed: it belongs to the root link.
        is_column: it is thin and upright.
    """

    center: np.ndarray
    half: np.ndarray
    axis: np.ndarray
    fixed: bool
    is_column: bool

    @property
    def span(self) -> tuple[float, float]:
        """Its lowest and highest point."""
        return float(self.center[2] - self.half[2]), float(self.center[2] + self.half[2])

    def at(self, height: float) -> np.ndarray:
        """Return the point of its axis at a height, (3,)."""
        return self.center + self.axis * ((height - self.center[2]) / self.axis[2])


def _solids(obj: ArticulatedObject) -> list[_Solid]:
    positions, quaternions = link_poses(obj, joint_values(obj, 0.0))
    return [
        _solid(shape, positions[i], quat_to_matrix(quaternions[i]), i == 0)
        for i, link in enumerate(obj.links)
        for shape in link.collisions
    ]


def _solid(shape: CollisionShape, position: np.ndarray, rotation: np.ndarray, fixed: bool) -> _Solid:
    center = position + rotate(rotation, shape.position)
    turn = matmul(rotation, quat_to_matrix(np.asarray(shape.quaternion, dtype=float)))
    if shape.vertices is not None:
        corners = center + matmul(shape.vertices, turn.T)
        center, half = (corners.min(axis=0) + corners.max(axis=0)) / 2, np.ptp(corners, axis=0) / 2
    elif shape.kind == "box":
        half = rotate(np.abs(turn), np.asarray(shape.size))
    else:
        radius, length = (*shape.size, 0.0)[:2]
        around = 1.0 if shape.kind == "capsule" else np.sqrt(np.maximum(0.0, 1.0 - turn[:, 2] ** 2))
        half = np.abs(turn[:, 2]) * length + radius * around
    axis, thickness = np.array((0.0, 0.0, 1.0)), 2 * float(half[:2].max())
    if shape.kind in ("cylinder", "capsule"):
        axis, thickness = turn[:, 2] * np.copysign(1.0, turn[2, 2]), 2 * shape.size[0]
    is_column = thickness <= _THICKEST_M and axis[2] >= _LEAST_UPRIGHT and 2 * half[2] >= _SHORTEST_M
    return _Solid(center, half, axis, fixed, bool(is_column))


def _grasp_points(column: _Solid, solids: list[_Solid]) -> np.ndarray | None:
    """Return the best, lowest and highest place on a column's longest free part, (3, 3); None if too short."""
    same = [s for s in solids if s.is_column and math.dist(s.center[:2], column.center[:2]) < _THICKEST_M / 2]
    low = max(_HEIGHTS_M[0], min(s.span[0] for s in same))
    high = min(_HEIGHTS_M[1], max(s.span[1] for s in same))
    blocked = sorted(s.span for s in solids if not s.is_column and _blocks(s, column))
    best, start = (0.0, 0.0), low
    for bottom, top in [*blocked, (high, high)]:
        if min(bottom, high) - start > best[1] - best[0]:
            best = (start, min(bottom, high))
        start = max(start, top)
    free = best[1] - best[0]
    if free < _SHORTEST_M:
        return None
    usual = best[0] + _UPWARDS * free
    lowest, highest = min(usual, best[0] + _BELOW_HAND_M), max(usual, best[1] - _ABOVE_HAND_M)
    return np.stack([column.at(height) for height in (usual, lowest, highest)])


def _blocks(solid: _Solid, column: _Solid) -> bool:
    gap = np.abs(solid.center[:2] - column.center[:2]) - solid.half[:2]
    return bool(gap.max() < _HANDS_WAY_M)


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


def _section_reach(triangles: np.ndarray, z: float) -> np.ndarray:
    """Return how far the section at a height reaches out from the axis, (D,)."""
    above = triangles[:, :, 2] > z
    crossing = triangles[above.any(axis=1) & ~above.all(axis=1)]
    start, end = crossing, np.roll(crossing, -1, axis=1)  # (T, 3 edges, 3)
    cut = (start[:, :, 2] > z) != (end[:, :, 2] > z)  # two edges of each triangle
    a, b = start[cut], end[cut]
    share = (z - a[:, 2]) / (b[:, 2] - a[:, 2])
    points = (a[:, :2] + share[:, None] * (b[:, :2] - a[:, :2])).reshape(-1, 2, 2)  # segments of the section
    angles = 2 * np.pi / OUTLINE_DIRECTIONS * np.arange(OUTLINE_DIRECTIONS)
    along = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    across = np.stack((-np.sin(angles), np.cos(angles)), axis=-1)
    side, out = matmul(points, across.T), matmul(points, along.T)  # (S, 2, D)
    met = (side[:, 0] > 0) != (side[:, 1] > 0)
    width = np.where(met, side[:, 0] - side[:, 1], 1.0)
    reach = out[:, 0] + side[:, 0] / width * (out[:, 1] - out[:, 0])
    found: np.ndarray = np.where(met, reach, 0.0).max(axis=0, initial=0.0)
    return found
