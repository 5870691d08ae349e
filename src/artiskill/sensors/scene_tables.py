"""`SceneTables`: a triangle soup laid out for the kernels that draw it, and what can be computed before any pose.

Vertices and faces of a visual ("geom") follow one another, so that a kernel handles one visual at a time, in small
memory, and can leave out whole visuals that no camera sees.
"""

from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array
from artiskill.sensors.triangle_soup import TriangleSoup

# the plane of a face that is drawn from behind too: no camera is behind it
_NEVER_BEHIND = -1e30


class SceneTables(NamedTuple):
    """V vertices, F faces, G geoms, S lit points (a vertex with one of its normals). Body frames, metres.

    Attributes:
        vertices: (V, 3) float64.
        faces: (F, 3) int32 vertices.
        planes: (4, F) float32 unit normal and offset of each face; in front of it, normal . x > offset.
        two_sided: (F,) bool.
        face_geom: (F,) int32.
        geom_vertices: (G + 1,) int64 first vertex of each geom.
        geom_faces: (G + 1,) int64 first face of each geom.
        geom_spheres: (G, 4) float64 centre and radius of a sphere around each geom.
        geom_body: (G,) int32, -1 where fixed to the world.
        geom_body_id: (G,) int32 the same as it stands in images: -2 where fixed to the world.
        geom_part: (G,) int32 index into the soup's `part_names`.
        face_rows: (F, 8) int32 what shading asks of a face, side by side in memory: its vertices, the lit points
            of its corners, its visual, and 1 if the corners have one normal, else 0.
        point_vertex: (S,) int32 its vertex.
        point_normals: (S, 3) float32 its unit normal.
        corner_uvs: (F, 3, 2) float32.
        materials: (G, 4) float64, as in `TriangleSoup`.
        textures: (G, M, 3) int64, as in `TriangleSoup`.
        texels: (T, 3) uint8, as in `TriangleSoup`.
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
    point_vertex: Array
    point_normals: Array
    corner_uvs: Array
    materials: Array
    textures: Array
    texels: Array


def build_scene_tables(soup: TriangleSoup) -> SceneTables:
    """Lay out a soup, once per scene."""
    corner_points, point_vertex, point_normals = _lit_points(soup)
    normals = soup.corner_normals
    flat = (normals == normals[:, :1]).all(axis=(1, 2))
    face_rows = np.column_stack((soup.faces, corner_points, soup.face_geom, flat))
    return SceneTables(
        vertices=soup.vertices,
        faces=soup.faces,
        planes=_face_planes(soup),
        two_sided=soup.face_two_sided,
        face_geom=soup.face_geom,
        geom_vertices=soup.geom_vertices,
        geom_faces=soup.geom_faces,
        geom_spheres=_bounding_spheres(soup),
        geom_body=soup.geom_body,
        # a world-fixed visual's id must differ from "nothing", which is -1 too
        geom_body_id=np.where(soup.geom_body < 0, -2, soup.geom_body).astype(np.int32),
        geom_part=soup.geom_part,
        face_rows=np.ascontiguousarray(face_rows, dtype=np.int32),
        point_vertex=point_vertex,
        point_normals=point_normals,
        corner_uvs=soup.corner_uvs,
        materials=soup.materials,
        textures=soup.textures,
        texels=soup.texels,
    )


def _face_planes(soup: TriangleSoup) -> np.ndarray:
    a, b, c = (soup.vertices[soup.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.sqrt((normal * normal).sum(axis=1))
    has_area = (length > 0) & np.isfinite(length)
    normal = np.where(has_area[:, None], normal / np.where(has_area, length, 1.0)[:, None], 0.0)
    offset = np.where(has_area & ~soup.face_two_sided, (normal * a).sum(axis=1), _NEVER_BEHIND)
    return np.ascontiguousarray(np.concatenate((normal.T, offset[None])), dtype=np.float32)


def _bounding_spheres(soup: TriangleSoup) -> np.ndarray:
    spheres = np.zeros((len(soup.geom_body), 4))
    for geom, (first, last) in enumerate(zip(soup.geom_vertices[:-1], soup.geom_vertices[1:], strict=True)):
        if first == last:
            continue
        vertices = soup.vertices[first:last]
        centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
        # a little larger than it need be: rounding must never hide a surface
        radius = 1.000001 * np.sqrt(((vertices - centre) ** 2).sum(axis=1).max()) + 1e-6
        spheres[geom] = *centre, radius
    return spheres


def _lit_points(soup: TriangleSoup) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners with the same vertex and normal are lit alike: (F, 3) their number, (S,) vertex, (S, 3) normal."""
    keys = np.empty((3 * len(soup.faces), 4), dtype=np.int32)
    keys[:, 0] = soup.faces.reshape(-1)
    keys[:, 1:] = (soup.corner_normals.reshape(-1, 3) + np.float32(0.0)).view(np.int32)  # + 0: no negative zeros
    order = np.lexsort(keys.T[::-1])
    fresh = np.ones(len(keys), dtype=np.bool_)
    fresh[1:] = (keys[order[1:]] != keys[order[:-1]]).any(axis=1)
    numbers = np.empty(len(keys), dtype=np.int32)
    numbers[order] = np.cumsum(fresh) - 1
    chosen = order[fresh]
    normals = np.ascontiguousarray(soup.corner_normals.reshape(-1, 3)[chosen])
    return numbers.reshape(-1, 3), np.ascontiguousarray(keys[chosen, 0]), normals
