"""Mesh operations for convex decomposition: welding, pieces, cuts, distances; hulls made thick and joined."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from artiskill.geometry.meshes import ConvexHull, TriMesh, convex_hull, depth_inside, triangle_areas
from artiskill.geometry.normals import face_normals
from artiskill.geometry.surfaces import point_triangle_distance

_CHUNK = 2_000_000  # point-triangle pairs worked on at once: some 200 MB
_MERGE_DISTANCE_M = 1e-7
_FEW_FACES = 500  # of which all are looked at; of more, those near enough to matter
_MANY_SHARE = 0.02  # of the pairs of point and triangle: beyond it, a search costs more than it saves


# Hulls whose bounds are this near are tried first; further ones, in steps, where that leaves too many. To try all
# pairs of a few hundred takes minutes, and what is joined over a distance fills the space between.
_NEAR_M, _STEP = 0.02, 4.0


def weld(mesh: TriMesh, tolerance_m: float = 1e-6) -> TriMesh:
    """Return a mesh with one vertex per place and one face per triple: no seams, no opposite faces."""
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
    """Return the pieces of a welded mesh that are connected by edges of exactly two faces.

    Boxes that touch along an edge or at a corner are pieces of their own, and so are sheets that meet in a T.

    Args:
        mesh: its vertices welded.
        most: of more pieces than this, none are cut out: the answer is the mesh.
    """
    return _split(mesh, connected_labels(_neighbours(mesh), len(mesh.faces)), most)


def flat_patches(mesh: TriMesh, angle_rad: float = 0.02, most: int | None = None) -> list[TriMesh]:
    """Return the pieces of a welded mesh whose neighbouring faces lie in one plane, whichever side they show.

    `most` as in `components`.
    """
    normals = face_normals(mesh)
    pairs = _neighbours(mesh)
    flat = np.abs(np.einsum("pi,pi->p", normals[pairs[:, 0]], normals[pairs[:, 1]])) > np.cos(angle_rad)
    return _split(mesh, connected_labels(pairs[flat], len(mesh.faces)), most)


def _neighbours(mesh: TriMesh) -> np.ndarray:
    """Return pairs (P, 2) of faces that share an edge with each other and with no third one."""
    edges = np.sort(np.concatenate([mesh.faces[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    owner = np.tile(np.arange(len(mesh.faces)), 3)
    _, edge_of, uses = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    edge_of = edge_of.reshape(-1)
    order = np.argsort(edge_of, kind="stable")
    paired = order[uses[edge_of[order]] == 2]
    return owner[paired].reshape(-1, 2)


def connected_labels(edges: np.ndarray, count: int) -> np.ndarray:
    """Return for each of `count` nodes the number of its component, (N,); edges are (E, 2) pairs of nodes."""
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


def cut(mesh: TriMesh, normal: np.ndarray, offset: float) -> TriMesh | None:
    """Return the part of a mesh with `normal . x >= offset`, left open, without uvs; None if nothing is left."""
    heights = mesh.vertices @ normal - offset
    above = heights[mesh.faces] >= 0
    count = above.sum(axis=1)
    corners = [mesh.vertices[mesh.faces[count == 3]]]
    for inside, lone in ((1, True), (2, False)):
        faces = mesh.faces[count == inside]
        if not len(faces):
            continue
        # turn each face so that its odd corner out is the first
        first = np.argmax(above[count == inside] if lone else ~above[count == inside], axis=1)
        turned = np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1)
        a, b, c = (mesh.vertices[turned[:, k]] for k in range(3))
        ha, hb, hc = (heights[turned[:, k]][:, None] for k in range(3))
        ab, ac = a + (b - a) * (ha / (ha - hb)), a + (c - a) * (ha / (ha - hc))
        if lone:
            corners.append(np.stack((a, ab, ac), axis=1))
        else:
            corners += [np.stack((ab, b, c), axis=1), np.stack((ab, c, ac), axis=1)]
    triangles = np.concatenate(corners)
    if not len(triangles):
        return None
    return TriMesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))


def slab(mesh: TriMesh, axis: np.ndarray, low: float, high: float) -> TriMesh | None:
    """Return the part of a mesh with `low <= axis . x <= high`; None if there is none."""
    upper = cut(mesh, axis, low)
    return None if upper is None else cut(upper, -axis, -high)


def thick_hull(points: np.ndarray, thickness_m: float) -> tuple[ConvexHull, bool]:
    """Return the convex hull of points, made at least so thick, and whether it had to be.

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
    """Return (3, 3) unit rows: the directions in which points (N, 3) spread most, less and least."""
    centred = points - points.mean(axis=0)
    return np.linalg.eigh(centred.T @ centred)[1].T[::-1]


def thick_corners(points: np.ndarray, thickness_m: float) -> np.ndarray:
    """Return corners (V, 3) of the points' hull, made thick enough for an engine; points so near are one."""
    _, keep = np.unique(np.round(points / _MERGE_DISTANCE_M).astype(np.int64), axis=0, return_index=True)
    return thick_hull(points[np.sort(keep)], thickness_m)[0].mesh.vertices


