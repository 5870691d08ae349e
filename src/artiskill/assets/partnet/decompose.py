"""From drawn surfaces to few small convex hulls for contact, by coacd where a hull alone is not good enough.

The order, cheapest first: the hull of the whole part, if its surface stays near the drawn one; the hulls of its
connected pieces, or slices of them; coacd (Wei et al., SIGGRAPH 2022) on the pieces that remain. `hull_cache`
keeps the results.
"""

from dataclasses import dataclass

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
from artiskill.assets.partnet.slicing import slice_hulls
from artiskill.assets.partnet.vessel import vessel_hulls
from artiskill.errors import MissingExtraError
from artiskill.geometry.hulls import convex_hull, depth_inside
from artiskill.geometry.meshes import TriMesh, merge, sample_surface

_PROBES = 400  # samples of a hull's surface in the test of a hull alone
_MOST_PIECES = 48  # connected pieces of a mesh that are looked at one by one
_MOST_SLICED_PIECES = 6  # likewise where slices do: more of them are a soup of faces
_MOST_SLABS = 6  # flat faces of a bent sheet that become a slab each


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
        slices: into how many slices across its own axis a piece may be cut before coacd is asked (`slicing`).
        slack_m: the best slices will do, and coacd is not asked, where they lie so near.
        vessel: the part is an open vessel, cut into sectors about its axis (`vessel`).
    """

    tolerance_m: float = 0.004
    thickness_m: float = 0.003
    max_hulls: int = 8
    max_vertices: int = 32
    resolution: int = 30
    seed: int = 0
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


def decompose(part: DecompositionPart) -> list[np.ndarray]:
    """Convex hulls, each (V, 3) corner points, that together cover a part's drawn surface.

    Of a vessel, those of its wall and last that of its floor; none where it is no open vessel.

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
    whole = _hull_alone(weld(drawn), config)
    if whole is not None:
        return [whole]
    hulls: list[np.ndarray] = []
    for mesh in part.meshes:
        welded = weld(mesh)
        if not len(welded.faces):
            continue
        alone = _hull_alone(welded, config)
        pieces = [] if alone is not None else components(welded)
        if len(pieces) > (_MOST_SLICED_PIECES if config.slices else _MOST_PIECES):
            pieces = [welded]
        hulls += [alone] if alone is not None else [hull for piece in pieces for hull in _cut(piece, config)]
    hulls = _drop_contained(hulls)
    (hulls,) = join_hulls([hulls], [0], config.max_hulls)
    return [limit_vertices(hull, config.max_vertices) for hull in hulls]


def _cut(piece: TriMesh, config: DecompositionConfig) -> list[np.ndarray]:
    """A connected piece as its hull, as slabs on its flat faces (bent sheets), or as coacd cuts it."""
    alone = _hull_alone(piece, config)
    if alone is not None:
        return [alone]
    patches = flat_patches(piece)
    if len(patches) <= _MOST_SLABS:
        slabs = [slab for patch in patches if (slab := _hull_alone(patch, config)) is not None]
        if len(slabs) == len(patches):
            return slabs
    if config.slices:
        hulls, error_m = slice_hulls(
            piece, config.slices, config.tolerance_m, config.thickness_m, config.max_vertices
        )
        if error_m <= max(config.tolerance_m, config.slack_m):
            return hulls
    return _run_coacd(piece, config)


def _hull_alone(mesh: TriMesh, config: DecompositionConfig) -> np.ndarray | None:
    """The part's own hull if it is good enough, at most `max_vertices` corners; else None."""
    hull, _ = thick_hull(mesh.vertices, config.thickness_m)
    corners = limit_vertices(hull.mesh.vertices, config.max_vertices)
    probes = sample_surface([convex_hull(corners).mesh], _PROBES, np.random.default_rng(config.seed))
    near = distance_to_surface(probes, mesh) <= config.tolerance_m
    return corners if near.mean() >= 0.98 else None


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
        resolution=1000,  # samples in the concavity measure; half the default, as are the search's iterations
        mcts_iterations=60,
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
