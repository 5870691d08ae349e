"""The part of a cabinet that stands still: panels, top, support, dividers, shelves and blind fronts."""

from artiskill.assets.cabinets.boards import Boards
from artiskill.assets.cabinets.faces import FrontMaterials
from artiskill.assets.cabinets.fronts import add_front, bowed_outline
from artiskill.assets.cabinets.hinges import add_hinge_arms
from artiskill.assets.cabinets.materials import Materials
from artiskill.assets.cabinets.spec import CabinetSpec
from artiskill.assets.cabinets.supports import add_support


def add_carcass(parts: Boards, spec: CabinetSpec, materials: Materials) -> None:
    """Add everything that does not move."""
    x0, x1 = -spec.depth_m / 2, spec.depth_m / 2
    y0, y1 = -spec.width_m / 2, spec.width_m / 2
    floor, ceiling = spec.support.height_m, spec.height_m - spec.top.thickness_m
    foot = 0.0 if spec.support.kind == "sides" else floor
    t = spec.panel_m
    parts.panel((x0, y0, foot), (x1, y0 + t, ceiling), materials.carcass, "frame", grain=2)
    parts.panel((x0, y1 - t, foot), (x1, y1, ceiling), materials.carcass, "frame", grain=2)
    parts.panel((x0, y0 + t, floor), (x1, y1 - t, floor + t), materials.carcass, "frame", grain=1)
    _add_top(parts, spec, materials)
    # a back that is always in sight matches the carcass
    back = materials.carcass if spec.count("open") else materials.interior
    parts.panel((x1 - spec.back_m, y0 + t, floor + t), (x1, y1 - t, ceiling), back, "back", grain=2)
    for board in spec.boards:
        r = board.rect
        parts.panel((board.x0, r.y0, r.z0), (board.x1, r.y1, r.z1), materials.carcass, board.part)
    fronts = FrontMaterials(materials.front, materials.glass)
    for cell in spec.cells:
        if cell.kind == "blind":
            add_front(parts, spec, cell, fronts, "blind_panel")
        elif cell.kind == "door":
            add_hinge_arms(parts, spec, cell, materials.runner)
    add_support(parts, spec, materials)


def _add_top(parts: Boards, spec: CabinetSpec, materials: Materials) -> None:
    """One board, or several that each stand out over the one below, and a board along the wall."""
    top = spec.top
    x0, x1, half = -spec.depth_m / 2, spec.depth_m / 2, spec.width_m / 2
    z = spec.height_m - top.thickness_m
    for k in range(1, top.steps + 1):
        share, upper = k / top.steps, z + top.thickness_m / top.steps
        over, side = top.front_m * share, top.side_m * share
        if spec.front.bow_m > 0:
            out = over - (x0 - spec.face_x)
            outline = bowed_outline(spec, -half - side, half + side, x1, out)
            parts.prism(outline, z, upper, materials.top, "top")
        else:
            parts.panel((x0 - over, -half - side, z), (x1, half + side, upper), materials.top, "top", grain=1)
        z = upper
    if top.upstand_m > 0:
        low, high = (x1 - spec.panel_m, -half, z), (x1, half, z + top.upstand_m)
        parts.panel(low, high, materials.top, "upstand", grain=1)


def carcass_shapes(spec: CabinetSpec) -> int:
    """How many shapes of the carcass are touched, without its support."""
    return 4 + spec.top.steps + (spec.top.upstand_m > 0) + len(spec.boards) + spec.count("blind")
