"""A cabinet's carcass: panels, top, support, dividers, shelves and blind fronts; and the boxes of its drawers."""

from collections.abc import Iterator

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.cabinets.cells import BOX_FLOOR_M, RUNNER_SPACE_M
from artiskill.assets.cabinets.fronts import add_front, add_hinge_arms, bowed_outline
from artiskill.assets.cabinets.spec import CabinetSpec, Cell
from artiskill.assets.finishes import Materials
from artiskill.assets.parts import IDENTITY, TO_Y, LinkParts
from artiskill.geometry.primitives import cylinder, lathe, loft

BOX_SHAPES = 4  # collision shapes of a drawer's box
_RUNNER_M = (0.009, 0.036)  # thickness and height of what is seen of a runner
_BOTTOM_GROOVE_M = 0.008  # a drawer's bottom sits this far above its sides' lower edge
_SEGMENTS = 14
_TAPER = 0.62  # a round leg's foot, relative to its top
_SPLAY = 0.28  # how far a splayed leg's foot stands outside its top, relative to its height
_BUN = ((0.55, 0.0), (0.85, 0.12), (1.0, 0.4), (0.9, 0.68), (0.55, 0.86), (0.7, 0.9), (0.7, 1.0))  # radius, height
_PLATE_M = 0.004  # of a caster
_SUPPORT_SHAPES = {"plinth": 1, "sides": 1, "legs": 4, "casters": 4, "floor": 0, "wall": 1, "sled": 6}


def add_carcass(parts: LinkParts, spec: CabinetSpec, materials: Materials) -> None:
    """Add everything that does not move."""
    x0, x1 = -spec.depth_m / 2, spec.depth_m / 2
    y0, y1 = -spec.width_m / 2, spec.width_m / 2
    floor, ceiling = spec.support.height_m, spec.height_m - spec.top.thickness_m
    foot = 0.0 if spec.support.kind == "sides" else floor
    t = spec.panel_m
    parts.add_panel((x0, y0, foot), (x1, y0 + t, ceiling), materials["carcass"], "frame", grain=2)
    parts.add_panel((x0, y1 - t, foot), (x1, y1, ceiling), materials["carcass"], "frame", grain=2)
    parts.add_panel((x0, y0 + t, floor), (x1, y1 - t, floor + t), materials["carcass"], "frame", grain=1)
    _add_top(parts, spec, materials)
    # a back that is always in sight matches the carcass
    back = materials["carcass"] if spec.count("open") else materials["interior"]
    parts.add_panel((x1 - spec.back_m, y0 + t, floor + t), (x1, y1 - t, ceiling), back, "back", grain=2)
    for board in spec.boards:
        r = board.rect
        parts.add_panel((board.x0, r.y0, r.z0), (board.x1, r.y1, r.z1), materials["carcass"], board.part)
    for cell in spec.cells:
        if cell.kind == "blind":
            add_front(parts, spec, cell, materials, "blind_panel")
        elif cell.kind == "door":
            add_hinge_arms(parts, spec, cell, materials["runner"])
    _add_support(parts, spec, materials)


def _add_top(parts: LinkParts, spec: CabinetSpec, materials: Materials) -> None:
    """Add one board, or several that each stand out over the one below, and an upstand along the wall."""
    top = spec.top
    x0, x1, half = -spec.depth_m / 2, spec.depth_m / 2, spec.width_m / 2
    z = spec.height_m - top.thickness_m
    for k in range(1, top.steps + 1):
        share, upper = k / top.steps, z + top.thickness_m / top.steps
        over, side = top.front_m * share, top.side_m * share
        if spec.front.bow_m > 0:
            out = over - (x0 - spec.face_x)
            outline = bowed_outline(spec, -half - side, half + side, x1, out)
            parts.add_prism(outline, z, upper, materials["top"], "top")
        else:
            parts.add_panel(
                (x0 - over, -half - side, z), (x1, half + side, upper), materials["top"], "top", grain=1
            )
        z = upper
    if top.upstand_m > 0:
        low, high = (x1 - spec.panel_m, -half, z), (x1, half, z + top.upstand_m)
        parts.add_panel(low, high, materials["top"], "upstand", grain=1)


