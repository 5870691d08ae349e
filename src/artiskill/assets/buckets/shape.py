"""The form of a bucket's wall: its outline seen from above, half widths by height, and distances from it.

Outlines are scaled so that the half width along y is 1.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from artiskill.assets.buckets.spec import Lip, Profile, Section
from artiskill.geometry.arrays import arctan2, dot, exp, matmul

_ROUND_POINTS = 40
_ROUND_WALLS = 12
_SIDES = {"square": 4, "hexagon": 6, "octagon": 8}
_ARC_POINTS = {"square": 6, "hexagon": 4, "octagon": 4}
# Corners rounder than this are covered by one or two chords instead of a sharp edge: keeps within some 6 mm.
_ONE_CHORD = {"square": 0.05, "hexagon": 0.16, "octagon": 0.5}
_TWO_CHORDS = {"square": 0.12, "hexagon": 0.5, "octagon": 1.0}
# A spout is drawn out of the front of the rim over about this angle and this part of the height.
_SPOUT_ANGLE_RAD = 0.30
SPOUT_DEPTH = 0.22


@cache
def outline(section: Section) -> np.ndarray:
    """Return the outline as drawn, counter-clockwise. -> (N, 2)."""
    if section.kind in _SIDES:
        return _polygon(_SIDES[section.kind], section.corner, _ARC_POINTS[section.kind])
    angles = (np.arange(_ROUND_POINTS) + 0.5) * (2 * np.pi / _ROUND_POINTS)
    return np.stack((section.aspect * np.cos(angles), np.sin(angles)), axis=-1)


@cache
def coarse_outline(section: Section) -> np.ndarray:
    """Return a convex polygon with few sides about as far within the outline as beyond it. -> (K, 2)."""
    kind, corner = section.kind, section.corner
    if kind in _SIDES:
        chords = int(corner > _ONE_CHORD[kind]) + int(corner > _TWO_CHORDS[kind])
        return _polygon(_SIDES[kind], corner if chords else 0.0, chords + 1)
    half_step = np.pi / _ROUND_WALLS
    angles = (2 * np.arange(_ROUND_WALLS) + 1) * half_step
    radius = 2.0 / (1.0 + np.cos(half_step))  # vertices as far outside the circle as edges are inside
    return radius * np.stack((section.aspect * np.cos(angles), np.sin(angles)), axis=-1)


def outline_scale(section: Section, points: np.ndarray) -> np.ndarray:
    """Return the factor by which the outline, or the coarse one if larger there, must be scaled to reach a point.

    Args:
        section: the outline.
        points: (..., 2).

    Returns:
        (...) in the points' units.
    """
    coarse = _polygon_scale(coarse_outline(section), points)
    if section.kind in _SIDES:
        return np.minimum(_polygon_scale(outline(section), points), coarse)
    return np.minimum(np.hypot(points[..., 0] / section.aspect, points[..., 1]), coarse)


def _polygon_scale(polygon: np.ndarray, points: np.ndarray) -> np.ndarray:
    edges = np.roll(polygon, -1, axis=0) - polygon
    normals = np.stack((edges[:, 1], -edges[:, 0]), axis=-1)
    distances = dot(normals, polygon)
    reached = matmul(points[..., None, :], (normals / distances[:, None]).T)[..., 0, :]
    return np.asarray(reached.max(axis=-1))


def _polygon(sides: int, corner: float, arc: int) -> np.ndarray:
    """Return a regular polygon with apothem 1, flat towards +y, whose corners are arcs of `arc` points."""
    turn = 2 * np.pi / sides
    middles = np.pi / 2 + (np.arange(sides) + 0.5) * turn
    if arc == 1 or corner <= 0:
        return np.stack((np.cos(middles), np.sin(middles)), axis=-1) / np.cos(turn / 2)
    centres = (1.0 - corner) / np.cos(turn / 2) * np.stack((np.cos(middles), np.sin(middles)), axis=-1)
    angles = middles[:, None] + np.linspace(-turn / 2, turn / 2, arc)
    return (centres[:, None] + corner * np.stack((np.cos(angles), np.sin(angles)), axis=-1)).reshape(-1, 2)


def polygon_area(points: np.ndarray) -> float:
    """Return the area of a polygon whose corners (N, 2) run counter-clockwise."""
    ahead = np.roll(points, -1, axis=0)
    return 0.5 * float((points[:, 0] * ahead[:, 1] - points[:, 1] * ahead[:, 0]).sum())


def half_width(profile: Profile, z: np.ndarray | float) -> np.ndarray:
    """Return the half width of the wall's outer face at heights, along y, without the lip."""
    heights, widths = np.array(profile.knots).T
    return np.interp(z, heights, widths)


def spout_bulge(angle_rad: np.ndarray, z: np.ndarray, rim_z: float, spout_m: float) -> np.ndarray:
    """Return how far a spout moves the wall outwards.

    Args:
        angle_rad: around the axis, from +x; the spout is at pi, the front.
        z: heights.
        rim_z: height of the rim.
        spout_m: at the rim's foremost point.
    """
    off = np.abs(np.mod(angle_rad, 2 * np.pi) - np.pi) / _SPOUT_ANGLE_RAD
    depth = SPOUT_DEPTH * rim_z
    rise = np.clip((z - rim_z + depth) / depth, 0.0, 1.0)
    return spout_m * exp(-(off**2)) * rise**2


class Rim(NamedTuple):
    """What a bail must clear."""

    section: Section
    profile: Profile
    lip: Lip
    spout_m: float


def clearance_m(rim: Rim, points: np.ndarray, margin_m: float) -> np.ndarray:
    """Estimate how far points are outside the wall and its lip; infinite well above the rim.

    Args:
        rim: the bucket's.
        points: (..., 3) in the object frame.
        margin_m: height above and below the lip within which a point counts as beside it.
    """
    section, profile, lip, spout_m = rim
    z = points[..., 2]
    top = profile.knots[-1][0]
    at = np.minimum(z, top)
    widths = half_width(profile, at)
    widths = widths + np.where(z >= top - lip.height_m - margin_m, lip.overhang_m, 0.0)
    widths = widths + spout_bulge(arctan2(points[..., 1], points[..., 0]), at, top, spout_m)
    reached = outline_scale(section, points[..., :2])
    away = reached - widths
    if section.aspect < 1:  # an oval's half width differs with the direction
        away = away * np.hypot(points[..., 0], points[..., 1]) / reached
    return np.where(z > top + margin_m, np.inf, away)
