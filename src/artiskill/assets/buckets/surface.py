"""The outer face of a bucket as a function: half widths by height, the spout's bulge, and distances from it."""

import numpy as np

from artiskill.assets.buckets.section import gauge
from artiskill.assets.buckets.spec import Lip, Profile, Section
from artiskill.geometry.arrays import arctan2, exp

# A spout is drawn out of the front of the rim over about this angle and this part of the height.
_SPOUT_ANGLE_RAD = 0.30
SPOUT_DEPTH = 0.22


def half_width(profile: Profile, z: np.ndarray | float) -> np.ndarray:
    """Half width of the wall's outer face at a height, along y, without the lip."""
    heights, widths = np.array(profile.knots).T
    return np.interp(z, heights, widths)


def side_y(section: Section, profile: Profile, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """How far from the axis the wall's outer face is, along y, at places near the middle of its side."""
    widths = half_width(profile, z)
    if section.kind not in ("round", "oval"):
        return widths
    return widths * np.sqrt(np.maximum(1.0 - (x / (widths * section.aspect)) ** 2, 0.0))


def spout_bulge(angle_rad: np.ndarray, z: np.ndarray, rim_z: float, spout_m: float) -> np.ndarray:
    """How far a spout moves the wall outwards.

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


def clearance_m(
    section: Section, profile: Profile, lip: Lip, spout_m: float, points: np.ndarray, margin_m: float
) -> np.ndarray:
    """About how far points are outside the wall and its lip; infinite for points well above the rim.

    Args:
        section: the outline.
        profile: the wall.
        lip: its rim.
        spout_m: of its spout.
        points: (..., 3) in the object frame.
        margin_m: height above and below the lip within which a point counts as beside it.
    """
    z = points[..., 2]
    rim = profile.knots[-1][0]
    at = np.minimum(z, rim)
    widths = half_width(profile, at)
    widths = widths + np.where(z >= rim - lip.height_m - margin_m, lip.overhang_m, 0.0)
    widths = widths + spout_bulge(arctan2(points[..., 1], points[..., 0]), at, rim, spout_m)
    reached = gauge(section, points[..., :2])
    away = reached - widths
    if section.aspect < 1:  # an oval's half width differs with the direction
        away = away * np.hypot(points[..., 0], points[..., 1]) / reached
    return np.where(z > rim + margin_m, np.inf, away)
