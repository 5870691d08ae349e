"""`manifest.json` of a folder: a dataclass under the name and version of its format."""

import json
from pathlib import Path
from typing import Any, TypeVar

from artiskill.config import from_mapping, to_mapping
from artiskill.demos.header import check_format
from artiskill.errors import ConfigError, DemoError
from artiskill.jobs.whole_files import whole_file

MANIFEST = "manifest.json"

T = TypeVar("T")


def read_json(cls: type[T], folder: Path, wanted: str, version: int, what: str) -> T:
    """What `write_json` wrote.

    Args:
        cls: of the content.
        folder: of the file.
        wanted: the format.
        version: of its schema.
        what: a folder with such a file holds.

    Raises:
        DemoError: there is none, or one that is damaged, foreign or of another version.
    """
    path = folder / MANIFEST
    try:
        given = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise DemoError(f"{str(folder)!r} holds no {what}: it has no {MANIFEST}") from error
    except (OSError, ValueError) as error:
        raise DemoError(f"{str(path)!r} is damaged: {error}") from error
    if not isinstance(given, dict):
        raise DemoError(f"{str(path)!r} holds no {what} of artiskill")
    check_format(given.pop("format", None), given.pop("schema_version", None), path, wanted, version, what)
    try:
        return from_mapping(cls, given, str(path))
    except ConfigError as error:
        raise DemoError(f"a damaged manifest: {error}") from error


def write_json(content: Any, folder: Path, wanted: str, version: int) -> None:
    """Write a dataclass; the file is replaced whole or stays as it was.

    Raises:
        DemoError: it cannot be written.
    """
    values = {"format": wanted, "schema_version": version, **to_mapping(content)}
    try:
        with whole_file(folder / MANIFEST) as temporary:
            temporary.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise DemoError(f"cannot write to {str(folder)!r}: {error.strerror or error}") from error
