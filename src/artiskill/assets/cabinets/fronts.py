"""Front panels: slabs and shaker frames."""

import numpy as np

from artiskill.assets.articulated_object import CollisionShape, Material
from artiskill.assets.cabinets.parts import IDENTITY, LinkParts
from artiskill.assets.cabinets.spec import CabinetSpec, Cell, HandlePlace, Rect

_FIELD_M = 0.006  # thickness of a shaker front's field


def add_front(parts: LinkParts, spec: CabinetSpec, cell: Cell, material: Material, part: str) -> None:
    """Add the front panel of a cell to a link; one box is touched, whatever is drawn."""
    assert cell.front is not None
    rect, x0, x1 = cell.front, spec.face_x, spec.face_x + spec.front.thickness_m
    # the grain of a slab runs along its longer side, that of frames along each member
    if not cell.framed:
        parts.panel((x0, rect.y0, rect.z0), (x1, rect.y1, rect.z1), material, part)
        return
    inner = frame_opening(spec, rect)
    for z0, z1, y0, y1 in (
        (rect.z0, rect.z1, rect.y0, inner.y0),
        (rect.z0, rect.z1, inner.y1, rect.y1),
        (rect.z0, inner.z0, inner.y0, inner.y1),
        (inner.z1, rect.z1, inner.y0, inner.y1),
    ):
        parts.panel((x0, y0, z0), (x1, y1, z1), material, part, collide=False)
    field = x0 + spec.front.recess_m
    parts.panel(
        (field, inner.y0, inner.z0),
        (min(field + _FIELD_M, x1), inner.y1, inner.z1),
        material,
        part,
        grain=2 if rect.height > rect.width else 1,
        collide=False,
    )
    low, high = parts.local((x0, rect.y0, rect.z0)), parts.local((x1, rect.y1, rect.z1))
    half = tuple(((high - low) / 2).tolist())
    parts.touch(CollisionShape("box", half, (low + high) / 2, IDENTITY, part=part))


def frame_opening(spec: CabinetSpec, rect: Rect) -> Rect:
    """The field of a shaker front: its outline within the frame, members narrowed on small fronts."""
    side = min(spec.front.frame_m, rect.width / 3.5)
    rail = min(spec.front.frame_m, rect.height / 3.5)
    return Rect(rect.y0 + side, rect.y1 - side, rect.z0 + rail, rect.z1 - rail)


def post_sinks(spec: CabinetSpec, cell: Cell, place: HandlePlace) -> tuple[float, float]:
    """How far behind the face the surface lies under each post of a handle: lower or right, upper or left."""
    assert cell.front is not None
    if not cell.framed:
        return 0.0, 0.0
    field = frame_opening(spec, cell.front)
    sinks = []
    for sign in (-1, 1):
        along = sign * place.centres_m / 2
        y, z = (place.y, place.z + along) if place.vertical else (place.y + along, place.z)
        inside = field.y0 < y < field.y1 and field.z0 < z < field.z1
        sinks.append(spec.front.recess_m if inside else 0.0)
    return sinks[0], sinks[1]


def handle_foot(spec: CabinetSpec, place: HandlePlace) -> np.ndarray:
    """The point of the fronts' outer face behind a handle's centre, object frame."""
    return np.array((spec.face_x, place.y, place.z))
