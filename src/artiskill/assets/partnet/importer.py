"""`import_partnet`: a PartNet-Mobility object to an `ArticulatedObject`.

What is decided here, and written to `metadata`:

- Frame: z up, ground at z = 0, the footprint's middle at x = y = 0, front to -x (the data set's own after its
  fixed joint). All link frames are parallel to the object's at rest; a hinged link's frame sits on its axis, a
  sliding link's in the middle of its bounds.
- Scale: the data set's models measure about 2 across; `default_scale` says what they become.
- Closed is the lower limit, 0 (`closing`). Bodies that are rigid with the root are `base`.
- Handles are the parts named so; on links that move. Where there are none, the object imports and a warning in
  `metadata["warnings"]` says so; it has no target links then.
- Collision shapes follow the drawn surfaces, part by part (`decompose`); the URDF's own are the same
  meshes again, not convex, and are left out.
"""

import hashlib
import numbers
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import (
    ArticulatedObject,
    Category,
    CollisionShape,
    Handle,
    Joint,
    Link,
    check_object_id,
)
from artiskill.assets.needs import Needs
from artiskill.assets.partnet.bodies import Body, body_poses, build_bodies, transform
from artiskill.assets.partnet.closing import RestJoint, rest_joints
from artiskill.assets.partnet.decompose import (
    BODY,
    HANDLE,
    DecompositionPart,
    decompose_cached,
    default_cache_dir,
    import_coacd,
)
from artiskill.assets.partnet.drawn import DrawnMesh, group_by_part, read_drawn, vertices_of, visual_meshes
from artiskill.assets.partnet.folder import URDF_NAME, find_partnet_folder, open_object
from artiskill.assets.partnet.grips import make_grip
from artiskill.assets.partnet.preview import moving_links
from artiskill.assets.partnet.remarks import find_remarks
from artiskill.assets.partnet.semantics import read_category, read_part_names
from artiskill.assets.partnet.urdf import read_urdf
from artiskill.errors import AssetError
from artiskill.geometry.hulls import convex_hull
from artiskill.geometry.meshes import TriMesh, merge, sample_surface

__all__ = ["default_scale", "find_partnet_folder", "import_partnet"]

SURFACE_POINTS_PER_LINK = 200
# Chairs and buckets as in the first release. Cabinets: particle board has 600-700 kg/m3, solid pine 500; hulls
# follow panels to a few millimetres, so that their volume is the wood's.
DENSITY_KG_M3: dict[Category, float] = {"cabinet": 600.0, "chair": 200.0, "bucket": 1000.0}
# Scales of the first release for chairs and buckets; its cabinets lie in this range.
_FIXED_SCALE: dict[Category, float] = {"chair": 0.8, "bucket": 0.3}
CABINET_SCALES = (0.28, 0.81)
# Bedside tables and sideboards stand about 0.65 m high, chests of drawers and tall cabinets 0.9 m and more.
WIDE_CABINET_HEIGHT_M, TALL_CABINET_HEIGHT_M = 0.65, 0.9
_BOX_SHARE = 0.995  # a hull that fills so much of its bounds is a box


@dataclass(frozen=True, eq=False)
class _Source:
    """The object as read, in the file's units; lists run over the bodies."""

    name: str
    category: Category
    model_category: str
    bodies: tuple[Body, ...]
    drawn: list[list[DrawnMesh]]
    rest: list[RestJoint | None]
    poses: list[np.ndarray]
    warnings: list[str]


@dataclass(frozen=True, eq=False)
class _Placement:
    """x in the file's root frame becomes `scale * x + shift` in the object frame."""

    scale: float
    shift: np.ndarray

    def apply(self, point: np.ndarray) -> np.ndarray:
        return point * self.scale + self.shift


