"""Front panels: which faces there are, what of them is touched, and where their surface lies under a handle."""

import numpy as np

from artiskill.assets.articulated_object import Material
from artiskill.assets.cabinets.boards import Boards
from artiskill.assets.cabinets.faces import FrontMaterials, add_framed, add_pierced, add_planks, frame_opening
from artiskill.assets.cabinets.pulls import Sinks
from artiskill.assets.cabinets.spec import CabinetSpec, Cell, HandlePlace, Rect

BOW_POINTS = 13  # of a bowed face
_HOLE_MARGIN_M = 0.0015  # a hollow's lining lies within the hole of the front


def add_front(parts: Boards, spec: CabinetSpec, cell: Cell, materials: FrontMaterials, part: str) -> None:
    """Add the front panel of a cell to a link: as few convex shapes as can be are touched, whatever is drawn."""
    assert cell.front is not None
    rect, x0, x1 = cell.front, spec.face_x, spec.face_x + spec.front.thickness_m
    hole = hollow(spec, cell)
    if hole is not None:
        add_pierced(parts, rect, hole, (x0, x1), materials.front, part)
        return
    if spec.front.bow_m > 0:
        _add_bowed(parts, spec, rect, materials.front, part)
        return
    if cell.face == "slab":
        parts.panel((x0, rect.y0, rect.z0), (x1, rect.y1, rect.z1), materials.front, part)
        return
    if cell.face == "planks":
        add_planks(parts, spec, rect, materials.front, part)
    else:
        add_framed(parts, spec, cell, materials, part)
    parts.add_collision_box((x0, rect.y0, rect.z0), (x1, rect.y1, rect.z1), part)


def front_shapes(spec: CabinetSpec, cell: Cell) -> int:
    """How many shapes of a front are touched."""
    return 4 if hollow(spec, cell) is not None else 1


def hollow(spec: CabinetSpec, cell: Cell) -> Rect | None:
    """The hole in a front in which a flush handle lies, or None."""
    if cell.handle is None or spec.handle_of(cell).kind != "slot":
        return None
    dy, dz = (r + _HOLE_MARGIN_M for r in cell.handle.reach(spec.handle_of(cell)))
    y, z = cell.handle.y, cell.handle.z
    return Rect(y - dy, y + dy, z - dz, z + dz)


def bowed_outline(spec: CabinetSpec, y0: float, y1: float, x1: float, out_m: float) -> np.ndarray:
    """Seen from above, counter-clockwise: straight behind at `x1`, in front `out_m` before the fronts' face."""
    y = np.linspace(y1, y0, BOW_POINTS)
    x = spec.face_x - out_m - np.array([spec.bulge_m(float(at)) for at in y])
    face = np.stack((x, y), axis=-1)
    return np.concatenate((face, ((x1, y0), (x1, y1))))


def _add_bowed(parts: Boards, spec: CabinetSpec, rect: Rect, material: Material, part: str) -> None:
    outline = bowed_outline(spec, rect.y0, rect.y1, spec.face_x + spec.front.thickness_m, 0.0)
    parts.prism(outline, rect.z0, rect.z1, material, part)


def sinks(spec: CabinetSpec, cell: Cell, place: HandlePlace) -> Sinks:
    """How far behind the face at the handle's middle the surface lies under its feet."""
    low, middle, high = (_sink(spec, cell, place, k * place.length_m / 2) for k in (-1, 0, 1))
    return low, middle, high


def _sink(spec: CabinetSpec, cell: Cell, place: HandlePlace, offset: float) -> float:
    assert cell.front is not None
    y, z = (place.y, place.z + offset) if place.vertical else (place.y + offset, place.z)
    bulge = spec.bulge_m(place.y) - spec.bulge_m(y)
    if cell.face in ("slab", "planks"):
        return bulge
    field = frame_opening(spec, cell.front)
    inside = field.y0 < y < field.y1 and field.z0 < z < field.z1
    return bulge + (spec.front.recess_m if inside else 0.0)


def handle_foot(spec: CabinetSpec, place: HandlePlace) -> np.ndarray:
    """The point of the fronts' outer face behind a handle's centre, object frame."""
    return np.array((spec.face_x - spec.bulge_m(place.y), place.y, place.z))
