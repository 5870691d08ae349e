"""`import_partnet`: a PartNet-Mobility object to an `ArticulatedObject`.

What is decided here, and written to `metadata`:

- Frame: z up, ground at z = 0, front to -x (the data set's own after its fixed joint), the origin in the middle of
  a cabinet's bounds or of a chair's or bucket's footprint. All link frames are parallel to the object's with all
  joints at 0; a hinged link's frame sits on its axis, a sliding link's in the middle of its bounds. The wall of a
  cabinet that ArtiSkill exported stays a link of its own.
- Scale: the data set's models measure about 2 across; `placement.default_scale` says what they become. Folders
  that are in metres already say so themselves.
- At rest every joint is at its lower limit: closed in cabinets, let down in chairs (`placement`). Bodies that are
  rigid with the root are `base`. Links on which nothing drawn hangs are left out.
- Parts of chairs and buckets bear the benchmark's names (`part_names`); `metadata["parts"]` has both.
- Handles are the parts named so; on links that move. Where there are none, the object imports and a warning in
  `metadata["warnings"]` says so; it has no target links then.
- What has more drawn triangles than are quick is drawn with fewer (`simplify`); `metadata["warnings"]` says so.
- Collision shapes follow the drawn surfaces, part by part (`collisions`); the URDF's own are the same meshes
  again, not convex, and are left out.

The costly part, the convex decomposition, is kept on disk (`hull_cache`): a second import takes 0.1 to 0.3 s.
"""

import hashlib
import numbers
import re
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import (
    ROOM_WALL,
    ArticulatedObject,
    Category,
    Handle,
    Joint,
    Link,
    check_object_id,
)
from artiskill.assets.kinematics import shapes_volume_m3
from artiskill.assets.needs import MovingLink, Needs
from artiskill.assets.partnet.collisions import (
    Decompose,
    LinkSurface,
    collision_shapes,
    find_overlaps,
    trim_overlaps,
)
from artiskill.assets.partnet.decompose import DecompositionPart, import_coacd
from artiskill.assets.partnet.drawn import DrawnMesh, read_drawn, vertices_of, visual_meshes
from artiskill.assets.partnet.folder import URDF_NAME, open_object
from artiskill.assets.partnet.handles import ImportedHandle, clear_handles, find_handles
from artiskill.assets.partnet.hull_cache import OnProgress, decompose_cached, default_cache_dir
from artiskill.assets.partnet.part_names import UNKNOWN, WHEEL, PartNames, read_category, read_part_names
from artiskill.assets.partnet.placement import (
    Placement,
    RestJoint,
    RestRule,
    check_size,
    find_placement,
    read_own_frame,
    rest_joints,
)
from artiskill.assets.partnet.simplify import thin_out
from artiskill.assets.partnet.urdf import Body, body_poses, build_bodies, drop_empty, read_urdf, transform
from artiskill.errors import AssetError, shown
from artiskill.geometry.arrays import total
from artiskill.geometry.meshes import TriMesh, sample_surface

_SURFACE_POINTS_PER_LINK = 200
# Chairs and buckets as in the first release. Cabinets: particle board has 600-700 kg/m3, solid pine 500; hulls
# follow panels to a few millimetres, so that their volume is the wood's.
_DENSITY_KG_M3: dict[Category, float] = {"cabinet": 600.0, "chair": 200.0, "bucket": 1000.0}
_REST_RULES: dict[Category, RestRule] = {"cabinet": "close", "chair": "settle", "bucket": "keep"}
# of progress lines: what takes less needs none; from one to the next
_SILENT_S, _INTERVAL_S = 1.0, 10.0


def import_partnet(
    path: Path | str,
    *,
    object_id: str | None = None,
    scale: float | None = None,
    cache_dir: Path | None = None,
    needs: Needs | None = None,
    workers: int | None = None,
    on_progress: OnProgress | None = None,
) -> ArticulatedObject:
    """Read one object of the data set.

    The first import finds collision shapes, which takes seconds to a minute. What is done is kept, part by part:
    an import that was ended goes on from there.

    Args:
        path: its folder, or a zip of it.
        object_id: name in catalogues; the folder's name where None.
        scale: metres per unit of the file; `default_scale` where None.
        cache_dir: where convex decompositions are kept; `hull_cache.default_cache_dir()` where None.
        needs: what it is wanted for; an object of no use for that is refused before anything costly is computed.
        workers: processes that decompose parts; one per core where None. The object is the same for any number.
        on_progress: called with the parts done and those in all, a few times a second while collision shapes are
            found; where None, lines on standard error say so if it takes longer than a second.

    Raises:
        AssetError: a file is missing or not as it must be, or the object too small, too large or not as `needs`.
        MissingExtraError: coacd is not installed.
    """
    import_coacd()
    _check_arguments(path, scale, workers)
    with open_object(Path(path)) as (folder, name):
        identifier = object_id if object_id is not None else re.sub(r"[^A-Za-z0-9._-]", "-", name)
        check_object_id(identifier)

        def decompose(parts: Sequence[DecompositionPart], most: int | None) -> list[list[np.ndarray]]:
            progress = on_progress or ProgressLines(name)
            return decompose_cached(parts, cache_dir or default_cache_dir(), most, workers, progress)

        return _import_folder(folder, name, identifier, scale, decompose, needs)


