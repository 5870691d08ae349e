"""From drawn surfaces to few small convex hulls for contact, by coacd where a hull alone is not good enough.

The order, cheapest first: the hull of the whole part, if its surface stays near the drawn one; the hulls of its
connected pieces, or slices or halves of halves of them (`slicing`); coacd (Wei et al., SIGGRAPH 2022) where these
lie far off: it takes seconds for a piece, minutes for some that are not watertight. What has many
thousands of faces is followed by a lighter mesh, which lies within a quarter of the tolerance. `hull_cache` keeps
the results.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from artiskill.assets.partnet.joining import join_hulls
from artiskill.assets.partnet.meshes import (
    components,
    distance_to_surface,
    flat_patches,
    limit_vertices,
    thick_hull,
    weld,
)
from artiskill.assets.partnet.simplify import lighten
from artiskill.assets.partnet.slicing import bisect_hulls, hull_corners, hull_distance, slice_hulls
from artiskill.assets.partnet.vessel import vessel_hulls
from artiskill.errors import MissingExtraError
from artiskill.geometry.arrays import total
from artiskill.geometry.meshes import TriMesh, convex_hull, depth_inside, merge, sample_surface

_PROBES, _PROBES_AT_ONCE = 400, 100  # samples of a hull's surface in the test of a hull alone
_NEAR_SHARE = 0.98  # of them that must lie near the drawn surface
_GOOD_ENOUGH = 2.0  # tolerances: halves of halves that lie so near are as good as what coacd finds
_QUICK_FACES = 200  # of a part: to find out whether its pieces are convex takes milliseconds
_MOST_SLABS = 6  # flat faces of a bent sheet that become a slab each
_LIGHT_SHARE = 0.25  # of the tolerance, by which a lighter mesh may lie off the drawn one


@dataclass(frozen=True)
class DecompositionConfig:
    """How closely and how finely.

    Attributes:
        tolerance_m: a hull alone is good enough if 98 % of its surface lies this near the drawn surface.
        thickness_m: sheets are made this thick; MuJoCo's hulls need a volume.
        max_hulls: per part.
        max_vertices: per hull; the cost of a contact grows with it.
        resolution: voxels per side with which coacd closes open meshes.
        seed: of coacd's search.
        pieces: connected pieces of a mesh that are looked at one by one; more of them are a soup of faces.
        slices: into how many slices across its own axis a piece may be cut, before it is cut in halves of halves.
        slack_m: the best slices or halves will do, and coacd is not asked, where they lie so near.
        vessel: the part is an open vessel, cut into sectors about its axis (`vessel`).
    """

    tolerance_m: float = 0.004
    thickness_m: float = 0.003
    max_hulls: int = 8
    max_vertices: int = 32
    resolution: int = 30
    seed: int = 0
    pieces: int = 48
    slices: int = 0
    slack_m: float = 0.0
    vessel: bool = False


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
    """`decompose` of a part of few faces and convex pieces; None of all others, which take time."""
    if part.config.vessel or sum(len(mesh.faces) for mesh in part.meshes) > _QUICK_FACES:
        return None
    try:
        return decompose(part, search=False)
    except _SearchNeededError:
        return None


def decompose(part: DecompositionPart, search: bool = True) -> list[np.ndarray]:
    """Convex hulls, each (V, 3) corner points, that together cover a part's drawn surface.

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
    """The connected pieces of a mesh, each cut into no more hulls than it takes up of twice those of the part."""
    sizes = [float(np.linalg.norm(np.ptp(piece.bounds, axis=0))) for piece in pieces]
    hulls = []
    for piece, size in zip(pieces, sizes, strict=True):
        most = min(config.max_hulls, math.ceil(2 * config.max_hulls * size / total(sizes)))
        hulls += _cut(piece, replace(config, max_hulls=most), search)
    return hulls


def _cut(piece: TriMesh, config: DecompositionConfig, search: bool) -> list[np.ndarray]:
    """A connected piece in the first way that is good enough: its hull, slabs, slices, halves of halves, coacd."""
    alone = _hull_alone(piece, config)
    if alone is not None:
        return [alone]
    if config.max_hulls == 1:
        return [hull_corners(piece.vertices, config.thickness_m, config.max_vertices)]
    patches = flat_patches(piece, most=_MOST_SLABS)
    if len(patches) <= _MOST_SLABS:
        slabs = [slab for patch in patches if (slab := _hull_alone(patch, config)) is not None]
        if len(slabs) == len(patches):
            return slabs
    if not search:
        raise _SearchNeededError
    if config.slices:
        hulls, error_m = slice_hulls(
            piece,
            min(config.slices, config.max_hulls),
            config.tolerance_m,
            config.thickness_m,
            config.max_vertices,
        )
        if error_m <= max(config.tolerance_m, config.slack_m):
            return hulls
    hulls, error_m = bisect_hulls(
        piece, config.max_hulls, config.tolerance_m, config.thickness_m, config.max_vertices
    )
    if error_m <= max(_GOOD_ENOUGH * config.tolerance_m, config.slack_m):
        return hulls
    found = _run_coacd(piece, config)
    return found if hull_distance(found, piece) < error_m else hulls


def _hull_alone(mesh: TriMesh, config: DecompositionConfig) -> np.ndarray | None:
    """The part's own hull if it is good enough, at most `max_vertices` corners; else None."""
    hull, _ = thick_hull(mesh.vertices, config.thickness_m)
    corners = limit_vertices(hull.mesh.vertices, config.max_vertices)
    probes = sample_surface([convex_hull(corners).mesh], _PROBES, np.random.default_rng(config.seed))
    far, most = 0, int((1 - _NEAR_SHARE) * _PROBES)
    for some in np.split(probes, _PROBES // _PROBES_AT_ONCE):  # most hulls are far off, and a few probes show it
        far += int(np.sum(distance_to_surface(some, mesh) > config.tolerance_m))
        if far > most:
            return None
    return corners


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
    """The module coacd.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import coacd
    except ImportError as error:
        raise MissingExtraError("the PartNet-Mobility importer", "import") from error
    return coacd


def _drop_contained(hulls: list[np.ndarray]) -> list[np.ndarray]:
    """Without those that lie wholly (to 0.1 mm) inside another; of two equal ones the first stays."""
    planes = [convex_hull(hull).planes for hull in hulls]
    kept: list[int] = []
    for i in sorted(range(len(hulls)), key=lambda i: -convex_hull(hulls[i]).volume_m3):
        if not any(np.all(depth_inside(planes[k], hulls[i]) >= -1e-4) for k in kept):
            kept.append(i)
    return [hulls[i] for i in sorted(kept)]
