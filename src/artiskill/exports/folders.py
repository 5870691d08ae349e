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
_MARKER_BYTES = 65536  # more than any export writes: a longer file is someone else's


def replace_folder(folder: Path, fill: Callable[[Path], Path], marker: dict[str, Any], force: bool) -> Path:
    """Have a folder filled under a temporary name beside its place, then move it there.

    Args:
        folder: its place. An empty folder there, or one that an export of the same object made, is replaced.
        fill: writes into the folder that it is given, and returns the path of its main file.
        marker: what `MARKER` says about the folder; its `object` is the id of the object.
        force: replace any other folder, too.

    Returns:
        The main file, in its place.

    Raises:
        ConfigError: something else stands there, or the place cannot be written to.
    """
    folder = output_path(folder)
    check_replaceable(folder, marker["object"], force)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as name:
            new, old = Path(name) / "new", Path(name) / "old"
            new.mkdir()
            main = fill(new).relative_to(new)
            (new / MARKER).write_text(json.dumps(marker, indent=2) + "\n", encoding="utf-8")
            _swap(new, folder, old)
    except OSError as error:
        raise ConfigError(f"cannot write the folder {str(folder)!r}: {error.strerror or error}") from error
    return folder / main


def check_replaceable(folder: Path, object_id: str, force: bool) -> None:
    """Refuse to take a place that someone else's files, or another object's, stand at.

    Raises:
        ConfigError: the place is a file, or a folder with files that no export of this object wrote, and `force`
            is not set.
    """
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise ConfigError(f"cannot write the folder {str(folder)!r}: a file or link of that name is there")
    if force or not folder.is_dir():
        return
    owner = _exported_object(folder)
    found = sorted(path.name for path in folder.iterdir())
    if not found or owner == object_id:
        return
    held = f"{found[0]!r}, which no export wrote" if owner is None else f"an export of {owner!r}"
    raise ConfigError(
        f"the folder {str(folder)!r} holds {held}, so it is left alone: name another folder, or say --force "
        "(`force=True`) to replace it with everything in it"
    )


def _exported_object(folder: Path) -> str | None:
    """The id of the object that an export wrote there; None where no export did."""
    try:
        with (folder / MARKER).open("rb") as file:
            said = json.loads(file.read(_MARKER_BYTES))
        return str(said["object"])
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
