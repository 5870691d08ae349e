"""The links, joints and handles of an imported object, in the object frame and metres."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import Category, Joint, Link
from artiskill.assets.partnet.collisions import Decompose, LinkSurface, collision_shapes, trim_overlaps
from artiskill.assets.partnet.drawn import DrawnMesh, vertices_of, visual_meshes
from artiskill.assets.partnet.handles import ImportedHandle, clear_handles, find_handles
from artiskill.assets.partnet.placement import Placement, RestJoint
from artiskill.assets.partnet.urdf import Body, transform
from artiskill.geometry.meshes import TriMesh, sample_surface

SURFACE_POINTS_PER_LINK = 200
# Chairs and buckets as in the first release. Cabinets: particle board has 600-700 kg/m3, solid pine 500; hulls
# follow panels to a few millimetres, so that their volume is the wood's.
DENSITY_KG_M3: dict[Category, float] = {"cabinet": 600.0, "chair": 200.0, "bucket": 1000.0}


@dataclass(frozen=True, eq=False)
class Source:
    """The object as read, in the file's units; lists run over the bodies."""

    category: Category  # of the object
    bodies: tuple[Body, ...]  # its rigid bodies
    drawn: list[list[DrawnMesh]]  # their surfaces, each in its body's frame
    rest: list[RestJoint | None]  # their joints, relative to rest; None for the root
    poses: list[np.ndarray]  # (4, 4) of each in the root's frame, its joint at 0


def build_links(
    source: Source, place: Placement, decompose: Decompose, warnings: list[str]
) -> tuple[tuple[Link, ...], list[ImportedHandle]]:
    """Return links, the root first, and handles; what is odd is added to `warnings`.

    `decompose` finds convex hulls, as in `collision_shapes`.
    """
    surfaces, positions = _surfaces_and_positions(source, place)
    shapes = collision_shapes(surfaces, source.category, decompose, warnings)
    if source.category == "cabinet":
        placed = [(surface.name, position) for surface, position in zip(surfaces, positions, strict=True)]
        shapes, said = trim_overlaps(placed, shapes)
        warnings += said
    links: list[Link] = []
    handles: list[ImportedHandle] = []
    textures: dict[Path, np.ndarray | None] = {}
    for index, (body, surface) in enumerate(zip(source.bodies, surfaces, strict=True)):
        rng = _content_rng(surface)
        found = find_handles(surface, source.category, rng, warnings)
        if source.category == "cabinet" and found:
            found = clear_handles(found, surfaces, shapes, positions, index, warnings)
        handles += found
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
    return tuple(links), handles


def _surfaces_and_positions(source: Source, place: Placement) -> tuple[list[LinkSurface], list[np.ndarray]]:
    """Return what each link is made from, and its frame's position (3,) in the object with all joints at 0."""
    surfaces, positions = [], []
    for index, body in enumerate(source.bodies):
        joint, position = _joint_and_position(source, index, place)
        drawn = [m.moved(source.poses[index], place.scale, place.shift - position) for m in source.drawn[index]]
        surfaces.append(LinkSurface(body.name, drawn, joint))
        positions.append(position)
    return surfaces, positions


def _joint_and_position(source: Source, index: int, place: Placement) -> tuple[Joint | None, np.ndarray]:
    """Return the joint in its link's frame, and the frame's position (3,) in the object with all joints at 0."""
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


def _surface_points(drawn: Sequence[DrawnMesh], rng: np.random.Generator) -> np.ndarray:
    meshes = [mesh.mesh for mesh in drawn]
    return sample_surface(meshes, SURFACE_POINTS_PER_LINK, rng) if meshes else np.empty((0, 3))


def _content_rng(surface: LinkSurface) -> np.random.Generator:
    """Return a generator seeded by the link's name and geometry: the same samples on every import."""
    digest = hashlib.sha256(surface.name.encode())
    for mesh in surface.drawn:
        merged: TriMesh = mesh.mesh
        digest.update(np.round(merged.vertices, 9).tobytes() + merged.faces.tobytes())
    return np.random.default_rng(int.from_bytes(digest.digest()[:8], "little"))
