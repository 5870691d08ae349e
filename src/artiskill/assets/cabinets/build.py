"""From a `CabinetSpec` to an `ArticulatedObject`: links, joints, drawn and touched parts, handles."""

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Handle, Joint, Link
from artiskill.assets.cabinets.carcass import add_carcass
from artiskill.assets.cabinets.fronts import add_front, handle_foot, post_sinks
from artiskill.assets.cabinets.materials import Materials, make_materials
from artiskill.assets.cabinets.openings import BOX_FLOOR_M, RUNNER_SPACE_M
from artiskill.assets.cabinets.parts import IDENTITY, LinkParts
from artiskill.assets.cabinets.pulls import build_pull
from artiskill.assets.cabinets.spec import KNUCKLE_M, CabinetSpec, Cell
from artiskill.assets.handles import handle_from_mesh

OUTWARD = np.array((-1.0, 0.0, 0.0))
_RUNNER_M = (0.010, 0.036)  # thickness and height of what is seen of a runner
_BOTTOM_GROOVE_M = 0.008  # a drawer's bottom sits this far above its sides' lower edge


def build_cabinet(spec: CabinetSpec, object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """Build a cabinet.

    Link frames are parallel to the object frame at joint value 0: the base's lies at the object's origin, a
    drawer's in the middle of its front's outer face, a door's on its hinge axis at half the door's height.

    Args:
        spec: the cabinet.
        object_id: name in catalogues and results.
        rng: draws surface samples and where in its texture each board lies.
    """
    materials = make_materials(spec.appearance)
    base = LinkParts((0.0, 0.0, 0.0), rng)
    add_carcass(base, spec, materials)
    links = [_link(spec, "base", -1, np.zeros(3), None, base)]
    handles: list[Handle] = []
    for cell in spec.cells:
        if cell.kind not in ("drawer", "door"):
            continue
        name = f"link_{len(links) - 1}"
        origin, joint = _joint(spec, cell, name)
        parts = LinkParts(origin, rng)
        add_front(parts, spec, cell, materials.front, "drawer_front" if cell.kind == "drawer" else "door")
        if cell.kind == "drawer":
            _add_box(parts, spec, cell, materials)
        handle = _add_handle(parts, spec, cell, name, materials, rng)
        links.append(_link(spec, name, 0, origin, joint, parts))
        if handle is not None:
            handles.append(handle)
    return ArticulatedObject(object_id, "cabinet", tuple(links), tuple(handles), _bounds(links), _metadata(spec))


def _link(
    spec: CabinetSpec, name: str, parent: int, origin: np.ndarray, joint: Joint | None, parts: LinkParts
) -> Link:
    return Link(
        name,
        parent,
        origin,
        IDENTITY,
        joint,
        parts.visuals(),
        tuple(parts.collisions),
        spec.density_kg_m3,
        parts.surface_points(),
    )


def _joint(spec: CabinetSpec, cell: Cell, name: str) -> tuple[np.ndarray, Joint]:
    """The link's origin in the object frame, and its joint."""
    assert cell.front is not None
    y, z = cell.front.centre
    limits = (0.0, cell.limit)
    if cell.kind == "drawer":
        return np.array((spec.face_x, y, z)), Joint(
            f"{name}_slide", "prismatic", OUTWARD.copy(), np.zeros(3), limits
        )
    left = cell.hinge == "left"
    origin = np.array((spec.face_x - KNUCKLE_M, cell.front.y1 if left else cell.front.y0, z))
    # about -z the right-hand edge of a door hinged on the left swings out to -x
    axis = np.array((0.0, 0.0, -1.0 if left else 1.0))
    return origin, Joint(f"{name}_hinge", "revolute", axis, np.zeros(3), limits)


def _add_box(parts: LinkParts, spec: CabinetSpec, cell: Cell, materials: Materials) -> None:
    """The hollow box behind a drawer's front, open at the top, and its runners."""
    x0 = spec.face_x + spec.front.thickness_m
    x1 = x0 + cell.box_length_m
    y0, y1 = cell.clear.y0 + RUNNER_SPACE_M, cell.clear.y1 - RUNNER_SPACE_M
    z0 = cell.clear.z0 + BOX_FLOOR_M
    z1 = z0 + cell.box_height_m
    t = spec.side_m
    inside = materials.interior
    parts.panel((x0, y0, z0), (x1, y0 + t, z1), inside, "drawer_side", grain=0)
    parts.panel((x0, y1 - t, z0), (x1, y1, z1), inside, "drawer_side", grain=0)
    parts.panel((x1 - t, y0 + t, z0), (x1, y1 - t, z1), inside, "drawer_back", grain=1)
    floor = z0 + _BOTTOM_GROOVE_M
    parts.panel((x0, y0 + t, floor), (x1 - t, y1 - t, floor + spec.bottom_m), inside, "drawer_bottom", grain=0)
    thick, high = _RUNNER_M[0], min(_RUNNER_M[1], cell.box_height_m - 0.006)
    middle = (z0 + z1) / 2
    for low in (y0 - thick, y1):
        corners = (x0, low, middle - high / 2), (x1, low + thick, middle + high / 2)
        parts.panel(*corners, materials.runner, "runner", collide=False)


def _add_handle(
    parts: LinkParts, spec: CabinetSpec, cell: Cell, name: str, materials: Materials, rng: np.random.Generator
) -> Handle | None:
    if cell.handle is None:
        return None
    face = parts.local(handle_foot(spec, cell.handle))
    pull = build_pull(spec.handle, cell.handle, face, post_sinks(spec, cell, cell.handle))
    parts.draw(pull.mesh, materials.handle, "handle")
    for shape in pull.collisions:
        parts.touch(shape)
    return handle_from_mesh(name, spec.handle.kind, pull.mesh, OUTWARD, rng, pull.hookable)


def _bounds(links: list[Link]) -> np.ndarray:
    """Around everything drawn, at joint value 0."""
    corners = np.stack([v.mesh.bounds + link.position for link in links for v in link.visuals])
    return np.stack((corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)))


def _metadata(spec: CabinetSpec) -> dict[str, object]:
    return {
        "source": "generated",
        "family": spec.family,
        "width_m": spec.width_m,
        "depth_m": spec.depth_m,
        "height_m": spec.height_m,
        "support": spec.support.kind,
        "fronts": f"{spec.front.mount} {'shaker' if spec.front.frame_m > 0 else 'slab'}",
        "handle": f"{spec.handle.section} {spec.handle.kind}",
        "finish": f"{spec.appearance.carcass.name}, {spec.appearance.front.name}",
        "drawers": spec.count("drawer"),
        "doors": spec.count("door"),
    }
