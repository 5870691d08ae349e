"""`manifest.json` of a folder: a dataclass under the name and version of its format."""

import json
import os
from pathlib import Path
from typing import Any, TypeVar

from artiskill.assets.articulated_object import LEGAL_ID
from artiskill.config import from_mapping, to_mapping
from artiskill.demos.header import check_format
from artiskill.errors import ConfigError, DemoError, shown
from artiskill.files import atomic_write, check_path, parse_json, read_bytes

MANIFEST = "manifest.json"

T = TypeVar("T")


def checked_path(given: Path | str) -> Path:
    """A path of demonstrations, if anything could bear it.

    Raises:
        DemoError: it is no path, or one that nothing could bear.
    """
    if not isinstance(given, Path | str) or not str(given).strip():
        raise DemoError(f"demonstrations are in a folder or file, whose path is given, not {shown(given)}")
    try:
        return check_path(given)
    except OSError as error:
        raise DemoError(f"{shown(str(given))} is no path: {error.strerror}") from error


def read_json(cls: type[T], folder: Path, wanted: str, version: int, what: str, advice: str = "") -> T:
    """What `write_json` wrote.

    Args:
        cls: of the content.
        folder: of the file.
        wanted: the format.
        version: of its schema.
        what: a folder with such a file holds.
        advice: how a lost or damaged one may be made anew.

    Raises:
        DemoError: there is none, or one that is damaged, foreign or of another version, or that names files which
            are no plain `<object>.h5`.
    """
    path = folder / MANIFEST
    try:
        given = parse_json(read_bytes(checked_path(path)))
    except FileNotFoundError as error:
        lost = advice if any(folder.glob("*.h5")) else ""
        raise DemoError(f"{str(folder)!r} holds no {what}: it has no {MANIFEST}{lost}") from error
    except NotADirectoryError as error:
        raise DemoError(f"{str(folder)!r} is a file, not a folder of {what}") from error
    except DemoError:
        raise
    except (OSError, ValueError) as error:
        said = getattr(error, "strerror", None) or error
        raise DemoError(f"{str(path)!r} is damaged: {said}{advice}") from error
    if not isinstance(given, dict):
        raise DemoError(f"{str(path)!r} holds no {what} of artiskill")
    check_format(given.pop("format", None), given.pop("schema_version", None), path, wanted, version, what)
    try:
        found = from_mapping(cls, given, str(path))
        _check_names(found, path)
    except ConfigError as error:
        raise DemoError(f"a damaged manifest: {error}{advice}") from error
    return found


def _check_names(manifest: Any, path: Path) -> None:
    """Paths are made of these names: none may lead out of the folder."""
    for name, entry in manifest.files.items():
        if name != f"{entry.object}.h5" or not LEGAL_ID.fullmatch(entry.object):
            raise ConfigError(f"{path}: a file is called {name!r}; its name must be that of its object, and `.h5`")


def format_of(folder: Path) -> str | None:
    """What a folder's manifest says that it is; None if there is none, or a damaged one."""
    found = _read(folder).get("format")
    return None if found is None else str(found)


def listed_files(folder: Path) -> tuple[str, ...]:
    """Names of the files that a folder's manifest lists; none if there is none, or a damaged one."""
    found = _read(folder).get("files", {})
    return tuple(found) if isinstance(found, dict) else ()


def _read(folder: Path) -> dict[str, Any]:
    """What can be read of a manifest."""
    try:
        found = parse_json(read_bytes(folder / MANIFEST))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def write_json(content: Any, folder: Path, wanted: str, version: int) -> None:
    """Write a dataclass; the file is replaced whole or stays as it was.

    Raises:
        DemoError: it cannot be written.
    """
    values = {"format": wanted, "schema_version": version, **to_mapping(content)}
    try:
        with atomic_write(folder / MANIFEST) as temporary, temporary.open("w", encoding="utf-8") as file:
            file.write(json.dumps(values, indent=1) + "\n")
            file.flush()
            os.fsync(file.fileno())  # as the files that it lists
    except OSError as error:
        raise DemoError(f"cannot write to {str(folder)!r}: {error.strerror or error}") from error
