"""Front panels: slabs, planks, frames with a field, panes or slats, bowed and pierced boards; and their hinges."""

import math

import numpy as np

from artiskill.assets.articulated_object import Material
from artiskill.assets.cabinets.pulls import Sinks
from artiskill.assets.cabinets.spec import CabinetSpec, Cell, HandlePlace, Rect, Side
from artiskill.assets.finishes import Materials
from artiskill.assets.parts import TO_X, TO_Y, LinkParts
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import box, cylinder, frustum
from artiskill.geometry.rotations import quat_from_axis_angle

BOW_POINTS = 13  # of a bowed face
_HOLE_MARGIN_M = 0.0015  # a cavity's lining lies within the hole of the front
_FIELD_M = 0.006  # thickness of a field, of a pane
_RAISED_EDGE_M = 0.034  # width of a raised field's slope
_MUNTIN_M = 0.018
_SLAT_M = 0.005  # thickness of a slat
_SLAT_OVERLAP = 1.1  # its height, relative to the distance of two
_BACKING_M = 0.002
_GROOVE_M = 0.0035  # width of the groove between planks
_BARREL_HALF_M = 0.024  # of its length
_HINGE_END_M = 0.09  # from a door's end to the middle of its barrel, on small doors less
# Cup hinges after makers' data sheets: a cup of 35 mm, its middle 22.5 mm from the door's edge, an arm inside.
_CUP_M = (0.0175, 0.0225)  # radius, distance from the edge
_CUP_PROUD_M = 0.0012
_ARM_M = (0.006, 0.011)  # half of its thickness, which lies on the board, and of its width
_ARM_INSIDE_M = 0.055  # how far it reaches into the carcass
_ARM_CLEAR_M = 0.004  # its end stays so far behind the door's outer face


def add_front(parts: LinkParts, spec: CabinetSpec, cell: Cell, materials: Materials, part: str) -> None:
    """Add the front panel of a cell to a link, with as few collision shapes as can be, whatever it looks like."""
    assert cell.front is not None
    rect, x0, x1 = cell.front, spec.face_x, spec.face_x + spec.front.thickness_m
    hole = handle_cavity(spec, cell)
    if hole is not None:
        _add_pierced(parts, rect, hole, (x0, x1), materials["front"], part)
        return
    if spec.front.bow_m > 0:
        _add_bowed(parts, spec, rect, materials["front"], part)
        return
    if cell.face == "slab":
        parts.add_panel((x0, rect.y0, rect.z0), (x1, rect.y1, rect.z1), materials["front"], part)
        return
    if cell.face == "planks":
        _add_planks(parts, spec, rect, materials["front"], part)
    else:
        _add_framed(parts, spec, cell, materials, part)
    parts.add_collision_box((x0, rect.y0, rect.z0), (x1, rect.y1, rect.z1), part)


def handle_cavity(spec: CabinetSpec, cell: Cell) -> Rect | None:
    """Return the hole in a front in which a flush handle lies, or None."""
    if cell.handle is None or spec.handle_of(cell).kind != "slot":
        return None
    dy, dz = (r + _HOLE_MARGIN_M for r in cell.handle.reach(spec.handle_of(cell)))
    y, z = cell.handle.y, cell.handle.z
    return Rect(y - dy, y + dy, z - dz, z + dz)


def bowed_outline(spec: CabinetSpec, y0: float, y1: float, x1: float, out_m: float) -> np.ndarray:
    """Return an outline seen from above, (P, 2), counter-clockwise.

    It is straight behind, at `x1`, and runs `out_m` before the fronts' face in front.
    """
    y = np.linspace(y1, y0, BOW_POINTS)
    x = spec.face_x - out_m - np.array([spec.bulge_m(float(at)) for at in y])
    face = np.stack((x, y), axis=-1)
    return np.concatenate((face, ((x1, y0), (x1, y1))))


