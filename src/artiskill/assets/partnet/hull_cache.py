"""Decompositions kept on disk: `<cache>/partnet/<hash>.npz`, one file per part, and one per object and scale.

The name is a hash over the meshes' content and every parameter, so that a changed file, scale or setting is a new
entry and an old one is never wrong. Deleting the folder costs time only.
"""

import hashlib
import logging
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from artiskill.assets.partnet.decompose import DecompositionPart
from artiskill.assets.partnet.hull_workers import decompose_parts, default_workers
from artiskill.assets.partnet.joining import join_hulls
from artiskill.assets.partnet.meshes import limit_vertices
from artiskill.files import atomic_write, check_archive, open_regular

_LOGGER = logging.getLogger("artiskill.assets")
_MOST_BYTES = 100_000_000  # the largest entry has 100 kB
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
    """What `_save` wrote under this name, or None where there is no such file, or another one: that is logged."""
    try:
        with open_regular(path) as file:
            check_archive(file, _MOST_BYTES)
            with np.load(file, allow_pickle=False) as data:
                points, sizes, counts, digest = (data[name] for name in ("points", "sizes", "counts", "digest"))
        if digest.tobytes() != _digest(path, points, sizes, counts) or len(counts) != count:
            raise ValueError("it was changed since it was written")
        hulls = iter(np.split(points, np.cumsum(sizes)[:-1]))
        return [[next(hulls) for _ in range(number)] for number in counts]
    except FileNotFoundError:
        return None
    except Exception as error:  # what numpy and zipfile raise of damaged files cannot be listed
        _LOGGER.warning("%s cannot be used, and is made anew: %s", path, error)
        return None


def _digest(path: Path, *arrays: np.ndarray) -> bytes:
    """SHA-256 of an entry's name and content: a file under another entry's name is noticed, too."""
    digest = hashlib.sha256(path.stem.encode())
    for array in arrays:
        digest.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
    return digest.digest()


def _save(path: Path, parts: list[list[np.ndarray]]) -> None:
    """Write atomically; a cache that cannot be written (full or read-only disk) is no error, only slow."""
    hulls = [hull for part in parts for hull in part]
    points = np.concatenate([np.empty((0, 3)), *hulls])
    sizes = np.array([len(hull) for hull in hulls], dtype=np.int64)
    counts = np.array([len(part) for part in parts], dtype=np.int64)
    digest = np.frombuffer(_digest(path, points, sizes, counts), dtype=np.uint8)
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as temporary:
            np.savez(temporary, points=points, sizes=sizes, counts=counts, digest=digest)
