"""From drawn surfaces to few small convex hulls for contact, by coacd where a hull alone is not good enough.

The order, cheapest first: the hull of the whole part, if its surface stays near the drawn one; the hulls of its
connected pieces; slices across a piece's own axis, for bars, shells and cushions are nearly convex in each of
them; halves of halves, cut where the hull lies furthest off; coacd (Wei et al., SIGGRAPH 2022) where these lie far
off: it takes seconds for a piece, minutes for some that are not watertight. What has many thousands of faces is
replaced by a simplified mesh, which lies within a quarter of the tolerance. `hull_cache` keeps the results.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from artiskill.assets.partnet.meshes import (
    components,
    cut,
    distance_to_surface,
    flat_patches,
    join_hulls,
    limit_vertices,
    principal_axes,
    slab,
    thick_corners,
    thick_hull,
    weld,
)
from artiskill.assets.partnet.round_parts import vessel_hulls
from artiskill.assets.partnet.simplify import lighten
from artiskill.errors import MissingExtraError
from artiskill.geometry.arrays import total
from artiskill.geometry.meshes import TriMesh, convex_hull, depth_inside, merge, sample_surface

_HULL_PROBES, _PROBES_AT_ONCE = 400, 100  # samples of a hull's surface in the test of a hull alone
_HULL_NEAR_SHARE = 0.98  # of them that must lie near the drawn surface
_GOOD_ENOUGH = 2.0  # tolerances: halves of halves that lie so near are as good as what coacd finds
_QUICK_FACES = 200  # of a part: to find out whether its pieces are convex takes milliseconds
_MOST_SLABS = 6  # flat faces of a bent sheet that become a slab each
_LIGHT_SHARE = 0.25  # of the tolerance, by which a simplified mesh may lie off the drawn one
_PROBES, _PIECE_PROBES = 200, 100  # samples of the surface of slices, and of a piece between cuts
_NEAR_SHARE = 0.95  # of their surface that must lie near the drawn one
_CUTS = (0.25, 0.375, 0.5, 0.625, 0.75)  # of a piece's extent along an axis
_ON_CUT_M, _ON_SURFACE_M = 1e-4, 1e-6
# Neighbours reach into one another by so much, and at most this share of a slice: no seam between them catches.
_OVERLAP_M, _OVERLAP_SHARE = 0.003, 0.1


@dataclass(frozen=True)
class DecompositionConfig:
    """How closely and how finely."""

    # a hull alone is good enough if 98 % of its surface lies this near the drawn surface
    tolerance_m: float = 0.004
    thickness_m: float = 0.003  # sheets are made this thick; MuJoCo's hulls need a volume
    max_hulls: int = 8  # per part
    max_vertices: int = 32  # per hull; the cost of a contact grows with it
    resolution: int = 30  # voxels per side with which coacd closes open meshes
    seed: int = 0  # of coacd's search
    pieces: int = 48  # connected pieces of a mesh that are looked at one by one; more of them are a triangle soup
    # into how many slices across its own axis a piece may be cut, before it is cut in halves of halves
    slices: int = 0
    slack_m: float = 0.0  # the best slices or halves will do, and coacd is not asked, where they lie so near
    vessel: bool = False  # the part is an open vessel, cut into sectors about its axis (`round_parts`)


@dataclass(frozen=True, eq=False)
class DecompositionPart:
    """What is decomposed together: a part's drawn meshes, one per file, and how closely to follow them.

    `group`: hulls of parts with the same one may be joined where there are too many; -1 keeps a part's hulls.
    """

    meshes: tuple[TriMesh, ...]
    config: DecompositionConfig
    group: int = -1


class _SearchNeededError(Exception):
    """A piece is neither convex nor a bent sheet."""


def decompose_quickly(part: DecompositionPart) -> list[np.ndarray] | None:
    """Decompose a part of few faces and convex pieces; return None for all others, which take time."""
    if part.config.vessel or sum(len(mesh.faces) for mesh in part.meshes) > _QUICK_FACES:
        return None
    try:
        return decompose(part, search=False)
    except _SearchNeededError:
        return None


def decompose(part: DecompositionPart, search: bool = True) -> list[np.ndarray]:
    """Return convex hulls, each (V, 3) corner points, that together cover a part's drawn surface.

    Of a vessel, those of its wall and last that of its floor; none where it is no open vessel.

    Args:
        part: to decompose.
        search: whether pieces may be cut, which takes time; where not, one that would have to be is an error.

    Raises:
        MissingExtraError: coacd is needed and not installed.
    """
    config = part.config
    drawn = merge(part.meshes)
    if config.vessel:
        vessel = vessel_hulls(drawn, config.max_vertices)
        return [] if vessel is None else [*vessel.wall, *vessel.floor]
    if not len(weld(drawn).faces):  # a speck smaller than the welding distance
        return [thick_hull(drawn.vertices, config.thickness_m)[0].mesh.vertices]
    off_m = _LIGHT_SHARE * config.tolerance_m
    whole = _hull_alone(lighten(weld(drawn), off_m), config)
    if whole is not None:
        return [whole]
    hulls: list[np.ndarray] = []
    for mesh in part.meshes:
        welded = weld(mesh)
        if not len(welded.faces):
            continue
        welded = lighten(welded, off_m)
        alone = _hull_alone(welded, config)
        hulls += [alone] if alone is not None else _cut_pieces(components(welded, config.pieces), config, search)
    hulls = _drop_contained(hulls)
    (hulls,) = join_hulls([hulls], [0], config.max_hulls)
    return [limit_vertices(hull, config.max_vertices) for hull in hulls]


def _cut_pieces(pieces: list[TriMesh], config: DecompositionConfig, search: bool) -> list[np.ndarray]:
    """Cut each connected piece of a mesh into no more hulls than it takes up of twice those of the part."""
    sizes = [float(np.linalg.norm(np.ptp(piece.bounds, axis=0))) for piece in pieces]
    hulls = []
    for piece, size in zip(pieces, sizes, strict=True):
        most = min(config.max_hulls, math.ceil(2 * config.max_hulls * size / total(sizes)))
        hulls += _cut(piece, replace(config, max_hulls=most), search)
    return hulls


def _cut(piece: TriMesh, config: DecompositionConfig, search: bool) -> list[np.ndarray]:
    """Cut a piece in the first way that is good enough: its hull, slabs, slices, halves of halves, coacd."""
    alone = _hull_alone(piece, config)
    if alone is not None:
        return [alone]
    if config.max_hulls == 1:
        return [limit_vertices(thick_corners(piece.vertices, config.thickness_m), config.max_vertices)]
    patches = flat_patches(piece, most=_MOST_SLABS)
    if len(patches) <= _MOST_SLABS:
        slabs = [slab for patch in patches if (slab := _hull_alone(patch, config)) is not None]
        if len(slabs) == len(patches):
            return slabs
    if not search:
        raise _SearchNeededError
    if config.slices:
        hulls, error_m = slice_hulls(piece, config)
        if error_m <= max(config.tolerance_m, config.slack_m):
            return hulls
    hulls, error_m = bisect_hulls(piece, config)
    if error_m <= max(_GOOD_ENOUGH * config.tolerance_m, config.slack_m):
        return hulls
    found = _run_coacd(piece, config)
    return found if hull_distance(found, piece) < error_m else hulls


def _hull_alone(mesh: TriMesh, config: DecompositionConfig) -> np.ndarray | None:
    """Return the part's own hull if it is good enough, at most `max_vertices` corners; else None."""
    hull, _ = thick_hull(mesh.vertices, config.thickness_m)
    corners = limit_vertices(hull.mesh.vertices, config.max_vertices)
    probes = sample_surface([convex_hull(corners).mesh], _HULL_PROBES, np.random.default_rng(config.seed))
    far, most = 0, int((1 - _HULL_NEAR_SHARE) * _HULL_PROBES)
    for some in np.split(
        probes, _HULL_PROBES // _PROBES_AT_ONCE
    ):  # most hulls are far off, and a few probes show it
        far += int(np.sum(distance_to_surface(some, mesh) > config.tolerance_m))
        if far > most:
            return None
    return corners