def _add_bowed(parts: LinkParts, spec: CabinetSpec, rect: Rect, material: Material, part: str) -> None:
    outline = bowed_outline(spec, rect.y0, rect.y1, spec.face_x + spec.front.thickness_m, 0.0)
    parts.add_prism(outline, rect.z0, rect.z1, material, part)


def _frame_opening(spec: CabinetSpec, rect: Rect) -> Rect:
    """Return the field within a framed front; its members are narrower on small fronts."""
    side = min(spec.front.frame_m, rect.width / 3.5)
    rail = min(spec.front.frame_m, rect.height / 3.5)
    return Rect(rect.y0 + side, rect.y1 - side, rect.z0 + rail, rect.z1 - rail)


def _add_framed(parts: LinkParts, spec: CabinetSpec, cell: Cell, materials: Materials, part: str) -> None:
    """Add the meshes of a frame and what it holds; the grain runs along each member."""
    assert cell.front is not None
    rect, x0, x1 = cell.front, spec.face_x, spec.face_x + spec.front.thickness_m
    inner = _frame_opening(spec, rect)
    for z0, z1, y0, y1 in (
        (rect.z0, rect.z1, rect.y0, inner.y0),
        (rect.z0, rect.z1, inner.y1, rect.y1),
        (rect.z0, inner.z0, inner.y0, inner.y1),
        (inner.z1, rect.z1, inner.y0, inner.y1),
    ):
        parts.add_panel((x0, y0, z0), (x1, y1, z1), materials["front"], part, collide=False)
    if cell.face == "louvred":
        _add_slats(parts, spec, inner, materials["front"], part)
        return
    pane = cell.face == "glazed"
    field = x0 + spec.front.recess_m
    parts.add_panel(
        (field, inner.y0, inner.z0),
        (min(field + _FIELD_M, x1), inner.y1, inner.z1),
        materials["glass"] if pane else materials["front"],
        "pane" if pane else part,
        grain=2 if rect.height > rect.width else 1,
        collide=False,
    )
    if pane:
        _add_muntins(parts, spec, inner, materials["front"], part)
    elif cell.face == "raised":
        _add_raised(parts, spec, inner, materials["front"], part)


def _add_raised(parts: LinkParts, spec: CabinetSpec, inner: Rect, material: Material, part: str) -> None:
    edge = min(_RAISED_EDGE_M, 0.3 * min(inner.width, inner.height))
    gap = 0.15 * edge
    low = ((inner.y0 + gap, inner.z0 + gap), (inner.y1 - gap, inner.z1 - gap))
    high = ((inner.y0 + edge, inner.z0 + edge), (inner.y1 - edge, inner.z1 - edge))
    depth = spec.front.recess_m
    mesh = frustum(low, high, spec.face_x + depth + 0.001, depth)
    parts.add_mapped(mesh, 2 if inner.height > inner.width else 1, material, part)


def _add_muntins(parts: LinkParts, spec: CabinetSpec, inner: Rect, material: Material, part: str) -> None:
    """Add bars that divide the pane, 1 mm behind the frame's face."""
    columns, rows = spec.front.muntins
    x0, x1, half = spec.face_x + 0.001, spec.face_x + spec.front.recess_m + 0.001, _MUNTIN_M / 2
    for k in range(1, columns):
        y = inner.y0 + k * inner.width / columns
        parts.add_panel((x0, y - half, inner.z0), (x1, y + half, inner.z1), material, part, collide=False)
    for k in range(1, rows):
        z = inner.z0 + k * inner.height / rows
        parts.add_panel((x0, inner.y0, z - half), (x1, inner.y1, z + half), material, part, collide=False)


