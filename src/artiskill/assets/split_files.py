"""A user's own split: a YAML file that lists names of objects."""

import os
from dataclasses import dataclass
from pathlib import Path

from artiskill.assets.names import is_path, is_split_file
from artiskill.config import from_mapping, load_yaml
from artiskill.errors import AssetError, shown
from artiskill.files import is_file, is_folder


@dataclass(frozen=True)
class SplitFile:
    """What such a file holds.

    Attributes:
        objects: names as `resolve_objects` takes them, other split files excepted; paths are relative to the file.
        description: for people.
    """

    objects: tuple[str, ...]
    description: str = ""


def read_split_file(path: Path) -> tuple[str, ...]:
    """The names that a split file lists.

    Raises:
        AssetError: there is no such file, or it lists nothing, no list, or another split file.
        ConfigError: it has another form.
    """
    if is_folder(path):
        raise AssetError(f"split file {str(path)!r} is a folder; write {f'{path}/'!r} to mean an object in it")
    if not is_file(path):
        raise AssetError(f"split file {shown(str(path))} does not exist; it holds YAML, `objects: [names]`")
    data = load_yaml(path)
    given = data.get("objects", [])
    if not isinstance(given, list):
        example = given if isinstance(given, str) and len(given) < 100 else "cabinet-0001"
        raise AssetError(
            f"split file {str(path)!r}: `objects` must be a list of names, not {shown(given)}; for example "
            f"`objects: [{example}]`"
        )
    names = from_mapping(SplitFile, data, path.name).objects
    if not names:
        raise AssetError(f"split file {str(path)!r} lists no object under `objects`")
    nested = [name for name in names if is_split_file(name)]
    if nested:
        raise AssetError(f"split file {str(path)!r} lists another split file: {nested[0]!r}")
    # joined as text: `./mine` beside a file in the working directory must not become `mine`, which is no path
    return tuple(os.path.join(path.parent, name) if is_path(name) else name for name in names)
