"""Mesh operations that convex decomposition needs: welding, components, distances, thin and large hulls."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from artiskill.geometry.meshes import ConvexHull, TriMesh, convex_hull, depth_inside
from artiskill.geometry.surfaces import point_triangle_distance

_CHUNK = 2_000_000  # point-triangle pairs worked on at once: some 200 MB
_FEW_FACES = 500  # of which all are looked at; of more, those near enough to matter
_MANY_SHARE = 0.02  # of the pairs of point and triangle: beyond it, a search costs more than it saves


def weld(mesh: TriMesh, tolerance_m: float = 1e-6) -> TriMesh:
    """One vertex per place, one face per triple of vertices: seams and back-to-back twin faces are gone."""
    keys = np.round(mesh.vertices / tolerance_m).astype(np.int64)
    _, first, index = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces]
    ordered = np.sort(faces, axis=1)
    solid = (ordered[:, 0] != ordered[:, 1]) & (ordered[:, 1] != ordered[:, 2])
    _, keep = np.unique(ordered[solid], axis=0, return_index=True)
    faces = faces[solid][np.sort(keep)]
    used, faces = np.unique(faces, return_inverse=True)
    return TriMesh(mesh.vertices[first][used], faces.reshape(-1, 3))


def components(mesh: TriMesh, most: int | None = None) -> list[TriMesh]:
    """The pieces of a welded mesh that hang together by edges of exactly two faces.

    Boxes that touch along an edge or at a corner are pieces of their own, and so are sheets that meet in a T.

    Args:
        mesh: its vertices welded.
        most: of more pieces than this, none are cut out: the answer is the mesh.
    """
    return _split(mesh, _labels(_neighbours(mesh), len(mesh.faces)), most)


def flat_patches(mesh: TriMesh, angle_rad: float = 0.02, most: int | None = None) -> list[TriMesh]:
    """The pieces of a welded mesh whose neighbouring faces lie in one plane, whichever side they show.

    `most` as in `components`.
    """
    normals = np.cross(
        mesh.vertices[mesh.faces[:, 1]] - mesh.vertices[mesh.faces[:, 0]],
        mesh.vertices[mesh.faces[:, 2]] - mesh.vertices[mesh.faces[:, 0]],
    )
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    pairs = _neighbours(mesh)
    flat = np.abs(np.einsum("pi,pi->p", normals[pairs[:, 0]], normals[pairs[:, 1]])) > np.cos(angle_rad)
    return _split(mesh, _labels(pairs[flat], len(mesh.faces)), most)


def _neighbours(mesh: TriMesh) -> np.ndarray:
    """(P, 2) faces that share an edge with each other and with no third one."""
    edges = np.sort(np.concatenate([mesh.faces[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    owner = np.tile(np.arange(len(mesh.faces)), 3)
    _, edge_of, uses = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    edge_of = edge_of.reshape(-1)
    order = np.argsort(edge_of, kind="stable")
    paired = order[uses[edge_of[order]] == 2]
    return owner[paired].reshape(-1, 2)


def _labels(edges: np.ndarray, count: int) -> np.ndarray:
    graph = coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def _split(mesh: TriMesh, face_labels: np.ndarray, most: int | None) -> list[TriMesh]:
    if most is not None and len(face_labels) and face_labels.max() >= most:
        return [mesh]
    pieces = []
    for k in np.unique(face_labels):
        used, faces = np.unique(mesh.faces[face_labels == k], return_inverse=True)
        pieces.append(TriMesh(mesh.vertices[used], faces.reshape(-1, 3)))
    return pieces


def thick_hull(points: np.ndarray, thickness_m: float) -> tuple[ConvexHull, bool]:
    """The convex hull of points, made at least so thick; and whether it had to be.

    Directions in which the points extend less than `thickness_m` are padded on both sides alike.

    Args:
        points: (N, 3), N >= 1; all in one plane, on one line or in one place is legal.
        thickness_m: least extent along every principal axis.
    """
    axes = principal_axes(points)
    along = points @ axes.T
    missing = np.maximum(thickness_m - np.ptp(along, axis=0), 0.0)
    if not missing.any():
        return convex_hull(points), False
    for axis, pad in zip(axes, missing, strict=True):
        if pad > 0:
            points = np.concatenate((points + axis * pad / 2, points - axis * pad / 2))
    return convex_hull(points), True


def principal_axes(points: np.ndarray) -> np.ndarray:
    """(3, 3) unit rows: the directions in which points (N, 3) spread most, less and least."""
    centred = points - points.mean(axis=0)
    return np.linalg.eigh(centred.T @ centred)[1].T[::-1]


def limit_vertices(points: np.ndarray, most: int) -> np.ndarray:
    """At most so many of a hull's corners, chosen so that little of the hull is lost. -> (V, 3).

    Starts from the extreme points along the principal axes and adds the corner that lies furthest outside,
    again and again. The result lies inside the original hull.
    """
    corners = convex_hull(points).mesh.vertices
    if len(corners) <= most:
        return corners
    centred = corners - corners.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    along = centred @ axes.T
    chosen = set(along.argmin(axis=0).tolist()) | set(along.argmax(axis=0).tolist())
    while len(chosen) < most:
        planes = convex_hull(corners[sorted(chosen)]).planes if len(chosen) > 3 else None
        outside = -depth_inside(planes, corners) if planes is not None else np.linalg.norm(centred, axis=1)
        outside[sorted(chosen)] = -np.inf
        furthest = int(np.argmax(outside))
        if outside[furthest] <= 1e-9:
            break
        chosen.add(furthest)
    return corners[sorted(chosen)]


def distance_to_surface(points: np.ndarray, mesh: TriMesh) -> np.ndarray:
    """Distance of each point (N, 3) to the nearest point of a mesh's triangles. -> (N,), metres, exact."""
    corners = mesh.vertices[mesh.faces]  # (F, 3, 3)
    return _nearest_of_many(points, corners) if len(corners) > _FEW_FACES else _nearest_of_all(points, corners)


