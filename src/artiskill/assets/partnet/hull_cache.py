"""Decompositions of whole objects, kept on disk: `<cache>/partnet/<hash>.npz`, one file per object and scale.

The name is a hash over the meshes' content and every parameter, so that a changed file, scale or setting is a new
entry and an old one is never wrong. Deleting the folder costs time only.
"""

import hashlib
import os
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from artiskill.assets.partnet import decompose as algorithm
from artiskill.assets.partnet.decompose import DecompositionPart
from artiskill.assets.partnet.joining import join_hulls
from artiskill.assets.partnet.meshes import limit_vertices

_VERSION = 5  # of the algorithm: a new number makes old cache files void


def default_cache_dir() -> Path:
    """`$XDG_CACHE_HOME/artiskill`, or `~/.cache/artiskill`."""
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "artiskill"


def decompose_cached(
    parts: Sequence[DecompositionPart], cache_dir: Path, most: int | None = None
) -> list[list[np.ndarray]]:
    """`decompose` of several parts, through a file in `cache_dir / "partnet"`.

    A file that cannot be read is computed anew and replaced; files appear whole or not at all.

    Args:
        parts: of one object.
        cache_dir: any folder.
        most: hulls of all parts together; beyond, hulls of one group are joined.

    Raises:
        MissingExtraError: coacd is needed and not installed.
    """
    digest = hashlib.sha256(f"artiskill-decomposition-{_VERSION}-{most}".encode())
    for part in parts:
        digest.update(f"{part.config}{part.group}/{len(part.meshes)}".encode())
        for mesh in part.meshes:
            digest.update(f"{mesh.vertices.shape}{mesh.faces.shape}".encode())
            digest.update(mesh.vertices.tobytes() + mesh.faces.tobytes())
    path = cache_dir / "partnet" / f"{digest.hexdigest()[:32]}.npz"
    hulls = _load(path, len(parts))
    if hulls is None:
        hulls = [algorithm.decompose(part) for part in parts]
        if most is not None and sum(map(len, hulls)) > most:
            hulls = join_hulls(hulls, [part.group for part in parts], most)
            hulls = [
                [limit_vertices(h, part.config.max_vertices) for h in of]
                for part, of in zip(parts, hulls, strict=True)
            ]
        _save(path, hulls)
    return hulls


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
