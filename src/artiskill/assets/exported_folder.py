"""Folders that an export made: what they say about themselves, and the object in one that nobody changed.

A folder laid out like PartNet-Mobility's holds, besides, the object itself (`object.npz`): a URDF has no place for
springs, handles, densities or grasp poses. `artiskill.json` has a checksum of every file. Whoever changes a file
means the URDF and its meshes, which are then imported.
"""

import hashlib
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.object_file import read_object
from artiskill.errors import AssetError
from artiskill.files import parse_json, read_bytes

MARKER = "artiskill.json"
OBJECT_FILE = "object.npz"
_MARKER_BYTES = 1_000_000  # more than any export writes: a longer file is someone else's
_MOST_BYTES = 512 * 1024**2  # of all files


@dataclass(frozen=True)
class Marker:
    """What an export wrote about its folder."""

    object_id: str
    format: str
    content_hash: str  # of the object
    files: dict[str, str]  # SHA-256 of each file, by its path in the folder; empty texts of early exports


def read_marker(folder: Path) -> Marker | None:
    """Return what an export wrote about its folder; None if no export wrote it."""
    try:
        found = parse_json(read_bytes(folder / MARKER, _MARKER_BYTES))
        files = found["files"]
        named = files if isinstance(files, dict) else dict.fromkeys(files, "")
        sums = {str(name): str(checksum) for name, checksum in named.items()}
        return Marker(str(found["object"]), str(found["format"]), str(found["content_hash"]), sums)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def checksums(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file in a folder, by its path there.

    Raises:
        OSError: a file cannot be read.
    """
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


def read_exported(folder: Path) -> tuple[ArticulatedObject | None, str]:
    """Return the object of a folder that an export made and nobody changed.

    Returns:
        The object, or None; then, where an export made the folder, which file was changed since.

    Raises:
        AssetError: no file was changed, but the object's own is damaged.
    """
    marker = read_marker(folder)
    if marker is None or not marker.files.get(OBJECT_FILE):
        return None, ""
    changed = _first_changed(folder, marker.files)
    if changed:
        return None, changed
    found = read_object(folder / OBJECT_FILE)
    if found.content_hash != marker.content_hash:
        raise AssetError(
            f"folder {str(folder)!r}: {OBJECT_FILE} holds an object with the content hash {found.content_hash}, "
            f"but {MARKER} says {marker.content_hash}; remove {OBJECT_FILE} to import the URDF instead"
        )
    return found, ""


def _first_changed(folder: Path, files: dict[str, str]) -> str:
    """Return the first file that is not as its checksum says, or cannot be read; empty if there is none."""
    left = _MOST_BYTES
    for name, checksum in files.items():
        path = PurePosixPath(name)
        if path.is_absolute() or ".." in path.parts:
            return name
        try:
            content = read_bytes(folder / path, left)
        except OSError:
            return name
        if hashlib.sha256(content).hexdigest() != checksum:
            return name
        left -= len(content)
    return ""