def _add_support(parts: LinkParts, spec: CabinetSpec, materials: Materials) -> None:
    """Add what is below the carcass."""
    support = spec.support
    if support.kind == "plinth":
        _add_plinth(parts, spec, materials)
    elif support.kind == "sides":
        _add_kick_board(parts, spec, materials)
    elif support.kind == "casters":
        for x, y in _corners(spec):
            _add_caster(parts, spec, materials, x, y)
    elif support.kind == "legs" and support.leg_shape == "sled":
        _add_sled(parts, spec, materials)
    elif support.kind == "legs":
        for x, y in _corners(spec):
            _add_leg(parts, spec, materials, x, y)


def _corners(spec: CabinetSpec) -> Iterator[tuple[float, float]]:
    """Yield where legs stand."""
    inset = spec.support.setback_m + spec.support.leg_m / 2
    for sx in (-1, 1):
        for sy in (-1, 1):
            yield sx * (spec.depth_m / 2 - inset), sy * (spec.width_m / 2 - inset)


def _add_plinth(parts: LinkParts, spec: CabinetSpec, materials: Materials) -> None:
    """Add a block that stands for a closed ring of boards, set back at the front so that toes fit under."""
    x0 = -spec.depth_m / 2 + spec.support.setback_m
    half_y = spec.width_m / 2
    parts.add_panel(
        (x0, -half_y, 0.0), (spec.depth_m / 2, half_y, spec.support.height_m), materials["support"], "plinth"
    )


def _add_kick_board(parts: LinkParts, spec: CabinetSpec, materials: Materials) -> None:
    x0, inside = -spec.depth_m / 2 + spec.support.setback_m, spec.width_m / 2 - spec.panel_m
    low, high = (x0, -inside, 0.0), (x0 + spec.panel_m, inside, spec.support.height_m)
    parts.add_panel(low, high, materials["support"], "plinth", grain=1)


def _add_leg(parts: LinkParts, spec: CabinetSpec, materials: Materials, x: float, y: float) -> None:
    support = spec.support
    radius, height = support.leg_m / 2, support.height_m
    if support.leg_shape == "square":
        low, high = (x - radius, y - radius, 0.0), (x + radius, y + radius, height)
        parts.add_panel(low, high, materials["support"], "leg")
        return
    if support.leg_shape == "splayed":
        _add_splayed_leg(parts, materials, (x, y), radius, height)
        return
    if support.leg_shape == "bun":
        profile = [(0.0, 0.0), *((r * radius, z * height) for r, z in _BUN), (0.0, height)]
        size = (0.9 * radius, height / 2)
    else:
        foot = _TAPER * radius
        profile = [(0.0, 0.0), (foot, 0.0), (radius, height), (0.0, height)]
        size = ((radius + foot) / 2, height / 2)
    parts.add_visual(lathe(profile, _SEGMENTS).transformed(parts.local((x, y, 0.0))), materials["support"], "leg")
    parts.add_collision(CollisionShape("cylinder", size, parts.local((x, y, height / 2)), IDENTITY, part="leg"))


def _add_splayed_leg(
    parts: LinkParts, materials: Materials, top: tuple[float, float], radius: float, height: float
) -> None:
    """Add a round, tapered leg that leans out to the corner, its foot flat on the ground."""
    angles = np.arange(_SEGMENTS) * (2 * np.pi / _SEGMENTS)
    circle = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    out = np.sign(top) * _SPLAY * height / np.sqrt(2)
    rings = [
        np.column_stack((np.asarray(top) + out + _TAPER * radius * circle, np.zeros(_SEGMENTS))),
        np.column_stack((np.asarray(top) + radius * circle, np.full(_SEGMENTS, height))),
    ]
    parts.add_visual(loft(rings).transformed(parts.local((0.0, 0.0, 0.0))), materials["support"], "leg")
    corners = np.concatenate([ring[::2] for ring in rings])
    centre = corners.mean(axis=0)
    parts.add_collision(CollisionShape("hull", (), parts.local(centre), IDENTITY, corners - centre, "leg"))


