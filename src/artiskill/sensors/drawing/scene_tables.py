"""`SceneTables`: all surfaces of a scene as flat arrays in their bodies' frames, laid out once for the kernels.

Vertices and faces of a visual ("geom") follow one another, so that a kernel handles one visual at a time, in small
memory, and can leave out whole visuals that no camera sees.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from PIL import Image

from artiskill.assets.articulated_object import VisualMesh
from artiskill.errors import AssetError
from artiskill.geometry.kernel import Array
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.normals import corner_normals, is_closed

WORLD_FIXED = -1
# each half as large as the one before; those that a small texture lacks repeat its smallest
MIP_LEVELS = 10
# the plane of a face that is drawn from behind too: no camera is behind it
_NEVER_BEHIND = -1e30
_SURFACES = 512  # meshes, about ten scenes of them


@dataclass(frozen=True, eq=False)
class BodyVisual:
    """A surface that moves with a body.

    Attributes:
        body: index into the poses given to `Renderer.render`, or `WORLD_FIXED` (-1) for one that never moves.
        visual: the surface in the body's frame, its material and its part.
    """

    body: int
    visual: VisualMesh


class SceneTables(NamedTuple):
    """V vertices, F faces, G geoms, S lit points (a vertex with one of its normals). Body frames, metres.

    Attributes:
        vertices: (V, 3) float64.
        faces: (F, 3) int32 vertices, counter-clockwise seen from outside.
        planes: (4, F) float32 unit normal and offset of each face; in front of it, normal . x > offset.
        two_sided: (F,) bool, whether its back may be seen: its mesh is no closed, outward-looking surface, and no
            other face lies there that shows the other side.
        face_geom: (F,) int32.
        geom_vertices: (G + 1,) int64 first vertex of each geom, and V.
        geom_faces: (G + 1,) int64 first face of each geom, and F.
        geom_spheres: (G, 4) float64 centre and radius of a sphere around each geom.
        geom_body: (G,) int32, -1 where fixed to the world.
        geom_body_id: (G,) int32 the same as it stands in images: -2 where fixed to the world.
        geom_part: (G,) int32 index of the part among `part_names`.
        face_rows: (F, 8) int32 what shading asks of a face, side by side in memory: its vertices, the lit points
            of its corners, its geom, and 1 if the corners have one normal, else 0.
        point_normals: (S, 3) float32 unit normal of each lit point.
        corner_uvs: (F, 3, 2) float32 texture coordinates, v upwards; zero where there are none.
        materials: (G, 4) float64 linear red, green, blue and the shininess, all in [0, 1].
        textures: (G, M, 3) int64 first texel, height and width of the M versions of the geom's texture, the
            largest first; height 0 means none.
        texels: (T, 3) uint8 sRGB, all versions row by row, the top row first.
    """

    vertices: Array
    faces: Array
    planes: Array
    two_sided: Array
    face_geom: Array
    geom_vertices: Array
    geom_faces: Array
    geom_spheres: Array
    geom_body: Array
    geom_body_id: Array
    geom_part: Array
    face_rows: Array
    point_normals: Array
    corner_uvs: Array
    materials: Array
    textures: Array
    texels: Array


class Poses(NamedTuple):
    """The world, index 0, and N bodies: `positions` (B, N + 1, 3), `rotations` (B, N + 1, 3, 3); B for several."""

    positions: Array
    rotations: Array


def part_names(visuals: Sequence[BodyVisual]) -> tuple[str, ...]:
    """Return the names of all parts, sorted."""
    return tuple(sorted({item.visual.part for item in visuals}))


def build_scene_tables(visuals: Sequence[BodyVisual], crease_angle_rad: float, max_texture_px: int) -> SceneTables:
    """Lay out visuals; their order gives the geom ids.

    Args:
        visuals: any number, also none.
        crease_angle_rad: edges flatter than this are shaded smoothly.
        max_texture_px: larger textures are shrunk to this side length.

    Raises:
        AssetError: a body index below -1, a vertex that is not finite, a face that names no vertex, or a texture
            that is no (H, W, 3) uint8 image.
    """
    for geom, item in enumerate(visuals):
        _check_visual(geom, item)
    meshes, geoms = [item.visual.mesh for item in visuals], _geom_tables(visuals)
    face_counts = np.diff(geoms["geom_faces"])
    vertices = _stack([m.vertices for m in meshes], (0, 3), np.float64)
    firsts = geoms["geom_vertices"][:-1]
    faces = _stack([m.faces + o for m, o in zip(meshes, firsts, strict=True)], (0, 3), np.int32)
    surfaces = [_surface(mesh, crease_angle_rad) for mesh in meshes]
    is_open = np.repeat(np.array([not one.is_closed for one in surfaces], dtype=np.bool_), face_counts)
    vertex_body = np.repeat(geoms["geom_body"], np.diff(geoms["geom_vertices"]))
    two_sided = is_open & ~have_opposite_faces(vertices, vertex_body, faces)
    face_geom = np.repeat(np.arange(len(meshes), dtype=np.int32), face_counts)
    normals = _stack([one.normals for one in surfaces], (0, 3, 3), np.float32)
    point_normals, face_rows = _lit_points(faces, face_geom, normals)
    textures, texels = pack_textures([item.visual for item in visuals], max_texture_px)
    return SceneTables(
        vertices=vertices,
        faces=faces,
        planes=_face_planes(vertices[faces], two_sided),
        two_sided=two_sided,
        face_geom=face_geom,
        face_rows=face_rows,
        point_normals=point_normals,
        corner_uvs=_stack([_corner_uvs(item.visual) for item in visuals], (0, 3, 2), np.float32),
        textures=textures,
        texels=texels,
        **geoms,
    )


class _Surface(NamedTuple):
    """What takes long to find out about a mesh."""

    is_closed: bool
    normals: Array  # of `corner_normals`, float32


@lru_cache(maxsize=_SURFACES)
def _surface(mesh: TriMesh, crease_angle_rad: float) -> _Surface:
    """Return the surface of a mesh; robots are the same in all scenes."""
    return _Surface(is_closed(mesh), corner_normals(mesh, crease_angle_rad).astype(np.float32))


def _geom_tables(visuals: Sequence[BodyVisual]) -> dict[str, np.ndarray]:
    """Return those fields of `SceneTables` that have an entry for each geom, but for the textures."""
    meshes, parts = [item.visual.mesh for item in visuals], part_names(visuals)
    geom_body = np.array([item.body for item in visuals], dtype=np.int32)
    return {
        "geom_vertices": np.cumsum([0, *(len(m.vertices) for m in meshes)]).astype(np.int64),
        "geom_faces": np.cumsum([0, *(len(m.faces) for m in meshes)]).astype(np.int64),
        "geom_spheres": _bounding_spheres([m.vertices for m in meshes]),
        "geom_body": geom_body,
        # a world-fixed visual's id must differ from "nothing", which is -1 too
        "geom_body_id": np.where(geom_body < 0, -2, geom_body).astype(np.int32),
        "geom_part": np.array([parts.index(item.visual.part) for item in visuals], dtype=np.int32),
        "materials": _stack([_material_row(item.visual) for item in visuals], (0, 4), np.float64),
    }


def _check_visual(geom: int, item: BodyVisual) -> None:
    mesh, material = item.visual.mesh, item.visual.material
    what = f"visual {geom} ({item.visual.part!r}, body {item.body})"
    if item.body < WORLD_FIXED:
        raise AssetError(f"{what}: the body index must be {WORLD_FIXED} (the world) or not negative")
    if not np.isfinite(mesh.vertices).all():
        raise AssetError(f"{what}: a vertex is not finite")
    if len(mesh.faces) and (mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices)):
        raise AssetError(f"{what}: a face names a vertex outside 0 .. {len(mesh.vertices) - 1}")
    if mesh.uvs is not None and not np.isfinite(mesh.uvs).all():
        raise AssetError(f"{what}: a texture coordinate is not finite")
    if not np.isfinite((*material.rgba, material.shininess)).all():
        raise AssetError(f"{what}: the material {material.name!r} has a value that is not finite")
    texture = material.texture
    if texture is not None and not _is_image(texture):
        raise AssetError(f"{what}: a texture must be (H, W, 3) uint8, not {texture.shape} {texture.dtype}")


def _is_image(texture: np.ndarray) -> bool:
    return texture.ndim == 3 and texture.shape[2] == 3 and texture.dtype == np.uint8 and texture.size > 0


def _stack(parts: Sequence[object], empty_shape: tuple[int, ...], dtype: type) -> np.ndarray:
    """Put all parts one after the other, contiguous; an empty array where there are none."""
    arrays: list[np.ndarray] = [np.asarray(part, dtype=dtype) for part in parts]
    return np.ascontiguousarray(np.concatenate(arrays) if arrays else np.zeros(empty_shape), dtype=dtype)


def have_opposite_faces(vertices: np.ndarray, vertex_body: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return which faces lie back to back with another: same three places, same body, opposite order.

    Modellers write faces twice, once for each side, to colour the two sides differently. The back of such a face
    must not be drawn: the opposite face is there, with the colour of that side, and at equal depth chance would
    decide between them.

    Args:
        vertices: (V, 3) in the frames of their bodies.
        vertex_body: (V,) integers, the same for vertices of one body.
        faces: (F, 3) vertices.

    Returns:
        (F,) bool; false for faces without area.
    """
    if len(faces) == 0:
        return np.zeros(0, dtype=np.bool_)
    # a number per place and body, whatever mesh the vertex is of; + 0: no negative zeros
    places = _number_rows(np.column_stack((vertices + 0.0, vertex_body)))[0][faces]  # (F, 3)
    # the smallest first, the order round kept: what follows then says which way round
    start = places.argmin(axis=1)
    cycle = np.take_along_axis(places, (start[:, None] + np.arange(3)) % 3, axis=1)
    first, second, third = cycle[:, 0], cycle[:, 1:].min(axis=1), cycle[:, 1:].max(axis=1)
    group, _ = _number_rows(np.column_stack((first, second, third)))
    forward = cycle[:, 1] < cycle[:, 2]
    both = (np.bincount(group, forward) > 0) & (np.bincount(group, ~forward) > 0)
    return both[group] & (first != second) & (second != third)