def import_partnet(
    path: Path | str,
    *,
    object_id: str | None = None,
    scale: float | None = None,
    cache_dir: Path | None = None,
    needs: Needs | None = None,
) -> ArticulatedObject:
    """Read one object of the data set.

    Args:
        path: its folder, or a zip of it.
        object_id: name in catalogues; the folder's name where None.
        scale: metres per unit of the file; `default_scale` where None.
        cache_dir: where convex decompositions are kept; `decompose.default_cache_dir()` where None.
        needs: what it is wanted for; an object of no use for that is refused before anything costly is computed.

    Raises:
        AssetError: the folder or a file in it is missing or not as it must be; the message names it. Or the object
            does not meet `needs`.
        MissingExtraError: coacd is not installed.
    """
    import_coacd()
    if not isinstance(path, Path | str):
        raise AssetError(f"path must be an object's folder or a zip of one, not {path!r}")
    if scale is not None and not (isinstance(scale, numbers.Real) and 0 < scale < np.inf):
        raise AssetError(f"scale must be a positive number (metres per unit of the file), not {scale!r}")
    with open_object(Path(path)) as (folder, name):
        identifier = object_id if object_id is not None else re.sub(r"[^A-Za-z0-9._-]", "-", name)
        check_object_id(identifier)
        source = _read_source(folder, name, needs)
        return _build_object(source, identifier, scale, cache_dir or default_cache_dir())


def default_scale(category: Category, size: np.ndarray) -> float:
    """Metres per unit of the file for an object of such size (x, y, z in file units, z up).

    Chairs 0.8 and buckets 0.3, as in the first release. A cabinet that is at least as wide (y) as high becomes
    0.65 m high, a taller one 0.9 m, but the scale stays within the first release's range, 0.28..0.81.
    """
    if category in _FIXED_SCALE:
        return _FIXED_SCALE[category]
    height_m = WIDE_CABINET_HEIGHT_M if size[1] >= size[2] else TALL_CABINET_HEIGHT_M
    return float(np.clip(height_m / size[2], *CABINET_SCALES))


def _read_source(folder: Path, name: str, needs: Needs | None) -> _Source:
    """Read the files, the small ones first, so that an object of no use is refused at once."""
    category, model_category = read_category(folder)
    if needs is not None:
        needs.check_category(name, category)
    bodies, names = build_bodies(read_urdf(folder / URDF_NAME)), read_part_names(folder)
    if needs is not None:
        needs.check_links(name, moving_links(bodies, names, category))
    drawn = read_drawn(bodies, folder, names)
    points = [vertices_of(meshes) for meshes in drawn]
    if not sum(map(len, points)):
        raise AssetError(f"{name}/{URDF_NAME}: no link has a <visual> mesh")
    rest, warnings = rest_joints(bodies, points, category == "cabinet", name)
    poses = body_poses(bodies, [joint.value if joint else 0.0 for joint in rest])
    return _Source(name, category, model_category, bodies, drawn, rest, poses, warnings)


def _build_object(source: _Source, identifier: str, scale: float | None, cache_dir: Path) -> ArticulatedObject:
    category, warnings = source.category, list(source.warnings)
    points = [vertices_of(meshes) for meshes in source.drawn]
    world = np.concatenate([transform(pose, p) for pose, p in zip(source.poses, points, strict=True)])
    low, high = world.min(axis=0), world.max(axis=0)
    scale_used = default_scale(category, high - low) if scale is None else float(scale)
    shift = -scale_used * np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]])
    place = _Placement(scale_used, shift)
    links, handles, gaps_m = _links_and_handles(source, place, cache_dir, warnings)
    warnings += find_remarks(links, handles, category)
    return ArticulatedObject(
        id=identifier,
        category=category,
        links=links,
        handles=handles,
        bounds=np.stack((place.apply(low), place.apply(high))),
        metadata={
            "source": "PartNet-Mobility",
            "partnet_id": source.name,
            "model_category": source.model_category,
            "scale": scale_used,
            "handle_gaps_m": gaps_m,
            "warnings": tuple(warnings),
        },
    )


