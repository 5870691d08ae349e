"""The posts of a chair that a hand can close around: the gas column, or the upright tubes of a frame."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape
from artiskill.assets.kinematics import joint_values, link_poses
from artiskill.geometry.arrays import matmul, rotate
from artiskill.geometry.rotations import quat_to_matrix

POSTS = 4  # slots: a frame has at most four
_THICKEST_M = 0.07  # the fingers open 0.08 m
_SHORTEST_M = 0.05  # free part of a post
_LEAST_UPRIGHT = math.cos(0.4)
_HANDS_WAY_M = 0.15  # what stands this near to a post blocks its height for a hand
_UPWARDS = 0.6  # of the free part: a hand is thicker than its fingers and tilted, what is below hinders it first
_BELOW_HAND_M, _ABOVE_HAND_M = 0.03, 0.075  # what a hand needs: below for itself, above for its wrist and tilt
_HEIGHTS_M = (0.08, 0.5)  # where a hand can grip


@dataclass(frozen=True, eq=False)
class _Solid:
    """A collision shape of the chair at rest, in the chair's frame.

    Attributes:
        center: (3,).
        half: (3,) half extents of its axis-parallel box.
        axis: (3,) upwards along it.
        fixed: it belongs to the root link.
        is_post: it is thin and upright.
    """

    center: np.ndarray
    half: np.ndarray
    axis: np.ndarray
    fixed: bool
    is_post: bool

    @property
    def span(self) -> tuple[float, float]:
        """Its lowest and highest point."""
        return float(self.center[2] - self.half[2]), float(self.center[2] + self.half[2])

    def at(self, height: float) -> np.ndarray:
        """(3,) the point of its axis at a height."""
        return self.center + self.axis * ((height - self.center[2]) / self.axis[2])


@dataclass(frozen=True, eq=False)
class GripPlaces:
    """Where hands can grip the posts of a chair, on the posts' axes in the root's frame.

    Attributes:
        points: (POSTS, 3) the best place of each post; zero where there are fewer posts.
        ends: (POSTS, 2, 3) its lowest and its highest place.
        count: how many posts there are.
    """

    points: np.ndarray
    ends: np.ndarray
    count: int


@lru_cache(maxsize=256)
def grip_places(obj: ArticulatedObject) -> GripPlaces:
    """Where hands can grip the posts of a chair."""
    solids = _solids(obj)
    found: list[np.ndarray] = []
    for post in sorted((s for s in solids if s.fixed and s.is_post), key=lambda s: -float(s.half[2])):
        places = _grip(post, solids)
        if places is not None and len(found) < POSTS and not _near_any(places[0], found):
            found.append(places)
    slots = np.zeros((POSTS, 3, 3))
    slots[: len(found)] = np.reshape(found, (-1, 3, 3))
    return GripPlaces(slots[:, 0], slots[:, 1:], len(found))


def _near_any(point: np.ndarray, others: list[np.ndarray]) -> bool:
    return any(math.dist(point[:2], other[0, :2]) < _THICKEST_M for other in others)


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
    is_post = thickness <= _THICKEST_M and axis[2] >= _LEAST_UPRIGHT and 2 * half[2] >= _SHORTEST_M
    return _Solid(center, half, axis, fixed, bool(is_post))


def _grip(post: _Solid, solids: list[_Solid]) -> np.ndarray | None:
    """(3, 3) the best, lowest and highest place on a post's longest free part; None where that is too short."""
    same = [s for s in solids if s.is_post and math.dist(s.center[:2], post.center[:2]) < _THICKEST_M / 2]
    low = max(_HEIGHTS_M[0], min(s.span[0] for s in same))
    high = min(_HEIGHTS_M[1], max(s.span[1] for s in same))
    blocked = sorted(s.span for s in solids if not s.is_post and _blocks(s, post))
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
    return np.stack([post.at(height) for height in (usual, lowest, highest)])


def _blocks(solid: _Solid, post: _Solid) -> bool:
    gap = np.abs(solid.center[:2] - post.center[:2]) - solid.half[:2]
    return bool(gap.max() < _HANDS_WAY_M)
