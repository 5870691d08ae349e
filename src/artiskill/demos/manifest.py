"""`manifest.json` of a folder of demonstrations: its settings, and its files with their checksums."""

import hashlib
from dataclasses import dataclass, field, replace
from pathlib import Path

from artiskill.demos.header import FORMAT, SCHEMA_VERSION, TargetCount
from artiskill.demos.json_files import MANIFEST, read_json, write_json
from artiskill.demos.settings import Settings
from artiskill.errors import DemoError
from artiskill.files import open_regular

_ADVICE = (
    f"; where it was lost or damaged, remove what is left of {MANIFEST} and collect with the options of before: "
    "it is made anew from the files"
)


@dataclass(frozen=True)
class FileEntry:
    """One file of the folder.

    Attributes:
        object: whose demonstrations it holds.
        content_hash: of the object.
        sha256: of the file.
        bytes: of the file.
        trajectories: that it holds.
        targets: what came of each.
    """

    object: str
    content_hash: str
    sha256: str
    bytes: int
    trajectories: int
    targets: tuple[TargetCount, ...]


@dataclass(frozen=True)
class Manifest:
    """What a folder holds.

    Attributes:
        settings: of all its files.
        files: by name.
    """

    settings: Settings
    files: dict[str, FileEntry] = field(default_factory=dict)

    def with_file(self, name: str, entry: FileEntry) -> "Manifest":
        """With one more file; they are in the order of their names."""
        return replace(self, files=dict(sorted((self.files | {name: entry}).items())))


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a folder.

    Raises:
        DemoError: it has none, or one that is damaged, foreign or of another version.
    """
    return read_json(Manifest, folder, FORMAT, SCHEMA_VERSION, "demonstrations", _ADVICE)


def write_manifest(manifest: Manifest, folder: Path) -> None:
    """Write it; it is replaced whole or stays as it was.

    Raises:
        DemoError: it cannot be written.
    """
    write_json(manifest, folder, FORMAT, SCHEMA_VERSION)


def sha256_of(path: Path) -> str:
    """Of a file's bytes.

    Raises:
        DemoError: it cannot be read.
    """
    try:
        with open_regular(path) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise DemoError(f"cannot read {str(path)!r}: {error.strerror or error}") from error


def check_file(folder: Path, name: str, entry: FileEntry) -> None:
    """Compare a file with its entry.

    Raises:
        DemoError: it is missing, or another one.
    """
    found = sha256_of(folder / name)
    if found != entry.sha256:
        raise DemoError(
            f"{str(folder / name)!r} is not the file that the manifest lists: its SHA-256 is {found[:16]}..., the "
            f"manifest has {entry.sha256[:16]}...; it was changed or damaged: remove it and collect again"
        )