def _add_slats(parts: LinkParts, spec: CabinetSpec, inner: Rect, material: Material, part: str) -> None:
    """Add slats that lean out at their lower edge and overlap, so that nobody looks through."""
    count = max(2, round(inner.height / spec.front.plank_m))
    pitch, thickness = inner.height / count, spec.front.thickness_m
    tall = _SLAT_OVERLAP * pitch
    tilt = math.asin(min((thickness - _SLAT_M) / tall, 0.6))
    half = np.array((_SLAT_M / 2, inner.width / 2, tall / 2))
    turn = quat_from_axis_angle((0, 1, 0), tilt)
    for k in range(count):
        z = inner.z0 + (k + 0.5) * pitch
        parts.add_tilted_panel((spec.face_x + thickness / 2, inner.centre[0], z), half, turn, 1, material, part)
    # what is seen between them
    back = spec.face_x + thickness - _BACKING_M
    parts.add_panel(
        (back, inner.y0, inner.z0), (back + _BACKING_M, inner.y1, inner.z1), material, part, collide=False
    )


def _add_planks(parts: LinkParts, spec: CabinetSpec, rect: Rect, material: Material, part: str) -> None:
    """Add the meshes of upright boards side by side, with grooves, before a thin panel."""
    x0, x1 = spec.face_x, spec.face_x + spec.front.thickness_m
    count = max(2, round(rect.width / spec.front.plank_m))
    pitch = rect.width / count
    for k in range(count):
        y0 = rect.y0 + k * pitch
        low = y0 + (0.0 if k == 0 else _GROOVE_M / 2)
        high = y0 + pitch - (0.0 if k == count - 1 else _GROOVE_M / 2)
        parts.add_panel((x0, low, rect.z0), (x1 - 0.003, high, rect.z1), material, part, grain=2, collide=False)
    parts.add_panel((x1 - 0.004, rect.y0, rect.z0), (x1, rect.y1, rect.z1), material, part, collide=False)


def _add_pierced(
    parts: LinkParts, rect: Rect, hole: Rect, depth_m: tuple[float, float], material: Material, part: str
) -> None:
    """Add a board with a rectangular hole: one mesh, four collision boxes.

    Args:
        parts: the link.
        rect: the board.
        hole: the hole within it.
        depth_m: x of its face and of its back.
        material: of the board.
        part: semantic name.
    """
    x0, x1 = depth_m
    outer = np.array(((rect.y0, rect.z0), (rect.y0, rect.z1), (rect.y1, rect.z1), (rect.y1, rect.z0)))
    inner = np.array(((hole.y0, hole.z0), (hole.y0, hole.z1), (hole.y1, hole.z1), (hole.y1, hole.z0)))
    loop = [(x0, outer), (x0, inner), (x1, inner), (x1, outer)]
    vertices = np.concatenate([np.column_stack((np.full(4, x), yz)) for x, yz in loop])
    faces = []
    for ring in range(4):
        for k in range(4):
            a, b = 4 * ring + k, 4 * ring + (k + 1) % 4
            c, d = (b + 4) % 16, (a + 4) % 16
            faces += [(a, b, c), (a, c, d)]
    mesh = TriMesh(vertices, np.array(faces))
    parts.add_mapped(mesh, 1 if rect.width > rect.height else 2, material, part)
    for low, high in (
        ((x0, rect.y0, rect.z0), (x1, rect.y1, hole.z0)),
        ((x0, rect.y0, hole.z1), (x1, rect.y1, rect.z1)),
        ((x0, rect.y0, hole.z0), (x1, hole.y0, hole.z1)),
        ((x0, hole.y1, hole.z0), (x1, rect.y1, hole.z1)),
    ):
        parts.add_collision_box(low, high, part)


def sinks(spec: CabinetSpec, cell: Cell, place: HandlePlace) -> Sinks:
    """Return how far behind the face at the handle's middle the surface lies under its feet, see `Sinks`."""
    low, middle, high = (_sink(spec, cell, place, k * place.length_m / 2) for k in (-1, 0, 1))
    return low, middle, high