def slice_hulls(mesh: TriMesh, config: DecompositionConfig) -> tuple[list[np.ndarray], float]:
    """Return the fewest convex slices across one of the mesh's principal axes that follow its surface.

    Returns:
        The slices' corner points, and the distance (metres) within which 95 % of their surface lies from the drawn
        one: at most the tolerance, or the best there is.
    """
    axes = principal_axes(mesh.vertices)
    best: tuple[list[np.ndarray], float] | None = None
    for count in range(1, min(config.slices, config.max_hulls) + 1):
        for axis in axes[: 1 if count == 1 else 3]:
            hulls = _sliced(mesh, axis, count, config.thickness_m)
            error = hull_distance(hulls, mesh)
            if best is None or error < 0.8 * best[1]:  # more slices must be worth their cost
                best = (hulls, error)
        assert best is not None
        if best[1] <= config.tolerance_m:
            break
    assert best is not None
    return [limit_vertices(hull, config.max_vertices) for hull in best[0]], best[1]


def _sliced(mesh: TriMesh, axis: np.ndarray, count: int, thickness_m: float) -> list[np.ndarray]:
    along = mesh.vertices @ axis
    edges = np.linspace(along.min(), along.max(), count + 1)
    more = min(_OVERLAP_M, _OVERLAP_SHARE * float(edges[1] - edges[0]))
    hulls = []
    for low, high in itertools.pairwise(edges):
        piece = mesh if count == 1 else slab(mesh, axis, low - more, high + more)
        if piece is not None:
            hulls.append(thick_corners(piece.vertices, thickness_m))
    return hulls


