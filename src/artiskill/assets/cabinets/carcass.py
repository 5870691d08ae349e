"""The part of a cabinet that stands still: panels, top, support, dividers, shelves and blind fronts."""

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.cabinets.fronts import add_front
from artiskill.assets.cabinets.materials import Materials
from artiskill.assets.cabinets.parts import IDENTITY, LinkParts
from artiskill.assets.cabinets.spec import CabinetSpec
from artiskill.geometry.meshes import lathe

_LEG_SEGMENTS = 14
_TAPER = 0.62  # a round leg's foot, relative to its top


def add_carcass(parts: LinkParts, spec: CabinetSpec, materials: Materials) -> None:
    """Add everything that does not move."""
    x0, x1 = -spec.depth_m / 2, spec.depth_m / 2
    y0, y1 = -spec.width_m / 2, spec.width_m / 2
    floor, ceiling = spec.support.height_m, spec.height_m - spec.top.thickness_m
    t = spec.panel_m
    parts.panel((x0, y0, floor), (x1, y0 + t, ceiling), materials.carcass, "frame", grain=2)
    parts.panel((x0, y1 - t, floor), (x1, y1, ceiling), materials.carcass, "frame", grain=2)
    parts.panel((x0, y0 + t, floor), (x1, y1 - t, floor + t), materials.carcass, "frame", grain=1)
    over, side = spec.top.front_m, spec.top.side_m
    parts.panel((x0 - over, y0 - side, ceiling), (x1, y1 + side, spec.height_m), materials.top, "top", grain=1)
    # a back that is always in sight matches the carcass
    back = materials.carcass if spec.count("open") else materials.interior
    parts.panel((x1 - spec.back_m, y0 + t, floor + t), (x1, y1 - t, ceiling), back, "back", grain=2)
    for board in spec.boards:
        r = board.rect
        parts.panel((board.x0, r.y0, r.z0), (board.x1, r.y1, r.z1), materials.carcass, board.part)
    for cell in spec.cells:
        if cell.kind == "blind":
            add_front(parts, spec, cell, materials.front, "blind_panel")
    if spec.support.kind == "plinth":
        _add_plinth(parts, spec, materials)
    elif spec.support.kind == "legs":
        _add_legs(parts, spec, materials)


def _add_plinth(parts: LinkParts, spec: CabinetSpec, materials: Materials) -> None:
    """A closed ring of boards, set back at the front so that toes fit under; seen and touched as a block."""
    x0 = -spec.depth_m / 2 + spec.support.setback_m
    half_y = spec.width_m / 2
    parts.panel((x0, -half_y, 0.0), (spec.depth_m / 2, half_y, spec.support.height_m), materials.support, "plinth")


def _add_legs(parts: LinkParts, spec: CabinetSpec, materials: Materials) -> None:
    """Four legs, round and tapered or square."""
    support = spec.support
    radius, half = support.leg_m / 2, support.height_m / 2
    for sx in (-1, 1):
        for sy in (-1, 1):
            x = sx * (spec.depth_m / 2 - support.setback_m - radius)
            y = sy * (spec.width_m / 2 - support.setback_m - radius)
            if support.leg_shape == "square":
                low, high = (x - radius, y - radius, 0.0), (x + radius, y + radius, support.height_m)
                parts.panel(low, high, materials.support, "leg")
                continue
            foot = _TAPER * radius
            profile = [(0.0, -half), (foot, -half), (radius, half), (0.0, half)]
            centre = parts.local((x, y, half))
            parts.draw(lathe(profile, _LEG_SEGMENTS).transformed(centre), materials.support, "leg")
            size = ((radius + foot) / 2, half)
            parts.touch(CollisionShape("cylinder", size, np.asarray(centre), IDENTITY, part="leg"))
