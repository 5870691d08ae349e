"""`export_object`: an object to a self-contained folder of another program's format; `export_objects`: many.

A folder appears whole or not at all, and a folder with anything but an earlier export of the same object is kept.
"""

import json
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from artiskill import __version__
from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import object_id_of, object_of
from artiskill.assets.exported_folder import MARKER, checksums, read_marker
from artiskill.errors import ConfigError, check_name
from artiskill.exports.glb import write_glb
from artiskill.exports.mjcf import write_mjcf
from artiskill.exports.urdf import write_urdf
from artiskill.files import output_path

_WRITERS: dict[str, Callable[[ArticulatedObject, Path], Path]] = {
    "mjcf": write_mjcf,
    "urdf": write_urdf,
    "glb": write_glb,
}
FORMATS = tuple(_WRITERS)
_OTHER_NAMES = {"gltf": "glb"}  # what else people call them


def export_object(
    obj: ArticulatedObject,
    format: str,  # noqa: A002 - the word that everyone uses
    folder: Path | str,
    force: bool = False,
) -> Path:
    """Write an object to a folder of its own; all paths inside are relative to it.

    Args:
        obj: the object.
        format: `mjcf` (MuJoCo), `urdf` (laid out like PartNet-Mobility; its folder is a name for `load_object`) or
            `glb`,
            also called `gltf` (binary glTF, for looking at; needs the extra `export`).
        folder: made where it is missing; it appears complete or not at all. An earlier export of this object in
            this format is replaced.
        force: also replace a folder with other files in it, with another object, or in another format.

    Returns:
        The main file: `<id>.xml`, `mobility.urdf` or `<id>.glb`.

    Raises:
        UnknownNameError: no such format.
        ConfigError: the folder holds files that no export of this object wrote, or cannot be written.
        MissingExtraError: `glb` without the extra `export`.
    """
    name = format_named(format)
    marker = {
        "made_by": f"ArtiSkill {__version__}",
        "format": name,
        "object": obj.id,
        "category": obj.category,
        "content_hash": obj.content_hash,
        "source": str(obj.metadata.get("source", "unknown")),
    }
    return _replace_folder(output_path(folder), lambda new: _WRITERS[name](obj, new), marker, force)


def export_objects(
    objects: Iterable[str | ArticulatedObject],
    format: str,  # noqa: A002
    folder: Path | str,
    force: bool = False,
) -> Iterator[tuple[ArticulatedObject, Path]]:
    """Write each object to a folder of its own, `<folder>/<id>`, one after the other.

    Args:
        objects: themselves, or names that `load_object` takes.
        format: as of `export_object`.
        folder: above the objects' own.
        force: as of `export_object`.

    Yields:
        Each object and its main file, once it is there.

    Raises:
        UnknownNameError, ConfigError, MissingExtraError: as `export_object`; of all folders before any is written.
    """
    name, above, items = format_named(format), output_path(folder), tuple(objects)
    for item in items:
        object_id = object_id_of(item)
        _check_replaceable(above / object_id, object_id, name, force)
    for item in items:
        obj = object_of(item)
        yield obj, export_object(obj, name, above / obj.id, force)


def format_named(given: str) -> str:
    """Return the one of `FORMATS` that a name means.

    Raises:
        UnknownNameError: none.
    """
    check_name("format", given, (*FORMATS, *_OTHER_NAMES))
    return _OTHER_NAMES.get(given, given)


def _replace_folder(folder: Path, fill: Callable[[Path], Path], marker: dict[str, Any], force: bool) -> Path:
    """Fill a folder under a temporary name beside its place, then move it there, and return its main file.

    Args:
        folder: its place.
        fill: writes into the folder that it is given, and returns the path of its main file.
        marker: what `MARKER` holds beside the names of files: `object`, the object's id, `format` and more.
        force: as of `export_object`.

    Raises:
        ConfigError: something else is there, or the place cannot be written to.
    """
    _check_replaceable(folder, marker["object"], marker["format"], force)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as name:
            new, old = Path(name) / "new", Path(name) / "old"
            new.mkdir()
            main = fill(new).relative_to(new)
            about = json.dumps(marker | {"files": checksums(new)}, indent=2)
            (new / MARKER).write_text(about + "\n", encoding="utf-8")
            _swap(new, folder, old)
    except OSError as error:
        raise ConfigError(f"cannot write the folder {str(folder)!r}: {error.strerror or error}") from error
    return folder / main


def _check_replaceable(folder: Path, object_id: str, form: str, force: bool) -> None:
    """Refuse to take a place that holds anything but an export of the same object in the same format.

    Raises:
        ConfigError: something else is there, and `force` is not set; a file or link, even then.
    """
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise ConfigError(f"cannot write the folder {str(folder)!r}: a file or link of that name is there")
    if force or not folder.is_dir():
        return
    contents = _contents_to_lose(folder, object_id, form)
    if contents:
        raise ConfigError(
            f"the folder {str(folder)!r} holds {contents}, so it is left alone: name another folder, "
            f"{str(folder / object_id)!r} say, or say --force (`force=True`) to replace it with everything in it"
        )


def _contents_to_lose(folder: Path, object_id: str, form: str) -> str:
    """Describe what would be lost with a folder; empty if it is only an export of this object in this format."""
    marker = read_marker(folder)
    if marker is None:
        others = [path.name for path in sorted(folder.iterdir()) if read_marker(path) is not None]
        if others:
            return f"exports in folders of their own ({', '.join(others[:3])}{' ...' if others[3:] else ''})"
        found = sorted(path.name for path in folder.iterdir())
        return f"{found[0]!r}, which no export wrote" if found else ""
    if marker.object_id != object_id:
        return f"an export of {marker.object_id!r}"
    if marker.format != form:
        return f"an export of {object_id!r} as {marker.format}"
    there = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()}
    added = sorted(there - {MARKER, *marker.files})
    return f"{added[0]!r}, which no export wrote" if added else ""


def _swap(new: Path, folder: Path, old: Path) -> None:
    """Put `new` in the place of `folder`; if that is stopped halfway, put the old one back."""
    if folder.exists():
        shutil.move(folder, old)
    try:
        shutil.move(new, folder)
    except BaseException:  # Ctrl-C, too
        if old.exists() and not folder.exists():
            shutil.move(old, folder)
        raise