def limit_vertices(points: np.ndarray, most: int) -> np.ndarray:
    """Return at most so many of a hull's corners (V, 3), chosen so that little of the hull is lost.

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
    """Return the exact distance (metres) of each point (N, 3) to a mesh's triangles, (N,)."""
    corners = mesh.vertices[mesh.faces]  # (F, 3, 3)
    return _nearest_of_many(points, corners) if len(corners) > _FEW_FACES else _nearest_of_all(points, corners)


def _nearest_of_all(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    step = max(1, _CHUNK // max(len(corners), 1))
    chunks = [_nearest(points[i : i + step], corners) for i in range(0, len(points), step)]
    return np.concatenate(chunks)


def _nearest_of_many(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return what `_nearest` does, looking only at triangles whose spheres reach nearer than a known corner.

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
        if counts.sum() > _MANY_SHARE * len(points) * len(
            of_size
        ):  # needles, say: looking at all of them is faster
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
    """Return distances (N, 3) x (F, 3, 3) -> (N,): to the face's inside or one of its three edges."""
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
    """Return squared distances of points (N, 3) to segments (F, 3), (F, 3). -> (N, F)."""
    direction = end - start
    length2 = np.maximum(np.einsum("fi,fi->f", direction, direction), 1e-30)
    t = (points @ direction.T - np.einsum("fi,fi->f", start, direction)) / length2
    t = np.clip(t, 0.0, 1.0)[..., None]
    offset = points[:, None] - start - t * direction
    return np.einsum("nfi,nfi->nf", offset, offset)


def join_hulls(parts: Sequence[Sequence[np.ndarray]], groups: Sequence[int], most: int) -> list[list[np.ndarray]]:
    """Join hulls until there are `most`, or none are left that may be joined.

    Args:
        parts: hulls of each part, (V, 3) corners each.
        groups: of each part; only hulls of one group, and none of group -1, are joined.
        most: hulls of all parts together.

    Returns:
        The hulls of each part; a joined one belongs to the part of its first.
    """
    pool = _Pool([(k, hull) for k, part in enumerate(parts) for hull in part], groups)
    reach_m = _NEAR_M
    while len(pool.hulls) > most and pool.find_costs(reach_m):
        pool.join(most, reach_m)
        reach_m *= _STEP
    found: list[list[np.ndarray]] = [[] for _ in parts]
    for part, hull in pool.hulls.values():
        found[part].append(hull)
    return found


class _Pool:
    """Hulls by number, each with its part, and what it costs to join two of them."""

    def __init__(self, hulls: Sequence[tuple[int, np.ndarray]], groups: Sequence[int]) -> None:
        self.hulls = dict(enumerate(hulls))
        self._groups = groups
        self._bounds = {k: np.stack((hull.min(axis=0), hull.max(axis=0))) for k, (_, hull) in self.hulls.items()}
        self._volumes: dict[int, float] = {}
        self._costs: dict[tuple[int, int], float] = {}

    def find_costs(self, reach_m: float) -> bool:
        """Find the cost of all pairs so near; return whether there is any pair at all that may be joined."""
        possible = False
        numbers = sorted(self.hulls)
        for at, i in enumerate(numbers):
            others = [j for j in numbers[at + 1 :] if self._may_join(i, j)]
            possible |= bool(others)
            self._add_costs(i, others, reach_m)
        return possible

    def join(self, most: int, reach_m: float) -> None:
        """Join the cheapest pairs until there are `most` hulls, or no pair with a known cost is left."""
        while len(self.hulls) > most and self._costs:
            first, second = min(self._costs, key=lambda pair: (self._costs[pair], pair))
            joined = convex_hull(np.concatenate((self.hulls[first][1], self.hulls[second][1])))
            part, number = self.hulls[first][0], max(self.hulls) + 1
            self._costs = {pair: cost for pair, cost in self._costs.items() if not {first, second} & set(pair)}
            del self.hulls[first], self.hulls[second]
            self.hulls[number], self._volumes[number] = (part, joined.mesh.vertices), joined.volume_m3
            self._bounds[number] = joined.mesh.bounds
            self._add_costs(number, [k for k in self.hulls if k != number and self._may_join(k, number)], reach_m)

    def _may_join(self, i: int, j: int) -> bool:
        group = self._groups[self.hulls[i][0]]
        return group != -1 and group == self._groups[self.hulls[j][0]]

    def _add_costs(self, i: int, others: Sequence[int], reach_m: float) -> None:
        if not others:
            return
        low, high = np.moveaxis(np.stack([self._bounds[j] for j in others]), 1, 0)
        gaps = np.maximum(low - self._bounds[i][1], self._bounds[i][0] - high).max(axis=1)
        for j in (other for other, gap in zip(others, gaps, strict=True) if gap <= reach_m):
            pair = (min(i, j), max(i, j))
            if pair in self._costs:
                continue
            joined = convex_hull(np.concatenate((self.hulls[pair[0]][1], self.hulls[pair[1]][1])))
            # a length, so that small parts are no cheaper than large ones: the added volume, spread out
            added = joined.volume_m3 - self._volume(i) - self._volume(j)
            self._costs[pair] = added / float(triangle_areas(joined.mesh).sum())

    def _volume(self, number: int) -> float:
        if number not in self._volumes:
            self._volumes[number] = convex_hull(self.hulls[number][1]).volume_m3
        return self._volumes[number]