def _check_arguments(path: object, scale: float | None, workers: object) -> None:
    if not isinstance(path, Path | str):
        raise AssetError(f"path must be an object's folder or a zip of one, not {shown(path)}")
    if scale is not None and not (isinstance(scale, numbers.Real) and 0 < scale < np.inf):
        raise AssetError(f"scale must be a positive number (metres per unit of the file), not {shown(scale)}")
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
        raise AssetError(f"workers must be a positive number of processes, not {shown(workers)}")


def _import_folder(
    folder: Path, name: str, identifier: str, scale: float | None, decompose: Decompose, needs: Needs | None
) -> ArticulatedObject:
    """Read the files, the small ones first, so that an object of no use is refused at once."""
    category, model_category = read_category(folder)
    if needs is not None:
        needs.check_category(name, category)
    own_frame = read_own_frame(folder)
    apart = None if own_frame is None else ROOM_WALL  # what an export wrote
    bodies, names = build_bodies(read_urdf(folder / URDF_NAME), apart), read_part_names(folder, category)
    if needs is not None:
        needs.check_links(name, _moving_links(bodies, names, category))
    if own_frame is None:
        bodies, warnings = drop_empty(bodies)
    else:  # what an export wrote is taken as it is
        warnings = []
    drawn = read_drawn(bodies, folder, names)
    points = [vertices_of(meshes) for meshes in drawn]
    if not sum(map(len, points)):
        raise AssetError(f"{name}/{URDF_NAME}: no link has a <visual> mesh")
    rule = "keep" if own_frame is not None and category != "cabinet" else _REST_RULES[category]
    rest, said = rest_joints(bodies, points, rule, name)
    warnings += said
    of_object = [i for i, body in enumerate(bodies) if i == 0 or body.joint is not None]  # not a wall behind it
    at_rest = body_poses(bodies, [joint.rest_value if joint else 0.0 for joint in rest])
    world = np.concatenate([transform(at_rest[i], points[i]) for i in of_object])
    place = find_placement(category, world, own_frame, scale)
    bounds = np.stack((place.apply(world.min(axis=0)), place.apply(world.max(axis=0))))
    check_size(np.ptp(bounds, axis=0), place.scale, name)
    poses = body_poses(bodies, [joint.value if joint else 0.0 for joint in rest])
    links, found = _build_links(_Source(category, bodies, drawn, rest, poses), place, decompose, warnings)
    handles = tuple(one.handle for one in found)
    links, said = thin_out(links, category)
    warnings += said + _final_warnings(links, handles, category)
    metadata: dict[str, Any] = {"source": "PartNet-Mobility", "partnet_id": name, "model_category": model_category}
    metadata |= {"scale": place.scale, **_measures([links[i] for i in of_object], handles, bounds)}
    metadata |= {"parts": _part_names(drawn), "handle_gaps_m": tuple(one.gap_m for one in found)}
    metadata["warnings"] = tuple(dict.fromkeys(warnings))
    return ArticulatedObject(identifier, category, links, handles, bounds, metadata)


