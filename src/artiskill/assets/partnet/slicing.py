"""Meshes cut by planes, and long, bent or hollow surfaces as a row of convex slices: quick, no search.

Cheaper and closer than a general decomposition wherever a part is a bar, a shell or a cushion: across its own axis
every slice of such a part is nearly convex.
"""

import itertools
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from artiskill.assets.partnet.meshes import distance_to_surface, limit_vertices, principal_axes, thick_hull
from artiskill.geometry.arrays import total
from artiskill.geometry.meshes import TriMesh, convex_hull, depth_inside, merge, sample_surface

_PROBES = 200
_NEAR_SHARE = 0.95  # of the slices' surface that must lie near the drawn one
_PIECE_PROBES = 100
_CUTS = (0.25, 0.375, 0.5, 0.625, 0.75)  # of a piece's extent along an axis
_ON_CUT_M = 1e-4
_MERGE_DISTANCE_M = 1e-7
_ON_SURFACE_M = 1e-6
# Neighbours reach into one another by so much, and at most this share of a slice: no seam between them catches.
_OVERLAP_M, _OVERLAP_SHARE = 0.003, 0.1


def cut(mesh: TriMesh, normal: np.ndarray, offset: float) -> TriMesh | None:
    """The part of a mesh on the side `normal . x >= offset`, without a lid; None where nothing is left.

    Args:
        mesh: any triangles; texture coordinates are lost.
        normal: (3,), any length.
        offset: along it.
    """
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
    """The part of a mesh with `low <= axis . x <= high`."""
    upper = cut(mesh, axis, low)
    return None if upper is None else cut(upper, -axis, -high)


def slice_hulls(
    mesh: TriMesh, most: int, tolerance_m: float, thickness_m: float, max_vertices: int
) -> tuple[list[np.ndarray], float]:
    """The fewest convex slices across one of the mesh's principal axes that follow its surface.

    Args:
        mesh: the surface.
        most: slices at most.
        tolerance_m: nearness at which fewer slices are good enough.
        thickness_m: least extent of a slice; sheets are padded to it.
        max_vertices: corners of a slice at most.

    Returns:
        The slices' corner points, and the distance (metres) within which 95 % of their surface lies from the drawn
        one: at most `tolerance_m`, or the best there is.
    """
    axes = principal_axes(mesh.vertices)
    best: tuple[list[np.ndarray], float] | None = None
    for count in range(1, most + 1):
        for axis in axes[: 1 if count == 1 else 3]:
            hulls = _sliced(mesh, axis, count, thickness_m)
            error = hull_distance(hulls, mesh)
            if best is None or error < 0.8 * best[1]:  # more slices must be worth their cost
                best = (hulls, error)
        assert best is not None
        if best[1] <= tolerance_m:
            break
    assert best is not None
    return [limit_vertices(hull, max_vertices) for hull in best[0]], best[1]


def bisect_hulls(
    mesh: TriMesh, most: int, tolerance_m: float, thickness_m: float, max_vertices: int
) -> tuple[list[np.ndarray], float]:
    """Convex pieces of a surface, cut in two again and again where its hull lies furthest off.

    Each cut is the one of some across the piece's own axes that leaves the least volume. What bends, forks or is
    hollow in several directions needs fewer of these than slices across one axis.

    Arguments and result as in `slice_hulls`.
    """
    pieces = [_Piece(mesh, thickness_m, mesh)]
    finished: list[_Piece] = []
    while pieces and len(pieces) + len(finished) < most:
        worst = max(range(len(pieces)), key=lambda k: (pieces[k].off_m, -k))
        if pieces[worst].off_m <= tolerance_m:
            break
        piece = pieces.pop(worst)
        halves = _best_cut(piece, thickness_m, mesh)
        if halves is None:
            finished.append(piece)
        else:
            pieces += halves
    hulls = [limit_vertices(piece.corners, max_vertices) for piece in finished + pieces]
    return hulls, hull_distance(hulls, mesh)