def _sink(spec: CabinetSpec, cell: Cell, place: HandlePlace, offset: float) -> float:
    assert cell.front is not None
    y, z = (place.y, place.z + offset) if place.vertical else (place.y + offset, place.z)
    bulge = spec.bulge_m(place.y) - spec.bulge_m(y)
    if cell.face in ("slab", "planks"):
        return bulge
    field = _frame_opening(spec, cell.front)
    inside = field.y0 < y < field.y1 and field.z0 < z < field.z1
    return bulge + (spec.front.recess_m if inside else 0.0)


def handle_foot(spec: CabinetSpec, place: HandlePlace) -> np.ndarray:
    """Return the point of the fronts' outer face behind a handle's centre, in the object frame."""
    return np.array((spec.face_x - spec.bulge_m(place.y), place.y, place.z))


def add_hinges(parts: LinkParts, spec: CabinetSpec, cell: Cell, material: Material) -> None:
    """Add what of both hinges moves with a door."""
    for at, upright in _hinge_places(cell):
        if spec.front.mount == "inset":
            # the barrel stands before the face, on the axis, and does not reach into the slit beside the door
            barrel = cylinder(min(spec.front.knuckle_m, spec.front.gap_m) * 0.95, _BARREL_HALF_M, 8)
            parts.add_visual(barrel.transformed(at, (1, 0, 0, 0) if upright else TO_Y), material, "hinge")
        elif _overlap(cell) > 0:
            cup = cylinder(_CUP_M[0], _CUP_PROUD_M, 14)
            back = spec.front.knuckle_m + spec.front.thickness_m
            inwards = _CUP_M[1] * _inwards(cell)
            parts.add_visual(cup.transformed(at + np.array((back, *inwards)), TO_X), material, "hinge")


def add_hinge_arms(parts: LinkParts, spec: CabinetSpec, cell: Cell, material: Material) -> None:
    """Add what stays on the carcass: arms that end within a closed door and reach out to an open one's edge."""
    if spec.front.mount == "inset" or _overlap(cell) <= 0:
        return
    assert cell.front is not None
    x0, x1 = spec.face_x + _ARM_CLEAR_M, spec.face_x + spec.front.thickness_m + _ARM_INSIDE_M
    y, z = cell.front.centre
    inwards = _inwards(cell)
    edge = {"left": (cell.clear.y1, z), "right": (cell.clear.y0, z), "top": (y, cell.clear.z1)}
    start = np.array(edge.get(_side(cell), (y, cell.clear.z0))) + inwards * _ARM_M[0]
    for at, upright in _hinge_places(cell):
        half = ((x1 - x0) / 2, *(_ARM_M if upright else _ARM_M[::-1]))
        parts.add_visual(box(half).transformed(parts.local(((x0 + x1) / 2, *start)) + at), material, "hinge")


def _hinge_places(cell: Cell) -> list[tuple[np.ndarray, bool]]:
    """Return where the hinges are, along the axis from its middle, and whether the axis is upright."""
    assert cell.front is not None
    upright = _side(cell) in ("left", "right")
    half = (cell.front.height if upright else cell.front.width) / 2
    offset = half - min(_HINGE_END_M, 0.5 * half)
    along = np.array((0.0, 0.0, 1.0) if upright else (0.0, 1.0, 0.0))
    return [(sign * offset * along, upright) for sign in (-1, 1)]


def _overlap(cell: Cell) -> float:
    """Return how far the door covers the board beside its hinges; negative where there is none."""
    door, clear = cell.front, cell.clear
    assert door is not None
    reach = {"left": door.y1 - clear.y1, "right": clear.y0 - door.y0, "top": door.z1 - clear.z1}
    return reach.get(_side(cell), clear.z0 - door.z0)


def _inwards(cell: Cell) -> np.ndarray:
    """Return the direction from the hinges to the middle of the door, (y, z)."""
    ways = {"left": (-1.0, 0.0), "right": (1.0, 0.0), "top": (0.0, -1.0), "bottom": (0.0, 1.0)}
    return np.array(ways[_side(cell)])


def _side(cell: Cell) -> Side:
    assert cell.hinge is not None, "only doors have hinges"
    return cell.hinge