def _add_sled(parts: LinkParts, spec: CabinetSpec, materials: Materials) -> None:
    """Add two frames of square tube, one under each side."""
    s = spec.support
    x0, x1 = -spec.depth_m / 2 + s.setback_m, spec.depth_m / 2 - s.setback_m
    for sign in (-1, 1):
        y = sign * (spec.width_m / 2 - s.setback_m - s.leg_m / 2)
        low, high = y - s.leg_m / 2, y + s.leg_m / 2
        parts.add_panel((x0, low, 0.0), (x1, high, s.leg_m), materials["support"], "leg")
        parts.add_panel((x0, low, s.leg_m), (x0 + s.leg_m, high, s.height_m), materials["support"], "leg")
        parts.add_panel((x1 - s.leg_m, low, s.leg_m), (x1, high, s.height_m), materials["support"], "leg")


def _add_caster(parts: LinkParts, spec: CabinetSpec, materials: Materials, x: float, y: float) -> None:
    """Add a small wheel in a fork under a plate; it does not turn."""
    radius, height = spec.support.leg_m / 2, spec.support.height_m
    half = 0.38 * radius
    wheel = cylinder(radius, half, 16, 0.15 * radius).transformed(parts.local((x, y, radius)), TO_Y)
    parts.add_visual(wheel, materials["tyre"], "caster")
    fork, above = half + 0.004, height - _PLATE_M
    for inner, outer in ((-fork, -half), (half, fork)):
        cheek = (x - 0.5 * radius, y + inner, 0.9 * radius), (x + 0.5 * radius, y + outer, above)
        parts.add_panel(*cheek, materials["runner"], "caster", collide=False)
    plate = min(1.1 * radius, spec.support.setback_m + radius)
    corners = (x - plate, y - plate, above), (x + plate, y + plate, height)
    parts.add_panel(*corners, materials["runner"], "caster", collide=False)
    parts.add_collision_box((x - 0.85 * radius, y - fork, 0.0), (x + 0.85 * radius, y + fork, height), "caster")


def add_box(parts: LinkParts, spec: CabinetSpec, cell: Cell, materials: Materials) -> None:
    """Add sides, back, bottom and runners; the box is open at the top."""
    x0 = spec.face_x + spec.front.thickness_m
    x1 = x0 + cell.box_length_m
    y0, y1 = cell.clear.y0 + RUNNER_SPACE_M, cell.clear.y1 - RUNNER_SPACE_M
    z0 = cell.clear.z0 + BOX_FLOOR_M
    z1 = z0 + cell.box_height_m
    t = spec.side_m
    inside = materials["interior"]
    parts.add_panel((x0, y0, z0), (x1, y0 + t, z1), inside, "drawer_side", grain=0)
    parts.add_panel((x0, y1 - t, z0), (x1, y1, z1), inside, "drawer_side", grain=0)
    parts.add_panel((x1 - t, y0 + t, z0), (x1, y1 - t, z1), inside, "drawer_back", grain=1)
    floor = z0 + _BOTTOM_GROOVE_M
    parts.add_panel((x0, y0 + t, floor), (x1 - t, y1 - t, floor + spec.bottom_m), inside, "drawer_bottom", grain=0)
    thick, high = _RUNNER_M[0], min(_RUNNER_M[1], cell.box_height_m - 0.006)
    middle = (z0 + z1) / 2
    for low in (y0 - thick, y1):
        corners = (x0, low, middle - high / 2), (x1, low + thick, middle + high / 2)
        parts.add_panel(*corners, materials["runner"], "runner", collide=False)


def carcass_shapes(spec: CabinetSpec) -> int:
    """Return how many collision shapes the carcass has, its support and the wall that it hangs on included."""
    sled = spec.support.kind == "legs" and spec.support.leg_shape == "sled"
    support = _SUPPORT_SHAPES["sled" if sled else spec.support.kind]
    return 4 + spec.top.steps + (spec.top.upstand_m > 0) + len(spec.boards) + spec.count("blind") + support
