"""Decompositions kept on disk: `<cache>/partnet/<hash>.npz`, one file per part, and one per object and scale.

The name is a hash over the meshes' content and every parameter, so that a changed file, scale or setting is a new
entry and an old one is never wrong. Deleting the folder costs time only.
"""

import hashlib
import os
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from artiskill.assets.partnet.decompose import DecompositionPart
from artiskill.assets.partnet.hull_workers import decompose_parts, default_workers
from artiskill.assets.partnet.joining import join_hulls
from artiskill.assets.partnet.meshes import limit_vertices

_VERSION = 6  # of the algorithm: a new number makes old cache files void

OnProgress = Callable[[int, int], None]


def default_cache_dir() -> Path:
    """`$XDG_CACHE_HOME/artiskill`, or `~/.cache/artiskill`."""
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "artiskill"


def decompose_cached(
    parts: Sequence[DecompositionPart],
    cache_dir: Path,
    most: int | None = None,
    workers: int | None = None,
    on_progress: OnProgress | None = None,
) -> list[list[np.ndarray]]:
    """`decompose` of several parts, through files in `cache_dir / "partnet"`.

    Every part is kept as soon as it is done, so that an import that was ended goes on from there, and the whole
    object at the end. A file that cannot be read is computed anew and replaced; files appear whole or not at all.
    The result does not depend on the number of workers.

    Args:
        parts: of one object.
        cache_dir: any folder.
        most: hulls of all parts together; beyond, hulls of one group are joined.
        workers: processes; one per core where None.
        on_progress: called with the parts done and those in all, a few times a second.

    Raises:
        AssetError: a worker ended by itself.
        MissingExtraError: coacd is needed and not installed.
    """
    folder = cache_dir / "partnet"
    keys = [_part_key(part) for part in parts]
    whole = hashlib.sha256(f"artiskill-object-{_VERSION}-{most}".encode())
    for part, key in zip(parts, keys, strict=True):
        whole.update(f"{key}{part.group}".encode())
    path = folder / f"{whole.hexdigest()[:32]}.npz"
    hulls = _load(path, len(parts))
    if hulls is None:
        workers = default_workers() if workers is None else workers
        hulls = _decompose(parts, [folder / f"{key}.npz" for key in keys], workers, on_progress or _ignore)
        hulls = _join(parts, hulls, most)
        _save(path, hulls)
    return hulls


def _decompose(
    parts: Sequence[DecompositionPart], paths: Sequence[Path], workers: int, on_progress: OnProgress
) -> list[list[np.ndarray]]:
    """Every part's hulls, those from disk that are there."""
    found = {k: kept[0] for k, path in enumerate(paths) if (kept := _load(path, 1)) is not None}
    missing = [k for k in range(len(parts)) if k not in found]

    def keep(number: int, hulls: list[np.ndarray]) -> None:
        found[missing[number]] = hulls
        _save(paths[missing[number]], [hulls])

    if missing:
        decompose_parts([parts[k] for k in missing], workers, keep, lambda: on_progress(len(found), len(parts)))
    return [found[k] for k in range(len(parts))]


def _join(
    parts: Sequence[DecompositionPart], hulls: list[list[np.ndarray]], most: int | None
) -> list[list[np.ndarray]]:
    """At most so many hulls of all parts together, where their groups allow it."""
    if most is None or sum(map(len, hulls)) <= most:
        return hulls
    joined = join_hulls(hulls, [part.group for part in parts], most)
    return [
        [limit_vertices(hull, part.config.max_vertices) for hull in of]
        for part, of in zip(parts, joined, strict=True)
    ]


def _part_key(part: DecompositionPart) -> str:
    digest = hashlib.sha256(f"artiskill-part-{_VERSION}-{part.config}/{len(part.meshes)}".encode())
    for mesh in part.meshes:
        digest.update(f"{mesh.vertices.shape}{mesh.faces.shape}".encode())
        digest.update(mesh.vertices.tobytes() + mesh.faces.tobytes())
    return digest.hexdigest()[:32]


def _ignore(done: int, total: int) -> None:
    pass


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
                points=np.concatenate([np.empty((0, 3)), *hulls]),
                sizes=np.array([len(hull) for hull in hulls], dtype=np.int64),
                counts=np.array([len(part) for part in parts], dtype=np.int64),
            )
        temporary.replace(path)
    except OSError:
        pass
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