def bisect_hulls(mesh: TriMesh, config: DecompositionConfig) -> tuple[list[np.ndarray], float]:
    """Return convex pieces of a surface, cut in two again and again where its hull lies furthest off.

    Each cut is the one of some across the piece's own axes that leaves the least volume. What bends, forks or is
    hollow in several directions needs fewer of these than slices across one axis. It returns as `slice_hulls`.
    """
    pieces = [_Piece(mesh, config.thickness_m, mesh)]
    finished: list[_Piece] = []
    while pieces and len(pieces) + len(finished) < config.max_hulls:
        worst = max(range(len(pieces)), key=lambda k: (pieces[k].off_m, -k))
        if pieces[worst].off_m <= config.tolerance_m:
            break
        piece = pieces.pop(worst)
        halves = _best_cut(piece, config.thickness_m, mesh)
        if halves is None:
            finished.append(piece)
        else:
            pieces += halves
    hulls = [limit_vertices(piece.corners, config.max_vertices) for piece in finished + pieces]
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
        self.corners = thick_corners(mesh.vertices, thickness_m)
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
    """Return a piece's two halves, of least volume; None where no cut leaves two."""
    best: list[_Piece] | None = None
    least_m3 = np.inf
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
            volume_m3 = total(half.volume_m3 for half in halves)
            if best is None or volume_m3 < (1 - 1e-6) * least_m3:
                best, least_m3 = halves, volume_m3
    return best


def hull_distance(hulls: list[np.ndarray], mesh: TriMesh) -> float:
    """Return within which distance (metres) 95 % of the hulls' outer surface lies from the mesh, cuts left out."""
    solids = [convex_hull(hull) for hull in hulls]
    points = sample_surface([merge(s.mesh for s in solids)], _PROBES, np.random.default_rng(0))
    inside = np.zeros(len(points), dtype=int)
    for solid in solids:
        inside += depth_inside(solid.planes, points) >= -_ON_SURFACE_M
    outer = points[inside <= 1]
    if not len(outer):
        return np.inf
    return float(np.quantile(distance_to_surface(outer, mesh), _NEAR_SHARE))


def _run_coacd(mesh: TriMesh, config: DecompositionConfig) -> list[np.ndarray]:
    coacd = import_coacd()
    coacd.set_log_level("error")
    half_size = float(np.ptp(mesh.bounds, axis=0).max()) / 2
    # coacd measures concavity on the model scaled to [-1, 1]; below its default of 0.05 it takes minutes per
    # part for little gain, because the number of hulls is bounded anyway
    threshold = float(np.clip(config.tolerance_m / half_size, 0.05, 0.2))
    pieces = coacd.run_coacd(
        coacd.Mesh(mesh.vertices, mesh.faces),
        threshold=threshold,
        max_convex_hull=config.max_hulls,
        preprocess_resolution=config.resolution,
        resolution=1000,  # samples in the concavity measure, half the default
        mcts_iterations=20,  # 60 take three times as long and lie no nearer
        decimate=True,
        max_ch_vertex=config.max_vertices,
        seed=config.seed,
    )
    return [thick_hull(np.asarray(v, dtype=float), config.thickness_m)[0].mesh.vertices for v, _ in pieces]


def import_coacd():  # type: ignore[no-untyped-def]
    """Return the module coacd.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import coacd
    except ImportError as error:
        raise MissingExtraError("the PartNet-Mobility importer", "import") from error
    return coacd


def _drop_contained(hulls: list[np.ndarray]) -> list[np.ndarray]:
    """Drop hulls that lie wholly (to 0.1 mm) inside another; of two equal ones the first stays."""
    planes = [convex_hull(hull).planes for hull in hulls]
    kept: list[int] = []
    for i in sorted(range(len(hulls)), key=lambda i: -convex_hull(hulls[i]).volume_m3):
        if not any(np.all(depth_inside(planes[k], hulls[i]) >= -1e-4) for k in kept):
            kept.append(i)
    return [hulls[i] for i in sorted(kept)]
