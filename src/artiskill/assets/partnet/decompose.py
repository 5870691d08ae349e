"""From drawn surfaces to few small convex hulls for contact, by coacd where a hull alone is not good enough.

The order, cheapest first: the hull of the whole part, if its surface stays near the drawn one; the hulls of its
connected pieces; coacd (Wei et al., SIGGRAPH 2022) on the pieces that remain. Results are kept on disk, keyed by
the meshes' content and every parameter.
"""

import hashlib
import os
import tempfile
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from artiskill.assets.partnet.meshes import (
    components,
    distance_to_surface,
    flat_patches,
    limit_vertices,
    thick_hull,
    weld,
)
from artiskill.errors import MissingExtraError
from artiskill.geometry.hulls import convex_hull, depth_inside
from artiskill.geometry.meshes import TriMesh, merge, sample_surface

_VERSION = 2  # of the algorithm: a new number makes old cache files void
_PROBES = 400  # samples of a hull's surface in the test of a hull alone
_MOST_PIECES = 48  # connected pieces of a mesh that are looked at one by one
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
    """

    tolerance_m: float = 0.004
    thickness_m: float = 0.003
    max_hulls: int = 8
    max_vertices: int = 32
    resolution: int = 30
    seed: int = 0


# 5 mm where the body is concerned is less than a finger's thickness; a handle decides whether a grip holds.
BODY = DecompositionConfig()
HANDLE = DecompositionConfig(tolerance_m=0.0015, thickness_m=0.002, max_hulls=10, resolution=50)


def default_cache_dir() -> Path:
    """`$XDG_CACHE_HOME/artiskill`, or `~/.cache/artiskill`."""
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "artiskill"


@dataclass(frozen=True, eq=False)
class DecompositionPart:
    """What is decomposed together: a part's drawn meshes, one per file, and how closely to follow them."""

    meshes: tuple[TriMesh, ...]
    config: DecompositionConfig


def decompose(part: DecompositionPart) -> list[np.ndarray]:
    """Convex hulls, each (V, 3) corner points, that together cover a part's drawn surface.

    Raises:
        MissingExtraError: coacd is needed and not installed.
    """
    config = part.config
    drawn = merge(part.meshes)
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
        if len(pieces) > _MOST_PIECES:
            pieces = [welded]
        hulls += [alone] if alone is not None else [hull for piece in pieces for hull in _cut(piece, config)]
    hulls = _drop_contained(hulls)
    while len(hulls) > config.max_hulls:
        hulls = _merge_cheapest(hulls)
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
    return _run_coacd(piece, config)


def decompose_cached(parts: Sequence[DecompositionPart], cache_dir: Path) -> list[list[np.ndarray]]:
    """`decompose` of several parts, through a file in `cache_dir / "partnet"`.

    A file that cannot be read is computed anew and replaced; files appear whole or not at all.
    """
    digest = hashlib.sha256(f"artiskill-decomposition-{_VERSION}".encode())
    for part in parts:
        digest.update(f"{part.config}{len(part.meshes)}".encode())
        for mesh in part.meshes:
            digest.update(f"{mesh.vertices.shape}{mesh.faces.shape}".encode())
            digest.update(mesh.vertices.tobytes() + mesh.faces.tobytes())
    path = cache_dir / "partnet" / f"{digest.hexdigest()[:32]}.npz"
    hulls = _load(path, len(parts))
    if hulls is None:
        hulls = [decompose(part) for part in parts]
        _save(path, hulls)
    return hulls


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


def _merge_cheapest(hulls: list[np.ndarray]) -> list[np.ndarray]:
    """Join the two hulls whose common hull adds the least volume."""
    volumes = [convex_hull(hull).volume_m3 for hull in hulls]
    pairs = [(i, j) for i in range(len(hulls)) for j in range(i)]
    added = [
        convex_hull(np.concatenate((hulls[i], hulls[j]))).volume_m3 - volumes[i] - volumes[j] for i, j in pairs
    ]
    i, j = pairs[int(np.argmin(added))]
    joined = convex_hull(np.concatenate((hulls[i], hulls[j]))).mesh.vertices
    return [hull for k, hull in enumerate(hulls) if k not in (i, j)] + [joined]


def _load(path: Path, count: int) -> list[list[np.ndarray]] | None:
    """What `_save` wrote, or None where there is no such file or it is damaged."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            points, sizes, counts = data["points"], data["sizes"], data["counts"]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    if len(counts) != count or counts.sum() != len(sizes) or points.shape != (sizes.sum(), 3):
        return None
    hulls = iter(np.split(points, np.cumsum(sizes)[:-1]))
    return [[next(hulls) for _ in range(number)] for number in counts]


def _save(path: Path, parts: list[list[np.ndarray]]) -> None:
    """Write atomically; a cache that cannot be written (full or read-only disk) is no error, only slow."""
    hulls = [hull for part in parts for hull in part]
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".tmp", delete=False) as file:
            temporary = Path(file.name)
            np.savez(
                file,
                points=np.concatenate(hulls),
                sizes=np.array([len(hull) for hull in hulls]),
                counts=np.array([len(part) for part in parts]),
            )
        temporary.replace(path)
    except OSError:
        pass
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
