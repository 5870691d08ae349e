"""From a `CabinetSpec` to an `ArticulatedObject`: links, joints, drawn and touched parts, handles."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from artiskill.assets.articulated_object import ROOM_WALL, ArticulatedObject, CollisionShape, Handle, Joint, Link
from artiskill.assets.cabinets.boards import Boards
from artiskill.assets.cabinets.carcass import add_carcass
from artiskill.assets.cabinets.drawers import add_box
from artiskill.assets.cabinets.faces import FrontMaterials
from artiskill.assets.cabinets.facts import cabinet_facts
from artiskill.assets.cabinets.fronts import add_front, handle_foot, sinks
from artiskill.assets.cabinets.hinges import add_hinges
from artiskill.assets.cabinets.materials import Materials, make_cabinet_materials
from artiskill.assets.cabinets.pulls import build_pull
from artiskill.assets.cabinets.spec import CabinetSpec, Cell, Side, Wall
from artiskill.assets.finishes import make_material
from artiskill.assets.handles import handle_from_mesh
from artiskill.assets.kinematics import first_moment_m4
from artiskill.assets.parts import IDENTITY
from artiskill.geometry.primitives import box

_GRAVITY_M_S2 = 9.81
_MASONRY_KG_M3 = 1800.0  # of walls
_SPRING_SURPLUS = 1.5  # moment of a flap's spring over that of its weight, when shut
_SPRING_SPREAD_RAD = 2.0  # preload over stiffness: the moment grows by less than a factor of two up to the limit

OUTWARD = np.array((-1.0, 0.0, 0.0))
# About these axes the edge across from the hinge swings out to -x.
HINGE_AXES: dict[Side, tuple[float, float, float]] = {
    "left": (0.0, 0.0, -1.0),
    "right": (0.0, 0.0, 1.0),
    "top": (0.0, 1.0, 0.0),
    "bottom": (0.0, -1.0, 0.0),
}


def build_cabinet(spec: CabinetSpec, object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """Build a cabinet.

    Link frames are parallel to the object frame at joint value 0: the base's lies at the object's origin, a
    drawer's in the middle of its front's outer face, a door's on its hinge axis in the middle of its edge. The
    wall that a cabinet hangs on is its last link.

    Args:
        spec: the cabinet.
        object_id: name in catalogues and results.
        rng: draws surface samples and where in its texture each board lies.
    """
    materials = make_cabinet_materials(spec.appearance)
    base = Boards((0.0, 0.0, 0.0), rng)
    add_carcass(base, spec, materials)
    links = [_link(spec, "base", -1, np.zeros(3), None, base)]
    handles: list[Handle] = []
    for cell in spec.cells:
        if cell.kind in ("drawer", "door"):
            link, handle = _add_moving(spec, cell, f"link_{len(links) - 1}", materials, rng)
            links.append(link)
            handles += [] if handle is None else [handle]
    facts, bounds = cabinet_facts(spec, links, handles), _bounds(links)
    if spec.wall is not None:  # no part of the cabinet: neither facts nor bounds know of it
        links.append(_wall(spec, spec.wall, rng))
    return ArticulatedObject(object_id, "cabinet", tuple(links), tuple(handles), bounds, facts)


def _wall(spec: CabinetSpec, wall: Wall, rng: np.random.Generator) -> Link:
    """The wall whose face the cabinet's back touches; its frame lies in the middle of that face's lower edge."""
    origin, size = np.array((spec.depth_m / 2, 0.0, 0.0)), (wall.thickness_m, wall.width_m, wall.height_m)
    low = origin - (0.0, wall.width_m / 2, 0.0)
    high, half = low + size, np.array(size) / 2
    parts = Boards(origin, rng)
    parts.add_visual(box(half).transformed(parts.local(low + half)), make_material(wall.surface), ROOM_WALL)
    parts.add_collision_box(low, high, ROOM_WALL)
    visuals, shapes, points = parts.visuals(), tuple(parts.collisions), parts.surface_points()
    return Link(ROOM_WALL, 0, origin, IDENTITY, None, visuals, shapes, _MASONRY_KG_M3, points)


def _add_moving(
    spec: CabinetSpec, cell: Cell, name: str, materials: Materials, rng: np.random.Generator
) -> tuple[Link, Handle | None]:
    """A drawer or a door with its handle."""
    origin, joint = _joint(spec, cell, name)
    parts = Boards(origin, rng)
    fronts = FrontMaterials(materials.front, materials.glass)
    add_front(parts, spec, cell, fronts, "drawer_front" if cell.kind == "drawer" else "door")
    if cell.kind == "drawer":
        add_box(parts, spec, cell, materials)
    else:
        add_hinges(parts, spec, cell, materials.runner)
    handle = _add_handle(parts, spec, cell, name, materials, rng)
    if cell.hinge == "top":
        joint = _closed_by_spring(joint, spec.density_kg_m3, parts.collisions)
    return _link(spec, name, 0, origin, joint, parts), handle


def _closed_by_spring(joint: Joint, density_kg_m3: float, shapes: Sequence[CollisionShape]) -> Joint:
    """A flap hung at its top, its hinges before its face, would hang open; a spring holds it shut."""
    swings_open_n_m = float(_GRAVITY_M_S2 * density_kg_m3 * first_moment_m4(shapes)[0])
    if swings_open_n_m <= 0:
        return joint
    moment = _SPRING_SURPLUS * swings_open_n_m
    return replace(joint, stiffness=round(moment / _SPRING_SPREAD_RAD, 3), spring_reference=-_SPRING_SPREAD_RAD)


def _link(
    spec: CabinetSpec, name: str, parent: int, origin: np.ndarray, joint: Joint | None, parts: Boards
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
    rect = cell.front
    assert rect is not None
    y, z = rect.centre
    limits = (0.0, cell.limit)
    if cell.kind == "drawer":
        return np.array((spec.face_x, y, z)), Joint(
            f"{name}_slide", "prismatic", OUTWARD.copy(), np.zeros(3), limits
        )
    assert cell.hinge is not None
    edges = {"left": (rect.y1, z), "right": (rect.y0, z), "top": (y, rect.z1), "bottom": (y, rect.z0)}
    origin = np.array((spec.face_x - spec.front.knuckle_m, *edges[cell.hinge]))
    return origin, Joint(f"{name}_hinge", "revolute", np.array(HINGE_AXES[cell.hinge]), np.zeros(3), limits)


def _add_handle(
    parts: Boards, spec: CabinetSpec, cell: Cell, name: str, materials: Materials, rng: np.random.Generator
) -> Handle | None:
    if cell.handle is None:
        return None
    model = spec.handle_of(cell)
    face = parts.local(handle_foot(spec, cell.handle))
    pull = build_pull(model, cell.handle, face, sinks(spec, cell, cell.handle))
    parts.add_visual(pull.mesh, materials.handle, "handle")
    if pull.recess is not None:
        parts.add_visual(pull.recess, materials.handle, "front_recess")
    for shape in pull.collisions:
        parts.add_collision(shape)
    return handle_from_mesh(name, model.kind, pull.mesh, OUTWARD, rng, pull.hookable, pull.grasp)


def _bounds(links: list[Link]) -> np.ndarray:
    """Around everything drawn, at joint value 0."""
    corners = np.stack([v.mesh.bounds + link.position for link in links for v in link.visuals])
    return np.stack((corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)))
