"""What front panels look like: planks, frames with a field, a raised field, panes or slats, and pierced boards."""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import Material
from artiskill.assets.cabinets.boards import Boards
from artiskill.assets.cabinets.spec import CabinetSpec, Cell, Rect
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import frustum
from artiskill.geometry.rotations import quat_from_axis_angle

_FIELD_M = 0.006  # thickness of a field, of a pane
_RAISED_EDGE_M = 0.034  # width of a raised field's slope
_MUNTIN_M = 0.018
_SLAT_M = 0.005  # thickness of a slat
_SLAT_OVERLAP = 1.1  # its height, relative to the distance of two
_BACKING_M = 0.002
_GROOVE_M = 0.0035  # width of the groove between planks


@dataclass(frozen=True, eq=False)
class FrontMaterials:
    """Of frames and fields, and of panes."""

    front: Material
    glass: Material


def frame_opening(spec: CabinetSpec, rect: Rect) -> Rect:
    """The field of a framed front: its outline within the frame, members narrowed on small fronts."""
    side = min(spec.front.frame_m, rect.width / 3.5)
    rail = min(spec.front.frame_m, rect.height / 3.5)
    return Rect(rect.y0 + side, rect.y1 - side, rect.z0 + rail, rect.z1 - rail)


def add_framed(parts: Boards, spec: CabinetSpec, cell: Cell, materials: FrontMaterials, part: str) -> None:
    """Draw a frame and what it holds; the grain runs along each member."""
    assert cell.front is not None
    rect, x0, x1 = cell.front, spec.face_x, spec.face_x + spec.front.thickness_m
    inner = frame_opening(spec, rect)
    for z0, z1, y0, y1 in (
        (rect.z0, rect.z1, rect.y0, inner.y0),
        (rect.z0, rect.z1, inner.y1, rect.y1),
        (rect.z0, inner.z0, inner.y0, inner.y1),
        (inner.z1, rect.z1, inner.y0, inner.y1),
    ):
        parts.panel((x0, y0, z0), (x1, y1, z1), materials.front, part, collide=False)
    if cell.face == "louvred":
        _add_slats(parts, spec, inner, materials.front, part)
        return
    pane = cell.face == "glazed"
    field = x0 + spec.front.recess_m
    parts.panel(
        (field, inner.y0, inner.z0),
        (min(field + _FIELD_M, x1), inner.y1, inner.z1),
        materials.glass if pane else materials.front,
        "pane" if pane else part,
        grain=2 if rect.height > rect.width else 1,
        collide=False,
    )
    if pane:
        _add_muntins(parts, spec, inner, materials.front, part)
    elif cell.face == "raised":
        _add_raised(parts, spec, inner, materials.front, part)


def _add_raised(parts: Boards, spec: CabinetSpec, inner: Rect, material: Material, part: str) -> None:
    edge = min(_RAISED_EDGE_M, 0.3 * min(inner.width, inner.height))
    gap = 0.15 * edge
    low = ((inner.y0 + gap, inner.z0 + gap), (inner.y1 - gap, inner.z1 - gap))
    high = ((inner.y0 + edge, inner.z0 + edge), (inner.y1 - edge, inner.z1 - edge))
    depth = spec.front.recess_m
    mesh = frustum(low, high, spec.face_x + depth + 0.001, depth)
    parts.form(mesh, 2 if inner.height > inner.width else 1, material, part)


def _add_muntins(parts: Boards, spec: CabinetSpec, inner: Rect, material: Material, part: str) -> None:
    """Bars that divide the pane, flush with the frame's face but for a hair."""
    columns, rows = spec.front.muntins
    x0, x1, half = spec.face_x + 0.001, spec.face_x + spec.front.recess_m + 0.001, _MUNTIN_M / 2
    for k in range(1, columns):
        y = inner.y0 + k * inner.width / columns
        parts.panel((x0, y - half, inner.z0), (x1, y + half, inner.z1), material, part, collide=False)
    for k in range(1, rows):
        z = inner.z0 + k * inner.height / rows
        parts.panel((x0, inner.y0, z - half), (x1, inner.y1, z + half), material, part, collide=False)


def _add_slats(parts: Boards, spec: CabinetSpec, inner: Rect, material: Material, part: str) -> None:
    """Slats that lean out at their lower edge and overlap, so that nobody looks through."""
    count = max(2, round(inner.height / spec.front.plank_m))
    pitch, thickness = inner.height / count, spec.front.thickness_m
    tall = _SLAT_OVERLAP * pitch
    tilt = math.asin(min((thickness - _SLAT_M) / tall, 0.6))
    half = np.array((_SLAT_M / 2, inner.width / 2, tall / 2))
    turn = quat_from_axis_angle((0, 1, 0), tilt)
    for k in range(count):
        z = inner.z0 + (k + 0.5) * pitch
        parts.tilted((spec.face_x + thickness / 2, inner.centre[0], z), half, turn, 1, material, part)
    # what is seen between them
    back = spec.face_x + thickness - _BACKING_M
    parts.panel((back, inner.y0, inner.z0), (back + _BACKING_M, inner.y1, inner.z1), material, part, collide=False)


def add_planks(parts: Boards, spec: CabinetSpec, rect: Rect, material: Material, part: str) -> None:
    """Draw upright boards side by side, with grooves, before a thin panel."""
    x0, x1 = spec.face_x, spec.face_x + spec.front.thickness_m
    count = max(2, round(rect.width / spec.front.plank_m))
    pitch = rect.width / count
    for k in range(count):
        y0 = rect.y0 + k * pitch
        low = y0 + (0.0 if k == 0 else _GROOVE_M / 2)
        high = y0 + pitch - (0.0 if k == count - 1 else _GROOVE_M / 2)
        parts.panel((x0, low, rect.z0), (x1 - 0.003, high, rect.z1), material, part, grain=2, collide=False)
    parts.panel((x1 - 0.004, rect.y0, rect.z0), (x1, rect.y1, rect.z1), material, part, collide=False)


def add_pierced(
    parts: Boards, rect: Rect, hole: Rect, depth_m: tuple[float, float], material: Material, part: str
) -> None:
    """Draw a board with a rectangular hole as one piece, and touch it as four.

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
    parts.form(mesh, 1 if rect.width > rect.height else 2, material, part)
    for low, high in (
        ((x0, rect.y0, rect.z0), (x1, rect.y1, hole.z0)),
        ((x0, rect.y0, hole.z1), (x1, rect.y1, rect.z1)),
        ((x0, rect.y0, hole.z0), (x1, hole.y0, hole.z1)),
        ((x0, hole.y1, hole.z0), (x1, rect.y1, hole.z1)),
    ):
        parts.add_collision_box(low, high, part)
