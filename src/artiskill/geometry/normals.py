"""Corner normals of a mesh: smooth across shallow edges, sharp across steep ones."""

import numpy as np

from artiskill.geometry.arrays import arccos, dot
from artiskill.geometry.meshes import TriMesh


def face_normals(mesh: TriMesh) -> np.ndarray:
    """Unit normals (F, 3), outwards; zero for faces without area."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return _normalised(np.cross(b - a, c - a))


def corner_normals(mesh: TriMesh, crease_angle_rad: float) -> np.ndarray:
    """Unit normals (F, 3, 3) of each face's corners.

    A corner's normal is the mean over the faces that meet there and whose normals differ from its own face's by no
    more than the crease angle, weighted by the angle each face has at the corner (Thürmer and Wüthrich 1998), so
    that it does not depend on how a flat polygon was cut into triangles. Vertices at the same place count as one,
    whatever their texture coordinates.
    """
    normals = face_normals(mesh)
    _, welded = np.unique(mesh.vertices, axis=0, return_inverse=True)
    corner_vertex = welded.reshape(-1)[mesh.faces].reshape(-1)  # (3F,)
    corner_face = np.repeat(np.arange(len(mesh.faces)), 3)
    weights = _corner_angles(mesh).reshape(-1)
    corner, neighbour = _pairs_at_same_vertex(corner_vertex)
    own, other = normals[corner_face[corner]], normals[corner_face[neighbour]]
    near = (own * other).sum(axis=1) >= np.cos(crease_angle_rad) - 1e-9
    corner, neighbour, other = corner[near], neighbour[near], other[near]
    total = np.stack(
        [np.bincount(corner, weights[neighbour] * other[:, k], minlength=len(corner_face)) for k in range(3)],
        axis=1,
    )
    smooth = _normalised(total)
    flat = normals[corner_face]
    empty = (smooth == 0).all(axis=1)
    smooth[empty] = flat[empty]
    return smooth.reshape(-1, 3, 3)


def is_closed(mesh: TriMesh) -> bool:
    """Whether the surface bounds a volume and all its faces look outwards: then back faces are never seen.

    Every edge must be shared by exactly two faces that run along it in opposite directions, and the enclosed
    volume must be positive.
    """
    if len(mesh.faces) == 0:
        return False
    _, welded = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = welded.reshape(-1)[mesh.faces].astype(np.int64)
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    count = len(mesh.vertices)
    forward, backward = np.sort(start * count + end), np.sort(end * count + start)
    if len(np.unique(forward)) != len(forward) or not np.array_equal(forward, backward):
        return False
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return bool((a * np.cross(b, c)).sum() > 0)


def _corner_angles(mesh: TriMesh) -> np.ndarray:
    corners = mesh.vertices[mesh.faces]  # (F, 3, 3)
    to_next = _normalised(np.roll(corners, -1, axis=1) - corners)
    to_previous = _normalised(np.roll(corners, 1, axis=1) - corners)
    return arccos(np.clip(dot(to_next, to_previous), -1.0, 1.0))


def _pairs_at_same_vertex(corner_vertex: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All ordered pairs of corners that share a vertex, each corner with itself included."""
    order = np.argsort(corner_vertex, kind="stable")
    counts = np.bincount(corner_vertex)
    starts = np.concatenate(([0], np.cumsum(counts)[:-1]))
    partners = counts[corner_vertex[order]]  # how many pairs each sorted corner begins
    first = np.repeat(order, partners)
    offset = np.arange(partners.sum()) - np.repeat(np.cumsum(partners) - partners, partners)
    second = order[np.repeat(starts[corner_vertex[order]], partners) + offset]
    return first, second


def _normalised(v: np.ndarray) -> np.ndarray:
    lengths = np.sqrt((v * v).sum(axis=-1, keepdims=True))
    return np.where(lengths > 0, v / np.where(lengths > 0, lengths, 1.0), 0.0)