def _links_and_handles(
    source: _Source, place: _Placement, cache_dir: Path, warnings: list[str]
) -> tuple[tuple[Link, ...], tuple[Handle, ...], tuple[float, ...]]:
    links: list[Link] = []
    handles: list[Handle] = []
    gaps_m: list[float] = []
    positions: list[np.ndarray] = []
    textures: dict[Path, np.ndarray | None] = {}
    for index, body in enumerate(source.bodies):
        joint, position = _joint_and_position(source, index, place)
        positions.append(position)
        drawn = [m.moved(source.poses[index], place.scale, place.shift - position) for m in source.drawn[index]]
        rng = _content_rng(body.name, drawn)
        for grip in _grips(body, drawn, joint, source.category, rng, warnings):
            handles.append(grip[0])
            gaps_m.append(grip[1])
        links.append(
            Link(
                name=body.name,
                parent=body.parent,
                position=position - positions[body.parent] if body.parent >= 0 else position,
                quaternion=np.array((1.0, 0.0, 0.0, 0.0)),
                joint=joint,
                visuals=visual_meshes(drawn, textures, warnings),
                collisions=_collisions(drawn, cache_dir),
                density_kg_m3=DENSITY_KG_M3[source.category],
                surface_points=_surface_points(drawn, rng),
            )
        )
    return tuple(links), tuple(handles), tuple(gaps_m)


def _joint_and_position(source: _Source, index: int, place: _Placement) -> tuple[Joint | None, np.ndarray]:
    """The joint in its link's frame, and that frame's position (3,) in the object frame at rest."""
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


def _grips(
    body: Body,
    drawn: list[DrawnMesh],
    joint: Joint | None,
    category: Category,
    rng: np.random.Generator,
    warnings: list[str],
) -> list[tuple[Handle, float]]:
    """Handles of a link with the gap behind each; none on links that do not move or never close."""
    groups = [meshes for label, meshes in group_by_part(drawn).items() if label.is_handle]
    if not groups or joint is None:
        return []
    if category == "cabinet" and np.isinf(joint.limits[0]):
        warnings.append(f"{body.name!r} turns without end: its handle is no target")
        return []
    panels = [mesh.mesh for mesh in drawn if not mesh.label.is_handle]
    panel = merge(panels) if panels else None
    found = []
    for meshes in groups:
        grip = make_grip(body.name, merge(m.mesh for m in meshes), panel, joint, category, rng)
        warnings += grip.warnings
        found.append((grip.handle, grip.gap_m))
    return found


def _collisions(drawn: list[DrawnMesh], cache_dir: Path) -> tuple[CollisionShape, ...]:
    groups = group_by_part(drawn)
    if not groups:
        return ()
    parts = [
        DecompositionPart(tuple(m.mesh for m in meshes), HANDLE if label.is_handle else BODY)
        for label, meshes in groups.items()
    ]
    hulls = decompose_cached(parts, cache_dir)
    return tuple(_shape(hull, label.name) for label, part in zip(groups, hulls, strict=True) for hull in part)


def _shape(points: np.ndarray, part: str) -> CollisionShape:
    """A hull as a shape about the middle of its bounds; a box where it fills them: MuJoCo's cheapest contact."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, still = (low + high) / 2, np.array((1.0, 0.0, 0.0, 0.0))
    if convex_hull(points).volume_m3 >= _BOX_SHARE * float(np.prod(high - low)):
        x, y, z = (float(v) for v in (high - low) / 2)
        return CollisionShape("box", (x, y, z), middle, still, None, part)
    return CollisionShape("hull", (), middle, still, points - middle, part)


def _surface_points(drawn: list[DrawnMesh], rng: np.random.Generator) -> np.ndarray:
    meshes = [mesh.mesh for mesh in drawn]
    return sample_surface(meshes, SURFACE_POINTS_PER_LINK, rng) if meshes else np.empty((0, 3))


def _content_rng(name: str, drawn: Sequence[DrawnMesh]) -> np.random.Generator:
    """A generator seeded by the link's name and geometry: the same samples on every import."""
    digest = hashlib.sha256(name.encode())
    for mesh in drawn:
        merged: TriMesh = mesh.mesh
        digest.update(np.round(merged.vertices, 9).tobytes() + merged.faces.tobytes())
    return np.random.default_rng(int.from_bytes(digest.digest()[:8], "little"))