def _lit_points(
    faces: np.ndarray, face_geom: np.ndarray, corner_normals: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return `point_normals` and `face_rows`: corners with the same vertex and normal are lit alike."""
    normals = corner_normals.reshape(-1, 3)
    bits = (normals + np.float32(0.0)).view(np.int32)  # + 0: no negative zeros
    numbers, chosen = _number_rows(np.column_stack((faces.reshape(-1), bits)))
    flat = (corner_normals == corner_normals[:, :1]).all(axis=(1, 2))
    rows = np.column_stack((faces, numbers.reshape(-1, 3), face_geom, flat))
    return np.ascontiguousarray(normals[chosen]), np.ascontiguousarray(rows, dtype=np.int32)


def _number_rows(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number the different rows (N, k) in order: the number of each row, and a row of each number."""
    order = np.lexsort(rows.T[::-1])
    fresh = np.ones(len(rows), dtype=np.bool_)
    fresh[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    numbers = np.empty(len(rows), dtype=np.int64)
    numbers[order] = np.cumsum(fresh) - 1
    return numbers, order[fresh]


def _face_planes(corners: np.ndarray, two_sided: np.ndarray) -> np.ndarray:
    """Return `SceneTables.planes` of corners (F, 3, 3)."""
    a, b, c = corners.swapaxes(0, 1)
    normal = np.cross(b - a, c - a)
    length = np.sqrt((normal * normal).sum(axis=1))
    has_area = (length > 0) & np.isfinite(length)
    normal = np.where(has_area[:, None], normal / np.where(has_area, length, 1.0)[:, None], 0.0)
    offset = np.where(has_area & ~two_sided, (normal * a).sum(axis=1), _NEVER_BEHIND)
    return np.ascontiguousarray(np.concatenate((normal.T, offset[None])), dtype=np.float32)


def _bounding_spheres(meshes: Sequence[np.ndarray]) -> np.ndarray:
    """Return `SceneTables.geom_spheres` of each mesh's vertices."""
    spheres = np.zeros((len(meshes), 4))
    for sphere, vertices in zip(spheres, meshes, strict=True):
        if len(vertices):
            centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
            # a little larger than it need be: rounding must never hide a surface
            radius = 1.000001 * np.sqrt(((vertices - centre) ** 2).sum(axis=1).max()) + 1e-6
            sphere[:] = *centre, radius
    return spheres


def _corner_uvs(visual: VisualMesh) -> np.ndarray:
    if visual.mesh.uvs is None:
        return np.zeros((len(visual.mesh.faces), 3, 2), dtype=np.float32)
    return visual.mesh.uvs[visual.mesh.faces]


def _material_row(visual: VisualMesh) -> list[tuple[float, ...]]:
    return [(*visual.material.rgba[:3], visual.material.shininess)]


def pack_textures(visuals: Sequence[VisualMesh], max_px: int) -> tuple[np.ndarray, np.ndarray]:
    """Return all textures with ever smaller versions of themselves (mipmaps, Williams 1983).

    Visuals that share an image share its texels.

    Args:
        visuals: those with a texture and texture coordinates are textured.
        max_px: larger textures are shrunk to this side length.

    Returns:
        `SceneTables.textures` with M = MIP_LEVELS, all 0 where there is none, and `SceneTables.texels`.
    """
    rows = np.zeros((len(visuals), MIP_LEVELS, 3), dtype=np.int64)
    packed: dict[int, np.ndarray] = {}
    texels: list[np.ndarray] = []
    used = 0
    for geom, visual in enumerate(visuals):
        texture = visual.material.texture
        if texture is None or visual.mesh.uvs is None:
            continue
        if id(texture) not in packed:
            entry = []
            for image in _versions(texture, max_px):
                entry.append((used, image.shape[0], image.shape[1]))
                texels.append(image.reshape(-1, 3))
                used += len(texels[-1])
            entry += entry[-1:] * (MIP_LEVELS - len(entry))
            packed[id(texture)] = np.array(entry)
        rows[geom] = packed[id(texture)]
    return rows, np.ascontiguousarray(np.concatenate(texels)) if texels else np.zeros((0, 3), dtype=np.uint8)


def _versions(texture: np.ndarray, max_px: int) -> list[np.ndarray]:
    """Return the image at most `max_px` large, and halved until one pixel is left or the levels run out."""
    height, width = texture.shape[:2]
    scale = min(1.0, max_px / max(height, width))
    images = [_resized(texture, math.floor(height * scale), math.floor(width * scale))]
    while max(images[-1].shape[:2]) > 1 and len(images) < MIP_LEVELS:
        height, width = images[-1].shape[:2]
        images.append(_resized(images[-1], height // 2, width // 2))
    return images


def _resized(image: np.ndarray, height: int, width: int) -> np.ndarray:
    height, width = max(1, height), max(1, width)
    if image.shape[:2] == (height, width):
        return image
    return np.asarray(Image.fromarray(image).resize((width, height), Image.Resampling.BOX))
