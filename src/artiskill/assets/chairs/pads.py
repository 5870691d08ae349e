"""Cushions, boards and shells: a rounded pad over a superellipse, bent as a whole, and pieces that cover it."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.parts import IDENTITY
from artiskill.geometry.arrays import arccos, matmul, norm
from artiskill.geometry.meshes import TriMesh, convex_hull
from artiskill.geometry.primitives import loft, superellipse

Faces = Literal["both", "front", "rear"]
Bend = Callable[[np.ndarray], np.ndarray]  # (N, 3) points of the flat pad -> where they are

_DENSE = 256  # points of the outline before they are spread evenly
_REAR_EDGE = 0.4  # radius of the rear edge, relative to the front one
_RINGS = (0.05, 0.4, 0.75)  # scale of the rings on a face that is seen, from its middle
_HIDDEN_RINGS = (0.3,)
_OVERLAP_M = 0.003  # neighbouring strips share this much on either side: no slit between them
_CORNER_WEIGHT = 1.0  # how many of an outline's points lie by its turning, relative to those by its length
_EDGE_ANGLES = (0.0, np.pi / 4, np.pi / 2)
_COLLISION_POINTS = 16  # of the outline that collision shapes follow
# from so much wrap on, a pad is cut into three strips, and into five
_THREE_STRIPS_M, _FIVE_STRIPS_M = 0.006, 0.016


def unbent(points: np.ndarray) -> np.ndarray:
    """Return the points of a flat pad as they are."""
    return points


@dataclass(frozen=True, eq=False)
class Pad:
    """A pad in its own frame (u, v, w): its rear face in the plane w = 0, its front at w = `thickness_m`."""

    half_u: float
    half_v: float
    exponent: float  # of the outline: 2 an ellipse, 4 and more a rounded rectangle
    thickness_m: float  # along w
    edge_m: float  # radius of the front edge
    crown_m: float = 0.0  # how much thicker the middle is than the edge
    bend: Bend = unbent  # moves every point of the flat pad


def pad_mesh(pad: Pad, tile_m: float, offset: Any, count: int = 24, seen: Faces = "both") -> TriMesh:
    """Return the pad's surface, textured by its flat coordinates.

    Args:
        pad: what is seen.
        tile_m: side of the square that a texture covers.
        offset: (2,) where in the texture the pad's middle lies.
        count: points around, a multiple of 4.
        seen: faces that are seen; the other is meshed coarsely.
    """
    rim = even_outline(pad.half_u, pad.half_v, pad.exponent, count)
    half = np.array((pad.half_u, pad.half_v))
    stations = _stations(pad, seen)
    rings = np.stack([_at_height(rim * (scale * (1.0 - inset / half)), w) for scale, inset, w in stations])
    flat = rings.reshape(-1, 3)
    mesh = loft(pad.bend(flat).reshape(rings.shape))
    uvs = flat[:, :2] / tile_m + np.asarray(offset)
    return TriMesh(mesh.vertices, mesh.faces, uvs.astype(np.float32))


def pad_hulls(pad: Pad, pieces: int, along: int) -> list[np.ndarray]:
    """Return corner points of convex pieces that cover the bent pad, cut into strips across u (0) or v (1)."""
    rim = even_outline(pad.half_u, pad.half_v, pad.exponent, _COLLISION_POINTS)
    half = (pad.half_u, pad.half_v)[along]
    cuts = np.linspace(-half, half, pieces + 1)
    ends = [(low - _OVERLAP_M, high + _OVERLAP_M) for low, high in pairwise(cuts)]
    return [_strip_points(pad, rim, along, cut) for cut in ends]


def _strip_points(pad: Pad, rim: np.ndarray, along: int, cut: tuple[float, float]) -> np.ndarray:
    """Return the corners of the hull of one strip, rounded to a micrometre."""
    edge, half = _edge(pad), np.array((pad.half_u, pad.half_v))
    strip = _subdivided(_clip_outline(rim, along, *cut), 0.35 * float(half.min()))
    bounds = _keep(along, *cut, float(half[along]))
    layers = []
    for inset, w in ((0.3 * edge, 0.0), (0.0, pad.thickness_m - edge), (0.6 * edge, pad.thickness_m - 0.1 * edge)):
        # a cut stays where it is; only the pad's own rim is inset
        layers.append(_at_height(np.clip(strip * (1.0 - inset / half), *bounds), w))
    middle = strip.mean(axis=0)
    for scale in (0.6, 0.0):  # a face that bulges is covered too
        inner = middle + scale * (strip - middle)
        crown = pad.crown_m * (1 - norm(inner / half) ** 2)
        layers.append(np.column_stack((inner, pad.thickness_m + np.maximum(crown, 0.0))))
    return np.round(convex_hull(pad.bend(np.concatenate(layers))).mesh.vertices, 6)


def _at_height(ring: np.ndarray, w: float) -> np.ndarray:
    return np.column_stack((ring, np.full(len(ring), w)))


def _subdivided(outline: np.ndarray, longest_m: float) -> np.ndarray:
    """Return an outline whose edges are no longer than that."""
    points = []
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        steps = max(int(np.ceil(norm(end - start) / longest_m)), 1)
        points += [start + k / steps * (end - start) for k in range(steps)]
    return np.array(points)


def rolled_mesh(pad: Pad, rolls: int, groove_m: float, tile_m: float) -> TriMesh:
    """Return the pad's surface, its front sewn into rolls across u with grooves between them."""
    half_u, half_v, per_roll = pad.half_u, pad.half_v, 5
    shares = np.linspace(-1.0, 1.0, per_roll * rolls + 1)
    rings = []
    for share in shares:
        # an arch per roll; the first and the last end thin
        arch = math.pow(abs(math.sin(math.pi * rolls * (share + 1) / 2)), 0.6)
        at_end = abs(share) > 1 - 1e-9
        thick = pad.thickness_m * 0.7 if at_end else pad.thickness_m - groove_m * (1 - arch)
        wide = half_v * math.pow(1 - math.pow(min(abs(share), 0.995), pad.exponent), 1 / pad.exponent)
        section = superellipse(wide, thick / 2, 5.0, 16)
        rings.append(np.column_stack((np.full(16, share * half_u), section[:, 0], section[:, 1] + thick / 2)))
    flat = np.concatenate(rings)
    mesh = loft(pad.bend(flat).reshape(len(rings), 16, 3))
    return TriMesh(mesh.vertices, mesh.faces, (flat[:, :2] / tile_m).astype(np.float32))


