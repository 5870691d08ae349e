"""What a bucket weighs: areas times the real thickness of its sheet, and the bail by its volume."""

import math

import numpy as np

from artiskill.assets.buckets.section import outline
from artiskill.assets.buckets.spec import Bail, Profile, Section
from artiskill.geometry.arrays import norm

_RIM_FACTOR = 1.12  # lip, foot and ears, relative to wall and floor
_STEEL_KG_M3 = 7850.0
_PLASTIC_KG_M3 = 920.0
_GRIP_KG_M3 = 700.0  # beech, or a hollow plastic sleeve


def body_mass_kg(section: Section, profile: Profile, gauge_m: float, density_kg_m3: float) -> float:
    """Mass without the bail."""
    points = outline(section)
    ahead = np.roll(points, -1, axis=0)
    perimeter = float(norm(ahead - points).sum())
    floor = 0.5 * float((points[:, 0] * ahead[:, 1] - points[:, 1] * ahead[:, 0]).sum())
    heights, widths = np.array(profile.knots).T
    slant = np.hypot(np.diff(heights), np.diff(widths))
    area = perimeter * float((slant * (widths[1:] + widths[:-1]) / 2).sum()) + floor * widths[0] ** 2
    return round(float(area) * gauge_m * density_kg_m3 * _RIM_FACTOR, 3)


def bail_mass_kg(bail: Bail | None) -> float:
    """Mass of the bail and its grip."""
    if bail is None:
        return 0.0
    length = bail_length_m(bail)
    if bail.kind == "wire":
        mass = math.pi * bail.half_width_m**2 * length * _STEEL_KG_M3
    else:
        density = _STEEL_KG_M3 if bail.kind == "strap" else _PLASTIC_KG_M3
        mass = 4 * bail.half_width_m * bail.half_thickness_m * length * density
    if bail.grip.kind != "bare":
        mass += math.pi * bail.grip.radius_m**2 * bail.grip.length_m * _GRIP_KG_M3
    return round(mass, 3)


def bail_length_m(bail: Bail) -> float:
    """Along its middle line, from pivot to pivot."""
    c = bail.corner_m
    return 2 * (bail.reach_m - c) + math.pi * c + 2 * (bail.half_span_m - c)
