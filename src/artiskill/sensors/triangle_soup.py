"""`TriangleSoup`: all surfaces of a scene as flat arrays in their bodies' frames, built once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import VisualMesh
from artiskill.errors import AssetError
from artiskill.sensors.mipmaps import pack_textures
from artiskill.sensors.normals import corner_normals, is_closed
from artiskill.sensors.twins import have_opposite_twins

WORLD_FIXED = -1


@dataclass(frozen=True, eq=False)
class BodyVisual:
    """A surface that moves with a body.

    Attributes:
        body: index into the poses given to `Renderer.render`, or `WORLD_FIXED` (-1) for one that never moves.
        visual: the surface in the body's frame, its material and its part.
    """

    body: int
    visual: VisualMesh


@dataclass(frozen=True, eq=False)
class TriangleSoup:
    """Triangles of all visuals, one after the other. V vertices, F faces, G visuals ("geoms").

    Attributes:
        vertices: (V, 3) float64, in the body's frame, metres.
        vertex_pose: (V,) int32 index of the vertex's body plus 1: 0 is the world.
        faces: (F, 3) int32 vertices, counter-clockwise seen from outside.
        face_geom: (F,) int32 index of the visual.
        face_body: (F,) int32 index of the body, -1 where fixed to the world.
        face_two_sided: (F,) bool, whether its back may be seen: its mesh is no closed, outward-looking surface,
            and no other face lies there that shows the other side.
        corner_normals: (F, 3, 3) float32 unit normals in the body's frame.
        corner_uvs: (F, 3, 2) float32 texture coordinates, v upwards; zero where there are none.
        materials: (G, 4) float64 linear red, green, blue and the shininess, all in [0, 1].
        textures: (G, M, 3) int64 first texel, height and width of the M versions of the visual's texture, the
            largest first; height 0 means none.
        texels: (T, 3) uint8 sRGB, all versions row by row, the top row first.
        geom_vertices: (G + 1,) int64 first vertex of each visual, and V.
        geom_faces: (G + 1,) int64 first face of each visual, and F.
        geom_body: (G,) int32 index of the body, -1 where fixed to the world.
        geom_part: (G,) int32 index of the visual's part in `part_names`.
        part_names: (P,) names of parts, sorted.
        body_count: one more than the largest body index.
    """

    vertices: np.ndarray
    vertex_pose: np.ndarray
    faces: np.ndarray
    face_geom: np.ndarray
    face_body: np.ndarray
    face_two_sided: np.ndarray
    corner_normals: np.ndarray
    corner_uvs: np.ndarray
    materials: np.ndarray
    textures: np.ndarray
    texels: np.ndarray
    geom_vertices: np.ndarray
    geom_faces: np.ndarray
    geom_body: np.ndarray
    geom_part: np.ndarray
    part_names: tuple[str, ...]
    body_count: int


def build_triangle_soup(
    visuals: Sequence[BodyVisual], crease_angle_rad: float, max_texture_px: int
) -> TriangleSoup:
    """Flatten visuals; their order gives the geom ids.

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
    meshes = [item.visual.mesh for item in visuals]
    bodies = np.array([item.body for item in visuals], dtype=np.int32)
    vertex_counts = [len(m.vertices) for m in meshes]
    face_counts = [len(m.faces) for m in meshes]
    offsets = np.cumsum([0, *vertex_counts])
    part_names = tuple(sorted({item.visual.part for item in visuals}))
    face_geom = np.repeat(np.arange(len(meshes), dtype=np.int32), face_counts)
    textures, texels = pack_textures([item.visual for item in visuals], max_texture_px)
    vertices = _stack([m.vertices for m in meshes], (0, 3), np.float64)
    vertex_pose = np.repeat(bodies + 1, vertex_counts).astype(np.int32)
    faces = _stack([m.faces + o for m, o in zip(meshes, offsets[:-1], strict=True)], (0, 3), np.int32)
    is_open = np.repeat(np.array([not is_closed(m) for m in meshes], dtype=np.bool_), face_counts)
    return TriangleSoup(
        vertices=vertices,
        vertex_pose=vertex_pose,
        faces=faces,
        face_geom=face_geom,
        face_body=bodies[face_geom].astype(np.int32),
        face_two_sided=is_open & ~have_opposite_twins(vertices, vertex_pose, faces),
        corner_normals=_stack([corner_normals(m, crease_angle_rad) for m in meshes], (0, 3, 3), np.float32),
        corner_uvs=_stack([_corner_uvs(item.visual) for item in visuals], (0, 3, 2), np.float32),
        materials=_stack(
            [[(*item.visual.material.rgba[:3], item.visual.material.shininess)] for item in visuals],
            (0, 4),
            np.float64,
        ),
        textures=textures,
        texels=texels,
        geom_vertices=offsets.astype(np.int64),
        geom_faces=np.cumsum([0, *face_counts]).astype(np.int64),
        geom_body=bodies,
        geom_part=np.array([part_names.index(item.visual.part) for item in visuals], dtype=np.int32),
        part_names=part_names,
        body_count=int(bodies.max(initial=-1)) + 1,
    )


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


def _corner_uvs(visual: VisualMesh) -> np.ndarray:
    if visual.mesh.uvs is None:
        return np.zeros((len(visual.mesh.faces), 3, 2), dtype=np.float32)
    return visual.mesh.uvs[visual.mesh.faces]


def _stack(parts: Sequence[object], empty_shape: tuple[int, ...], dtype: type) -> np.ndarray:
    """All parts one after the other, contiguous; an empty array where there are none."""
    arrays: list[np.ndarray] = [np.asarray(part, dtype=dtype) for part in parts]
    return np.ascontiguousarray(np.concatenate(arrays) if arrays else np.zeros(empty_shape), dtype=dtype)