def hull_shape(points: np.ndarray, part: str) -> CollisionShape:
    """Return a convex hull as a collision shape; its frame is parallel to the points', at their middle."""
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return CollisionShape("hull", (), centre, IDENTITY, points - centre, part)


def even_outline(half_u: float, half_v: float, exponent: float, count: int) -> np.ndarray:
    """Return a superellipse, its points even along its length and turning, counter-clockwise. -> (count, 2)."""
    dense = superellipse(half_u, half_v, exponent, _DENSE)
    closed = np.concatenate((dense, dense[:1]))
    edges = np.diff(closed, axis=0)
    steps = norm(edges)
    cosine = (edges * np.roll(edges, 1, axis=0)).sum(axis=1) / (steps * np.roll(steps, 1))
    turning = arccos(np.clip(cosine, -1.0, 1.0))
    steps = steps / steps.sum() + _CORNER_WEIGHT * (turning + np.roll(turning, -1)) / 2 / turning.sum()
    length = np.concatenate(((0.0,), np.cumsum(steps)))
    at = np.arange(count) * (length[-1] / count)
    return np.stack([np.interp(at, length, closed[:, k]) for k in range(2)], axis=1)


def _clip_outline(outline: np.ndarray, axis: int, low: float, high: float) -> np.ndarray:
    """Return the part of a convex outline (N, 2) between two values of a coordinate."""
    points = outline
    for sign, limit in ((1.0, low), (-1.0, -high)):
        inside = sign * points[:, axis] >= limit - 1e-12
        kept = []
        for i, point in enumerate(points):
            j = (i + 1) % len(points)
            if inside[i]:
                kept.append(point)
            if inside[i] != inside[j]:
                share = (limit - sign * point[axis]) / (sign * (points[j, axis] - point[axis]))
                kept.append(point + share * (points[j] - point))
        points = np.array(kept)
    return points


def _keep(along: int, low: float, high: float, half: float) -> tuple[np.ndarray, np.ndarray]:
    """Return bounds that hold inset points within a strip whose inner cuts must not move."""
    lower, upper = np.full(2, -np.inf), np.full(2, np.inf)
    if low > -half + 1e-9:
        lower[along] = low
    if high < half - 1e-9:
        upper[along] = high
    return lower, upper


def _edge(pad: Pad) -> float:
    return min(pad.edge_m, 0.7 * pad.thickness_m, 0.4 * min(pad.half_u, pad.half_v))


def _stations(pad: Pad, seen: Faces) -> list[tuple[float, float, float]]:
    """Return scale, inset and w of the rings, from the middle of the rear face to the middle of the front one."""
    front, rear = _edge(pad), _REAR_EDGE * _edge(pad)
    stations = [(scale, rear, 0.0) for scale in (_HIDDEN_RINGS if seen == "front" else _RINGS)]
    stations += [(1.0, rear, 0.0), (1.0, 0.0, rear)]
    for angle in _EDGE_ANGLES:
        stations.append((1.0, front * (1 - np.cos(angle)), pad.thickness_m - front * (1 - np.sin(angle))))
    inner = _HIDDEN_RINGS if seen == "rear" else _RINGS[::-1]
    stations += [(scale, front, pad.thickness_m + pad.crown_m * (1 - scale**2)) for scale in inner]
    return stations


def moved_pad(pad: Pad, origin: Any, axes: Any) -> Pad:
    """Return the pad in another frame.

    Args:
        pad: in its own frame.
        origin: (3,) where its (0, 0, 0) is.
        axes: (3, 3) rows: directions of u, v and w, right-handed.
    """
    start, rows = np.asarray(origin, dtype=float), np.asarray(axes, dtype=float)

    def bend(points: np.ndarray) -> np.ndarray:
        moved: np.ndarray = matmul(pad.bend(points), rows) + start
        return moved

    return Pad(pad.half_u, pad.half_v, pad.exponent, pad.thickness_m, pad.edge_m, pad.crown_m, bend)


def strips(wrap_m: float) -> int:
    """Return into how many pieces a pad is cut whose sides come forward so far."""
    return 1 if wrap_m < _THREE_STRIPS_M else 3 if wrap_m < _FIVE_STRIPS_M else 5