class _Piece:
    """A part of a surface between cuts.

    Attributes:
        mesh: its triangles.
        corners: (V, 3) of its hull.
        volume_m3: of the hull.
        off_m: within which most of the hull's surface lies from the whole surface; its cuts do not count.
    """

    def __init__(
        self, mesh: TriMesh, thickness_m: float, whole: TriMesh, planes: Sequence[tuple[np.ndarray, float]] = ()
    ) -> None:
        self.mesh, self.planes = mesh, tuple(planes)
        self._whole = whole
        self.corners = _thick_corners(mesh.vertices, thickness_m)
        hull = convex_hull(self.corners)
        self.volume_m3, self._surface = hull.volume_m3, hull.mesh

    @cached_property
    def off_m(self) -> float:
        points = sample_surface([self._surface], _PIECE_PROBES, np.random.default_rng(0))
        for normal, offset in self.planes:
            points = points[np.abs(points @ normal - offset) > _ON_CUT_M]
        if not len(points):
            return 0.0
        return float(np.quantile(distance_to_surface(points, self._whole), _NEAR_SHARE))


def _best_cut(piece: _Piece, thickness_m: float, whole: TriMesh) -> list[_Piece] | None:
    """A piece's two halves, of least volume; None where no cut leaves two."""
    best: list[_Piece] | None = None
    for axis in principal_axes(piece.mesh.vertices):
        along = piece.mesh.vertices @ axis
        low, high = float(along.min()), float(along.max())
        for share in _CUTS:
            at = low + share * (high - low)
            upper, lower = cut(piece.mesh, axis, at), cut(piece.mesh, -axis, -at)
            if upper is None or lower is None:
                continue
            planes = (*piece.planes, (axis, at))
            halves = [_Piece(half, thickness_m, whole, planes) for half in (lower, upper)]
            if best is None or _volume(halves) < (1 - 1e-6) * _volume(best):
                best = halves
    return best


def _volume(pieces: Sequence[_Piece]) -> float:
    return total(piece.volume_m3 for piece in pieces)


def _sliced(mesh: TriMesh, axis: np.ndarray, count: int, thickness_m: float) -> list[np.ndarray]:
    along = mesh.vertices @ axis
    edges = np.linspace(along.min(), along.max(), count + 1)
    more = min(_OVERLAP_M, _OVERLAP_SHARE * float(edges[1] - edges[0]))
    hulls = []
    for low, high in itertools.pairwise(edges):
        piece = mesh if count == 1 else slab(mesh, axis, low - more, high + more)
        if piece is not None:
            hulls.append(_thick_corners(piece.vertices, thickness_m))
    return hulls


def hull_corners(points: np.ndarray, thickness_m: float, max_vertices: int) -> np.ndarray:
    """Corners (V, 3) of the points' hull, made thick enough for an engine and few enough to be quick."""
    return limit_vertices(_thick_corners(points, thickness_m), max_vertices)


def _thick_corners(points: np.ndarray, thickness_m: float) -> np.ndarray:
    _, keep = np.unique(np.round(points / _MERGE_DISTANCE_M).astype(np.int64), axis=0, return_index=True)
    return thick_hull(points[np.sort(keep)], thickness_m)[0].mesh.vertices


def hull_distance(hulls: list[np.ndarray], mesh: TriMesh) -> float:
    """How near (metres) 95 % of the hulls' outer surface lies to the mesh; the cuts between them do not count."""
    solids = [convex_hull(hull) for hull in hulls]
    points = sample_surface([merge(s.mesh for s in solids)], _PROBES, np.random.default_rng(0))
    inside = np.zeros(len(points), dtype=int)
    for solid in solids:
        inside += depth_inside(solid.planes, points) >= -_ON_SURFACE_M
    outer = points[inside <= 1]
    if not len(outer):
        return np.inf
    return float(np.quantile(distance_to_surface(outer, mesh), _NEAR_SHARE))