def _nearest_of_all(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    step = max(1, _CHUNK // max(len(corners), 1))
    chunks = [_nearest(points[i : i + step], corners) for i in range(0, len(points), step)]
    return np.concatenate(chunks)


def _nearest_of_many(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """`_nearest`, for which only those triangles are looked at whose spheres reach nearer than a known corner.

    Triangles of like size share a search tree, so that a few large ones do not widen the search among small ones.
    """
    from scipy.spatial import cKDTree

    centres = corners.mean(axis=1)
    reach = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    nearest = cKDTree(corners.reshape(-1, 3)).query(points)[0]
    sizes = np.frexp(reach)[1]
    for size in np.unique(sizes):
        of_size = np.flatnonzero(sizes == size)
        within = nearest + float(reach[of_size].max())
        tree = cKDTree(centres[of_size])
        counts = tree.query_ball_point(points, within, return_length=True)
        if counts.sum() > _MANY_SHARE * len(points) * len(of_size):  # needles, say: all of them are sooner done
            nearest = np.minimum(nearest, _nearest_of_all(points, corners[of_size]))
            continue
        found = tree.query_ball_point(points, within, return_sorted=True)
        point = np.repeat(np.arange(len(points)), counts)
        triangle = of_size[np.concatenate([np.asarray(one, dtype=np.int64) for one in found])]
        for i in range(0, len(point), _CHUNK):
            at = slice(i, i + _CHUNK)
            distance = point_triangle_distance(points[point[at]], corners[triangle[at]])
            np.minimum.at(nearest, point[at], distance)
    return nearest


def _nearest(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(N, 3) x (F, 3, 3) -> (N,): the nearest of the face's inside and its three edges."""
    squared = np.full((len(points), len(corners)), np.inf)
    for k in range(3):
        start, end = corners[:, k], corners[:, (k + 1) % 3]
        squared = np.minimum(squared, _to_segments(points, start, end))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    solid = length > 1e-15
    normal[solid] /= length[solid, None]
    height = points @ normal.T - np.einsum("fi,fi->f", corners[:, 0], normal)  # (N, F)
    inside = np.broadcast_to(solid, height.shape).copy()
    for k in range(3):
        inward = np.cross(normal, corners[:, (k + 1) % 3] - corners[:, k])
        inside &= points @ inward.T >= np.einsum("fi,fi->f", corners[:, k], inward)
    return np.sqrt(np.where(inside, np.minimum(squared, height**2), squared).min(axis=1))


def _to_segments(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Squared distances of points (N, 3) to segments (F, 3), (F, 3). -> (N, F)."""
    direction = end - start
    length2 = np.maximum(np.einsum("fi,fi->f", direction, direction), 1e-30)
    t = (points @ direction.T - np.einsum("fi,fi->f", start, direction)) / length2
    t = np.clip(t, 0.0, 1.0)[..., None]
    offset = points[:, None] - start - t * direction
    return np.einsum("nfi,nfi->nf", offset, offset)
