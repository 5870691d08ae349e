"""Folders that appear whole or not at all, and are never taken from someone else."""

import json
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from artiskill.errors import ConfigError
from artiskill.jobs.whole_files import output_path

MARKER = "artiskill.json"  # stands in every folder that an export made
_MARKER_BYTES = 1_000_000  # more than any export writes: a longer file is someone else's


def replace_folder(folder: Path, fill: Callable[[Path], Path], marker: dict[str, Any], force: bool) -> Path:
    """Have a folder filled under a temporary name beside its place, then move it there.

    Args:
        folder: its place. An empty folder there, or an export of the same object in the same format, is replaced.
        fill: writes into the folder that it is given, and returns the path of its main file.
        marker: what `MARKER` says about the folder, beside its files: `object`, the object's id, and `format`.
        force: replace any other folder, too.

    Returns:
        The main file, in its place.

    Raises:
        ConfigError: something else stands there, or the place cannot be written to.
    """
    folder = output_path(folder)
    check_replaceable(folder, marker["object"], marker["format"], force)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as name:
            new, old = Path(name) / "new", Path(name) / "old"
            new.mkdir()
            main = fill(new).relative_to(new)
            files = sorted(path.relative_to(new).as_posix() for path in new.rglob("*") if path.is_file())
            about = json.dumps(marker | {"files": files}, indent=2)
            (new / MARKER).write_text(about + "\n", encoding="utf-8")
            _swap(new, folder, old)
    except OSError as error:
        raise ConfigError(f"cannot write the folder {str(folder)!r}: {error.strerror or error}") from error
    return folder / main


def check_replaceable(folder: Path, object_id: str, form: str, force: bool) -> None:
    """Refuse to take a place that holds anything but an export of the same object in the same format.

    Raises:
        ConfigError: something else is there, and `force` is not set; a file or link, even then.
    """
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise ConfigError(f"cannot write the folder {str(folder)!r}: a file or link of that name is there")
    if force or not folder.is_dir():
        return
    held = _held(folder, object_id, form)
    if held:
        raise ConfigError(
            f"the folder {str(folder)!r} holds {held}, so it is left alone: name another folder, "
            f"{str(folder / object_id)!r} say, or say --force (`force=True`) to replace it with everything in it"
        )


def _held(folder: Path, object_id: str, form: str) -> str:
    """What a folder holds that would be lost; empty where an export of this object, in this format, is all."""
    marker = _read_marker(folder)
    if marker is None:
        others = [path.name for path in sorted(folder.iterdir()) if _read_marker(path) is not None]
        if others:
            return f"exports in folders of their own ({', '.join(others[:3])}{' ...' if others[3:] else ''})"
        found = sorted(path.name for path in folder.iterdir())
        return f"{found[0]!r}, which no export wrote" if found else ""
    if marker["object"] != object_id:
        return f"an export of {marker['object']!r}"
    if marker["format"] != form:
        return f"an export of {object_id!r} as {marker['format']}"
    there = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()}
    added = sorted(there - {MARKER, *marker["files"]})
    return f"{added[0]!r}, which no export wrote" if added else ""


def _read_marker(folder: Path) -> dict[str, Any] | None:
    """What an export said about a folder that it wrote; None where no export did."""
    try:
        with (folder / MARKER).open("rb") as file:
            said = json.loads(file.read(_MARKER_BYTES))
        return {
            "object": str(said["object"]),
            "format": str(said["format"]),
            "files": list(map(str, said["files"])),
        }
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


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
