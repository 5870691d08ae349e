"""The links, joints and handles of an imported object, in the object frame and metres."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import Category, CollisionShape, Joint, Link
from artiskill.assets.handles import is_handle_part
from artiskill.assets.partnet.bodies import Body, transform
from artiskill.assets.partnet.clearance import Obstacle, with_room
from artiskill.assets.partnet.closing import RestJoint
from artiskill.assets.partnet.collisions import Decompose, LinkSurface, collision_shapes
from artiskill.assets.partnet.drawn import DrawnMesh, group_by_part, vertices_of, visual_meshes
from artiskill.assets.partnet.grips import Grip, make_grip
from artiskill.assets.partnet.overlaps import moved_hull, shape_hull
from artiskill.assets.partnet.placing import Placement
from artiskill.assets.partnet.trimming import trim_overlaps
from artiskill.geometry.meshes import TriMesh, merge, sample_surface

SURFACE_POINTS_PER_LINK = 200
# Chairs and buckets as in the first release. Cabinets: particle board has 600-700 kg/m3, solid pine 500; hulls
# follow panels to a few millimetres, so that their volume is the wood's.
DENSITY_KG_M3: dict[Category, float] = {"cabinet": 600.0, "chair": 200.0, "bucket": 1000.0}


@dataclass(frozen=True, eq=False)
class Source:
    """The object as read, in the file's units; lists run over the bodies.

    Attributes:
        category: of the object.
        bodies: its rigid bodies.
        drawn: their surfaces, each in its body's frame.
        rest: their joints, relative to rest; None for the root.
        poses: (4, 4) of each in the root's frame, its joint at 0.
    """

    category: Category
    bodies: tuple[Body, ...]
    drawn: list[list[DrawnMesh]]
    rest: list[RestJoint | None]
    poses: list[np.ndarray]


def build_links(
    source: Source, place: Placement, decompose: Decompose, warnings: list[str]
) -> tuple[tuple[Link, ...], list[Grip]]:
    """Links, the root first, and handles with the gap behind each; what is odd is added to `warnings`.

    `decompose` finds convex hulls, as in `collision_shapes`.
    """
    surfaces: list[LinkSurface] = []
    positions: list[np.ndarray] = []
    for index, body in enumerate(source.bodies):
        joint, position = _joint_and_position(source, index, place)
        drawn = [m.moved(source.poses[index], place.scale, place.shift - position) for m in source.drawn[index]]
        surfaces.append(LinkSurface(body.name, drawn, joint))
        positions.append(position)
    shapes = collision_shapes(surfaces, source.category, decompose, warnings)
    if source.category == "cabinet":
        placed = [(surface.name, position) for surface, position in zip(surfaces, positions, strict=True)]
        shapes, said = trim_overlaps(placed, shapes)
        warnings += said
    links: list[Link] = []
    grips: list[Grip] = []
    textures: dict[Path, np.ndarray | None] = {}
    for index, (body, surface) in enumerate(zip(source.bodies, surfaces, strict=True)):
        rng = _content_rng(surface)
        found = _grips(surface, source.category, rng, warnings)
        if source.category == "cabinet" and found:
            found = _with_room(found, surfaces, shapes, positions, index, warnings)
        grips += found
        parent_position = positions[body.parent] if body.parent >= 0 else np.zeros(3)
        links.append(
            Link(
                name=body.name,
                parent=body.parent,
                position=positions[index] - parent_position,
                quaternion=np.array((1.0, 0.0, 0.0, 0.0)),
                joint=surface.joint,
                visuals=visual_meshes(surface.drawn, textures, warnings),
                collisions=shapes[index],
                density_kg_m3=DENSITY_KG_M3[source.category],
                surface_points=_surface_points(surface.drawn, rng),
            )
        )
    return tuple(links), grips


def _joint_and_position(source: Source, index: int, place: Placement) -> tuple[Joint | None, np.ndarray]:
    """The joint in its link's frame, and that frame's position (3,) in the object frame with all joints at 0."""
    body, rest, pose = source.bodies[index], source.rest[index], source.poses[index]
    if body.joint is None or rest is None:
        return None, np.zeros(3)
    axis = rest.sign * (pose[:3, :3] @ body.joint.axis)
    axis[np.abs(axis) < 1e-9] = 0.0  # the turn by pi / 2 leaves dust
    position, limits = place.apply(pose[:3, 3]), rest.limits
    if rest.kind == "prismatic":
        limits = (limits[0] * place.scale, limits[1] * place.scale)
        points = vertices_of(source.drawn[index])
        if len(points):  # any point is on a sliding axis
            world = place.apply(transform(pose, points))
            position = (world.min(axis=0) + world.max(axis=0)) / 2
    return Joint(body.joint.name, rest.kind, axis / np.linalg.norm(axis), np.zeros(3), limits), position


def _grips(surface: LinkSurface, category: Category, rng: np.random.Generator, warnings: list[str]) -> list[Grip]:
    """Handles of a link with the gap behind each; none on links that do not move or never close."""
    joint = surface.joint
    groups = _handle_groups(surface.drawn)
    if not groups or joint is None:
        return []
    if category == "cabinet" and np.isinf(joint.limits[0]):
        warnings.append(f"{surface.name!r} turns without end: its handle is no target")
        return []
    panels = [mesh.mesh for mesh in surface.drawn if not mesh.label.is_handle]
    panel = merge(panels) if panels else None
    found = []
    for meshes in groups:
        grip = make_grip(surface.name, merge(m.mesh for m in meshes), panel, joint, category, rng)
        warnings += grip.warnings
        found.append(grip)
    return found


def _with_room(
    grips: Sequence[Grip],
    surfaces: Sequence[LinkSurface],
    shapes: Sequence[Sequence[CollisionShape]],
    positions: Sequence[np.ndarray],
    index: int,
    warnings: list[str],
) -> list[Grip]:
    """The grips of a link, at which the open gripper has room beside the shapes of all links at rest."""
    obstacles = [
        Obstacle(
            moved_hull(shape_hull(shape), positions[k] - positions[index]),
            "" if k == index and is_handle_part(shape.part) else surface.name,
        )
        for k, surface in enumerate(surfaces)
        for shape in shapes[k]
    ]
    found = []
    for grip, meshes in zip(grips, _handle_groups(surfaces[index].drawn), strict=True):
        vertices = np.concatenate([mesh.mesh.vertices for mesh in meshes])
        handle, said = with_room(grip.handle, vertices, obstacles)
        warnings += said
        found.append(replace(grip, handle=handle))
    return found


def _handle_groups(drawn: Sequence[DrawnMesh]) -> list[list[DrawnMesh]]:
    """The meshes of each handle: of one number, such as `handle-3` and `handle_post-3`, or of one name without."""
    groups: dict[int | str, list[DrawnMesh]] = {}
    for label, meshes in group_by_part(drawn).items():
        if label.is_handle:
            groups.setdefault(label.id if label.id >= 0 else label.name, []).extend(meshes)
    return list(groups.values())


def _surface_points(drawn: Sequence[DrawnMesh], rng: np.random.Generator) -> np.ndarray:
    meshes = [mesh.mesh for mesh in drawn]
    return sample_surface(meshes, SURFACE_POINTS_PER_LINK, rng) if meshes else np.empty((0, 3))


def _content_rng(surface: LinkSurface) -> np.random.Generator:
    """A generator seeded by the link's name and geometry: the same samples on every import."""
    digest = hashlib.sha256(surface.name.encode())
    for mesh in surface.drawn:
        merged: TriMesh = mesh.mesh
        digest.update(np.round(merged.vertices, 9).tobytes() + merged.faces.tobytes())
    return np.random.default_rng(int.from_bytes(digest.digest()[:8], "little"))
