"""Outlines of buckets seen from above: fine ones to draw, coarse ones to touch, and which of them holds a point.

All are scaled so that the half width along y is 1.
"""

from functools import cache

import numpy as np

from artiskill.assets.buckets.spec import Section
from artiskill.geometry.arrays import dot, matmul

ROUND_POINTS = 40
ROUND_WALLS = 12
_SIDES = {"square": 4, "hexagon": 6, "octagon": 8}
_ARC_POINTS = {"square": 6, "hexagon": 4, "octagon": 4}
# Corners rounder than this are touched as one or two chords instead of a sharp edge: keeps within some 6 mm.
_ONE_CHORD = {"square": 0.05, "hexagon": 0.16, "octagon": 0.5}
_TWO_CHORDS = {"square": 0.12, "hexagon": 0.5, "octagon": 1.0}


@cache
def outline(section: Section) -> np.ndarray:
    """The outline as drawn, counter-clockwise. -> (N, 2)."""
    if section.kind in _SIDES:
        return _polygon(_SIDES[section.kind], section.corner, _ARC_POINTS[section.kind])
    angles = (np.arange(ROUND_POINTS) + 0.5) * (2 * np.pi / ROUND_POINTS)
    return np.stack((section.aspect * np.cos(angles), np.sin(angles)), axis=-1)


@cache
def coarse_outline(section: Section) -> np.ndarray:
    """A convex polygon with few sides about as far within the outline as beyond it. -> (K, 2)."""
    kind, corner = section.kind, section.corner
    if kind in _SIDES:
        chords = int(corner > _ONE_CHORD[kind]) + int(corner > _TWO_CHORDS[kind])
        return _polygon(_SIDES[kind], corner if chords else 0.0, chords + 1)
    half_step = np.pi / ROUND_WALLS
    angles = (2 * np.arange(ROUND_WALLS) + 1) * half_step
    radius = 2.0 / (1.0 + np.cos(half_step))  # vertices as far outside the circle as edges are inside
    return radius * np.stack((section.aspect * np.cos(angles), np.sin(angles)), axis=-1)


def gauge(section: Section, points: np.ndarray) -> np.ndarray:
    """By which factor the outline, or the coarse one if that is larger there, must be scaled to reach a point.

    Args:
        section: the outline.
        points: (..., 2).

    Returns:
        (...) in the points' units.
    """
    coarse = _gauge(coarse_outline(section), points)
    if section.kind in _SIDES:
        return np.minimum(_gauge(outline(section), points), coarse)
    return np.minimum(np.hypot(points[..., 0] / section.aspect, points[..., 1]), coarse)


def _gauge(polygon: np.ndarray, points: np.ndarray) -> np.ndarray:
    edges = np.roll(polygon, -1, axis=0) - polygon
    normals = np.stack((edges[:, 1], -edges[:, 0]), axis=-1)
    distances = dot(normals, polygon)
    reached = matmul(points[..., None, :], (normals / distances[:, None]).T)[..., 0, :]
    return np.asarray(reached.max(axis=-1))


def _polygon(sides: int, corner: float, arc: int) -> np.ndarray:
    """A regular polygon with apothem 1, flat towards +y, whose corners are arcs of `arc` points."""
    turn = 2 * np.pi / sides
    middles = np.pi / 2 + (np.arange(sides) + 0.5) * turn
    if arc == 1 or corner <= 0:
        return np.stack((np.cos(middles), np.sin(middles)), axis=-1) / np.cos(turn / 2)
    centres = (1.0 - corner) / np.cos(turn / 2) * np.stack((np.cos(middles), np.sin(middles)), axis=-1)
    angles = middles[:, None] + np.linspace(-turn / 2, turn / 2, arc)
    return (centres[:, None] + corner * np.stack((np.cos(angles), np.sin(angles)), axis=-1)).reshape(-1, 2)