class ProgressLines:
    """Prints a line on standard error now and then, as far as an import takes long."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._start = time.perf_counter()
        self._next_s = _SILENT_S
        self._before: int | None = None  # parts that an earlier import had done

    def __call__(self, done: int, total: int) -> None:
        """Print how many parts are done, if it is time to."""
        now = time.perf_counter() - self._start
        if self._before is None:
            self._before = done
        if now < self._next_s and not (done == total and self._next_s > _SILENT_S):
            return
        line = f"{self._name}: finding collision shapes, once: {done} of {total} parts, {now:.0f} s"
        if self._before < done < total:
            line += f", about {now / (done - self._before) * (total - done):.0f} s left"
        print(line, file=sys.stderr, flush=True)
        self._next_s = now + _INTERVAL_S


def _moving_links(bodies: tuple[Body, ...], names: PartNames, category: Category) -> tuple[MovingLink, ...]:
    """Return the links that the finished object's joints will move, and whether they will have handles.

    Doors that turn without end have no closed pose; their handles do not count.
    """
    found = []
    for body in bodies:
        if body.joint is None:
            continue
        endless = body.joint.kind == "continuous" or body.joint.limits == (-np.inf, np.inf)
        usable = any(names.label(mesh).is_handle for mesh in body.meshes)
        found.append(
            MovingLink(
                body.name,
                "prismatic" if body.joint.kind == "prismatic" else "revolute",
                usable and not (endless and category == "cabinet"),
            )
        )
    return tuple(found)


def _part_names(drawn: Sequence[Sequence[DrawnMesh]]) -> dict[str, str]:
    """Return the data set's names of all parts, and what each is called here; a name may stand for several."""
    found: dict[str, set[str]] = {}
    for meshes in drawn:
        for mesh in meshes:
            found.setdefault(mesh.label.name, set()).add(mesh.label.part)
    return {name: ", ".join(sorted(found[name])) for name in sorted(found)}


def _measures(links: Sequence[Link], handles: Sequence[Handle], bounds: np.ndarray) -> dict[str, object]:
    """Return size at rest, mass, number of joints, kinds of handles, named as of generated objects."""
    depth, width, height = (round(float(v), 4) for v in np.ptp(bounds, axis=0))
    mass = total(link.density_kg_m3 * shapes_volume_m3(link.collisions) for link in links)
    return {
        "width_m": width,
        "depth_m": depth,
        "height_m": height,
        "mass_kg": round(float(mass), 3),
        "joints": sum(link.joint is not None for link in links),
        "handles": sorted({handle.kind for handle in handles}),
    }


def _final_warnings(links: tuple[Link, ...], handles: tuple[Handle, ...], category: Category) -> list[str]:
    """Return warnings about the finished object."""
    found = []
    unnamed = [link.name for link in links if any(v.part == UNKNOWN for v in link.visuals)]
    if unnamed:
        found.append(f"meshes without a part name, in the URDF and in result.json, on: {', '.join(unnamed)}")
    found += [
        f"link {link.name!r} has no mesh: a joint in a chain, with neither surface nor mass of its own"
        for link in links[1:]
        if not link.collisions
    ]
    if category == "chair" and not any(shape.part == WHEEL for link in links for shape in link.collisions):
        found.append("no part is named wheel: the chair slides, it does not roll")
    if category == "bucket" and not handles:
        found.append("no movable link has a part named handle: the bucket has no bail")
    if category == "cabinet" and not handles:
        found.append("no movable link has a part named handle or knob: the object has no target links")
    return found + (find_overlaps(links) if category == "cabinet" else [])


@dataclass(frozen=True, eq=False)
class _Source:
    """The object as read, in the file's units; lists run over the bodies."""

    category: Category  # of the object
    bodies: tuple[Body, ...]  # its rigid bodies
    drawn: list[list[DrawnMesh]]  # their surfaces, each in its body's frame
    rest: list[RestJoint | None]  # their joints, relative to rest; None for the root
    poses: list[np.ndarray]  # (4, 4) of each in the root's frame, its joint at 0


def _build_links(
    source: _Source, place: Placement, decompose: Decompose, warnings: list[str]
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
                density_kg_m3=_DENSITY_KG_M3[source.category],
                surface_points=_surface_points(surface.drawn, rng),
            )
        )
    return tuple(links), handles


def _surfaces_and_positions(source: _Source, place: Placement) -> tuple[list[LinkSurface], list[np.ndarray]]:
    """Return what each link is made from, and its frame's position (3,) in the object with all joints at 0."""
    surfaces, positions = [], []
    for index, body in enumerate(source.bodies):
        joint, position = _joint_and_position(source, index, place)
        drawn = [m.moved(source.poses[index], place.scale, place.shift - position) for m in source.drawn[index]]
        surfaces.append(LinkSurface(body.name, drawn, joint))
        positions.append(position)
    return surfaces, positions


def _joint_and_position(source: _Source, index: int, place: Placement) -> tuple[Joint | None, np.ndarray]:
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
    return sample_surface(meshes, _SURFACE_POINTS_PER_LINK, rng) if meshes else np.empty((0, 3))


def _content_rng(surface: LinkSurface) -> np.random.Generator:
    """Return a generator seeded by the link's name and geometry: the same samples on every import."""
    digest = hashlib.sha256(surface.name.encode())
    for mesh in surface.drawn:
        merged: TriMesh = mesh.mesh
        digest.update(np.round(merged.vertices, 9).tobytes() + merged.faces.tobytes())
    return np.random.default_rng(int.from_bytes(digest.digest()[:8], "little"))
