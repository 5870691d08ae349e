"""From a `CabinetSpec` to an `ArticulatedObject`: links, joints, meshes, shapes, handles and facts."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from artiskill.assets.articulated_object import ROOM_WALL, ArticulatedObject, CollisionShape, Handle, Joint, Link
from artiskill.assets.cabinets.carcass import add_box, add_carcass
from artiskill.assets.cabinets.fronts import add_front, add_hinges, handle_foot, sinks
from artiskill.assets.cabinets.pulls import build_pull
from artiskill.assets.cabinets.spec import CabinetSpec, Cell, Side, Wall
from artiskill.assets.finishes import Materials, make_material, make_materials
from artiskill.assets.handles import handle_from_mesh
from artiskill.assets.kinematics import first_moment_m4, shapes_volume_m3
from artiskill.assets.parts import LinkParts
from artiskill.geometry.arrays import total
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
    materials = make_materials(spec.appearance)
    base = LinkParts((0.0, 0.0, 0.0), rng)
    add_carcass(base, spec, materials)
    links = [base.link("base", -1, None, spec.density_kg_m3)]
    handles: list[Handle] = []
    for cell in spec.cells:
        if cell.kind in ("drawer", "door"):
            link, handle = _add_moving(spec, cell, f"link_{len(links) - 1}", materials, rng)
            links.append(link)
            handles += [] if handle is None else [handle]
    facts, bounds = _facts(spec, links, handles), _bounds(links)
    if spec.wall is not None:  # no part of the cabinet: neither facts nor bounds know of it
        links.append(_wall(spec, spec.wall, rng))
    return ArticulatedObject(object_id, "cabinet", tuple(links), tuple(handles), bounds, facts)


def _wall(spec: CabinetSpec, wall: Wall, rng: np.random.Generator) -> Link:
    """Build the wall behind the cabinet; its frame lies in the middle of the lower edge of its face."""
    origin, size = np.array((spec.depth_m / 2, 0.0, 0.0)), (wall.thickness_m, wall.width_m, wall.height_m)
    low = origin - (0.0, wall.width_m / 2, 0.0)
    high, half = low + size, np.array(size) / 2
    parts = LinkParts(origin, rng)
    parts.add_visual(box(half).transformed(parts.local(low + half)), make_material(wall.surface), ROOM_WALL)
    parts.add_collision_box(low, high, ROOM_WALL)
    return parts.link(ROOM_WALL, 0, None, _MASONRY_KG_M3)


def _add_moving(
    spec: CabinetSpec, cell: Cell, name: str, materials: Materials, rng: np.random.Generator
) -> tuple[Link, Handle | None]:
    """Build a drawer or a door with its handle."""
    origin, joint = _joint(spec, cell, name)
    parts = LinkParts(origin, rng)
    add_front(parts, spec, cell, materials, "drawer_front" if cell.kind == "drawer" else "door")
    if cell.kind == "drawer":
        add_box(parts, spec, cell, materials)
    else:
        add_hinges(parts, spec, cell, materials["runner"])
    handle = _add_handle(parts, spec, cell, name, materials, rng)
    if cell.hinge == "top":
        joint = _closed_by_spring(joint, spec.density_kg_m3, parts.collisions)
    return parts.link(name, 0, joint, spec.density_kg_m3), handle


def _closed_by_spring(joint: Joint, density_kg_m3: float, shapes: Sequence[CollisionShape]) -> Joint:
    """Add a spring that holds a flap shut: hung at its top, its hinges before its face, it would hang open."""
    swings_open_n_m = float(_GRAVITY_M_S2 * density_kg_m3 * first_moment_m4(shapes)[0])
    if swings_open_n_m <= 0:
        return joint
    moment = _SPRING_SURPLUS * swings_open_n_m
    return replace(joint, stiffness=round(moment / _SPRING_SPREAD_RAD, 3), spring_reference=-_SPRING_SPREAD_RAD)


def _joint(spec: CabinetSpec, cell: Cell, name: str) -> tuple[np.ndarray, Joint]:
    """Return the link's origin in the object frame, and its joint."""
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
    parts: LinkParts, spec: CabinetSpec, cell: Cell, name: str, materials: Materials, rng: np.random.Generator
) -> Handle | None:
    if cell.handle is None:
        return None
    model = spec.handle_of(cell)
    face = parts.local(handle_foot(spec, cell.handle))
    pull = build_pull(model, cell.handle, face, sinks(spec, cell, cell.handle))
    parts.add_visual(pull.mesh, materials["handle"], "handle")
    if pull.recess is not None:
        parts.add_visual(pull.recess, materials["handle"], "front_recess")
    for shape in pull.collisions:
        parts.add_collision(shape)
    return handle_from_mesh(name, model.kind, pull.mesh, OUTWARD, rng, pull.hookable, pull.grasp)


def _bounds(links: list[Link]) -> np.ndarray:
    """Return the bounds of all visual meshes at joint value 0."""
    corners = np.stack([v.mesh.bounds + link.position for link in links for v in link.visuals])
    return np.stack((corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)))


def _facts(spec: CabinetSpec, links: Sequence[Link], handles: Sequence[Handle]) -> dict[str, object]:
    """Return plain facts for people and filters: the object's `metadata`."""
    mass = total(link.density_kg_m3 * shapes_volume_m3(link.collisions) for link in links)
    kinds = sorted({handle.kind for handle in handles})
    faces: list[str] = sorted({cell.face for cell in spec.cells if cell.kind != "open"})
    flaps = len([cell for cell in spec.cells if cell.hinge in ("top", "bottom")])
    return {
        "source": "generated",
        "family": spec.family,
        "held_out": spec.held_out,
        "width_m": spec.width_m,
        "depth_m": spec.depth_m,
        "height_m": spec.height_m,
        "mass_kg": round(mass, 2),
        "joints": len(links) - 1,
        "handles": kinds,
        "tags": _tags(spec, kinds, faces, flaps),
        "finish": f"{spec.appearance.carcass.name}, {spec.appearance.front.name}",
        "support": spec.support.kind,
        "mount": spec.front.mount,
        "fronts": faces,
        "drawers": spec.count("drawer"),
        "doors": spec.count("door"),
        "flaps": flaps,
    }


def _tags(spec: CabinetSpec, kinds: list[str], faces: list[str], flaps: int) -> list[str]:
    tags = {spec.family, spec.support.kind, spec.front.mount, *kinds, *faces}
    tags |= {kind for kind in ("drawer", "door", "open", "blind") if spec.count(kind) > 0}
    tags |= {name for name, true in (("flap", flaps), ("bowed", spec.front.bow_m > 0)) if true}
    if spec.top.steps > 1:
        tags.add("cornice")
    if spec.support.kind == "legs":
        tags.add(f"{spec.support.leg_shape} legs")
    return sorted(tags)
