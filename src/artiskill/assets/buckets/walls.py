"""The body of a bucket as touched: prisms side by side around it, and a floor.

The prisms' outer faces hug the drawn wall; they are thicker than it, inwards, so that pads close on a slab and
a ball that moves several millimetres per physics step never meets a thin sheet.
"""

from itertools import pairwise

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.buckets.section import coarse_outline
from artiskill.assets.buckets.spec import BucketSpec
from artiskill.assets.buckets.surface import half_width
from artiskill.assets.parts import IDENTITY, LinkParts, standing_disc

WALL_M = 0.007
FLOOR_M = 0.006
# A lip that stands out farther is touched on its own.
WIDE_LIP_M = 0.0075
_ABOVE_GROUND_M = 0.002  # only the floor and the foot's disc touch the ground
_OVAL_ANGLES = np.radians((27.0, 63.0))


def add_walls(parts: LinkParts, spec: BucketSpec) -> None:
    """Add what is touched of the body but the ears."""
    _add_floor(parts, spec)
    levels = [max(spec.profile.levels[0], _ABOVE_GROUND_M), *spec.profile.levels[1:]]
    thickness = max(WALL_M, spec.wall_m)
    for low, high in pairwise(levels):
        rows = [(float(half_width(spec.profile, z)), z) for z in (low, high)]
        _add_ring(parts, spec, rows, thickness, "wall")
    if spec.lip.overhang_m > WIDE_LIP_M:
        outer, height = spec.top_m + spec.lip.overhang_m, max(spec.lip.height_m, 0.005)
        rows = [(outer, spec.height_m - height), (outer, spec.height_m)]
        _add_ring(parts, spec, rows, spec.lip.overhang_m + WALL_M / 2, "lip")


def _add_ring(
    parts: LinkParts, spec: BucketSpec, rows: list[tuple[float, float]], thickness_m: float, part: str
) -> None:
    """One prism per side of the coarse outline, between two heights given as (half width, height)."""
    polygon = coarse_outline(spec.section)
    for start, end in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        edge = np.array((start, end))
        corners = np.concatenate(
            [
                np.column_stack((scale * edge, (z, z)))
                for width, z in rows
                for scale in (width, width - thickness_m)
            ]
        )
        _touch_hull(parts, corners, part)


def _touch_hull(parts: LinkParts, corners: np.ndarray, part: str) -> None:
    centre = corners.mean(axis=0)
    parts.add_collision(CollisionShape("hull", (), parts.local(centre), IDENTITY, corners - centre, part))


def _add_floor(parts: LinkParts, spec: BucketSpec) -> None:
    """A slab from the ground to the floor's upper face: foot and floor in one."""
    high = max(spec.floor_z, FLOOR_M)
    radius = float(half_width(spec.profile, spec.foot.height_m)) - spec.foot.inset_m
    centre = parts.local((0.0, 0.0, high / 2))
    if spec.section.kind == "oval":
        for angle in _OVAL_ANGLES:
            half = radius * spec.section.aspect * np.cos(angle), radius * np.sin(angle), high / 2
            parts.add_collision(CollisionShape("box", tuple(map(float, half)), centre, IDENTITY, part="floor"))
    elif spec.section.kind == "square":
        parts.add_collision(CollisionShape("box", (radius, radius, high / 2), centre, IDENTITY, part="floor"))
    else:
        parts.add_collision(standing_disc(radius, 0.0, high, "floor"))
