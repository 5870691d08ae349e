"""`Demos`: a folder of demonstrations, open for reading; its `manifest.json`, and what is not finished in it."""

import json
import logging
import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Self, TypeVar

from artiskill.assets.articulated_object import LEGAL_ID
from artiskill.config import from_mapping, to_mapping
from artiskill.demos.demo_file import DemoFile, Trajectory
from artiskill.demos.file_format import DEMONSTRATIONS, FileFormat, TargetCount
from artiskill.demos.hdf5 import checked_path
from artiskill.demos.settings import Settings
from artiskill.errors import ConfigError, DemoError, UnknownNameError, check_name
from artiskill.files import atomic_write, file_sha256, is_file, parse_json, read_bytes
from artiskill.tasks.registry import task_names

MANIFEST = "manifest.json"
UNFINISHED = ".unfinished"  # folder for the work on objects that have no file yet
PACK = Path(__file__).parent / "pack"
# of a worker that ends by itself, and of a disk that is full
KEPT = "all that was made before is kept: the same command goes on from there"
WORKER_HINT = f"it was killed, or memory ran out; {KEPT}, with fewer --workers if memory is short"
_LOGGER = logging.getLogger("artiskill.demos")


@dataclass(frozen=True)
class FileEntry:
    """One file of a folder of demonstrations."""

    object: str  # whose demonstrations it holds
    content_hash: str  # of the object
    sha256: str  # of the file
    bytes: int  # of the file
    trajectories: int  # that it holds
    targets: tuple[TargetCount, ...]  # what came of each


@dataclass(frozen=True)
class FolderManifest:
    """What a folder of any of our formats holds: a base class."""

    FORMAT: ClassVar[FileFormat]

    settings: Any  # of all its files
    files: dict[str, Any] = field(default_factory=dict)  # by name

    def with_file(self, name: str, entry: Any) -> Self:
        """Return the manifest with one more file; files are in the order of their names."""
        return replace(self, files=dict(sorted((self.files | {name: entry}).items())))


@dataclass(frozen=True)
class Manifest(FolderManifest):
    """What a folder of demonstrations holds."""

    FORMAT: ClassVar[FileFormat] = DEMONSTRATIONS

    settings: Settings
    files: dict[str, FileEntry] = field(default_factory=dict)


M = TypeVar("M", bound=FolderManifest)


def read_manifest(folder: Path) -> Manifest:
    """Read the manifest of a folder of demonstrations.

    Raises:
        DemoError: it has none, or one that is damaged, foreign or of another version.
    """
    return read_manifest_of(Manifest, folder)


def read_manifest_of(cls: type[M], folder: Path) -> M:
    """Read the manifest of a folder of any format; `write_manifest` wrote it.

    Raises:
        DemoError: it has none, or one that is damaged, foreign or of another version, or that lists files which
            are not called `<object>.h5`.
    """
    path, made = folder / MANIFEST, cls.FORMAT
    try:
        given = parse_json(read_bytes(checked_path(path)))
    except FileNotFoundError as error:
        lost = made.advice if any(folder.glob("*.h5")) else ""
        raise DemoError(f"{str(folder)!r} holds no {made.holds}: it has no {MANIFEST}{lost}") from error
    except NotADirectoryError as error:
        raise DemoError(f"{str(folder)!r} is a file, not a folder of {made.holds}") from error
    except DemoError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise DemoError(f"{str(path)!r} is damaged: {reason}{made.advice}") from error
    if not isinstance(given, dict):
        raise DemoError(f"{str(path)!r} holds no {made.holds} of artiskill")
    made.check(given.pop("format", None), given.pop("schema_version", None), path)
    try:
        found = from_mapping(cls, given, str(path))
        for name, entry in found.files.items():  # paths are made of these names: none may lead out of the folder
            if name != file_name(entry.object) or not LEGAL_ID.fullmatch(entry.object):
                rule = "its name must be that of its object, and `.h5`"
                raise ConfigError(f"{path}: a file is called {name!r}; {rule}")
    except ConfigError as error:
        raise DemoError(f"a damaged manifest: {error}{made.advice}") from error
    return found


def write_manifest(manifest: FolderManifest, folder: Path) -> None:
    """Write the manifest; the file is replaced whole or stays as it was.

    Raises:
        DemoError: it cannot be written.
    """
    made = manifest.FORMAT
    values = {"format": made.name, "schema_version": made.version, **to_mapping(manifest)}
    try:
        with atomic_write(folder / MANIFEST) as temporary, temporary.open("w", encoding="utf-8") as file:
            file.write(json.dumps(values, indent=1) + "\n")
            file.flush()
            os.fsync(file.fileno())  # as the files that it lists
    except OSError as error:
        raise DemoError(f"cannot write to {str(folder)!r}: {error.strerror or error}") from error


def file_name(object_id: str) -> str:
    """Return the name of the file of an object."""
    return f"{object_id}.h5"


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file's bytes.

    Raises:
        DemoError: it cannot be read.
    """
    try:
        return file_sha256(path)
    except OSError as error:
        raise DemoError(f"cannot read {str(path)!r}: {error.strerror or error}") from error


def check_file(folder: Path, name: str, entry: Any, made: FileFormat = DEMONSTRATIONS) -> None:
    """Raise `DemoError` if a file is missing, or is not the one that its entry describes."""
    found = sha256_of(folder / name)
    if found != entry.sha256:
        raise DemoError(
            f"{str(folder / name)!r} is not the file that the manifest lists: its SHA-256 is {found[:16]}..., the "
            f"manifest has {entry.sha256[:16]}...; it was changed or damaged: remove it and {made.command} again"
        )


def check_listed(file: DemoFile, settings: Settings, entry: FileEntry) -> None:
    """Raise `DemoError` unless a file has the settings, object and counts that its manifest says."""
    file.check_settings(settings)
    header = file.header
    listed = (entry.object, entry.content_hash, entry.targets, entry.trajectories)
    if listed != (header.object, header.content_hash, header.targets, len(file)):
        raise DemoError(f"{str(file.path)!r} holds something else than the manifest says")


def entry_of(file: DemoFile) -> FileEntry:
    """Return a file as a manifest lists it."""
    return FileEntry(
        object=file.header.object,
        content_hash=file.header.content_hash,
        sha256=sha256_of(file.path),
        bytes=file.path.stat().st_size,
        trajectories=len(file),
        targets=file.header.targets,
    )


def _read_loosely(folder: Path) -> dict[str, Any]:
    """Return what can be read of a folder's manifest, of whatever format; nothing if it is missing or damaged."""
    try:
        found = parse_json(read_bytes(folder / MANIFEST))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _listed_files(folder: Path) -> set[str]:
    files = _read_loosely(folder).get("files")
    return set(files) if isinstance(files, dict) else set()


def unfinished_objects(folder: Path) -> list[str]:
    """Return the ids of objects that work was begun on, or is to be, and that the manifest does not list."""
    unfinished, listed = folder / UNFINISHED, _listed_files(folder)
    found = sorted(path.name for path in unfinished.iterdir()) if unfinished.is_dir() else []
    return [name for name in found if file_name(name) not in listed]


def unlisted_files(folder: Path) -> list[Path]:
    """Return the files that the manifest does not list: copied in, or written right before a kill."""
    listed = _listed_files(folder)
    found = sorted(path for path in folder.glob("*.h5") if not path.name.startswith("."))
    return [path for path in found if path.name not in listed]


def remove_unfinished(folder: Path, object_id: str) -> None:
    """Remove the unfinished work on an object, whose file is there."""
    unfinished = folder / UNFINISHED
    shutil.rmtree(unfinished / object_id, ignore_errors=True)
    if unfinished.is_dir() and not any(unfinished.iterdir()):
        unfinished.rmdir()


class FileFolder:
    """A folder of files that a manifest lists: a base class.

    Args:
        path: of the folder.
        check: compare every file with the manifest's checksum first.

    Attributes:
        folder: of the files.
        manifest: its settings, and what it holds.

    Raises:
        DemoError: the folder holds no such files, or one is missing or differs from its checksum.
    """

    MANIFEST_CLASS: ClassVar[type[FolderManifest]]
    manifest: Any

    def __init__(self, path: Path | str, check: bool = False) -> None:
        self.folder = checked_path(path)
        self.manifest = read_manifest_of(self.MANIFEST_CLASS, self.folder)
        for name, entry in self.manifest.files.items():
            if check:
                check_file(self.folder, name, entry, self.manifest.FORMAT)
            elif not is_file(self.folder / name):
                raise DemoError(f"{str(self.folder / name)!r} is missing: the manifest lists it")

    @property
    def objects(self) -> tuple[str, ...]:
        """Ids of the objects."""
        return tuple(entry.object for entry in self.manifest.files.values())

    def __len__(self) -> int:
        """Return how many trajectories there are."""
        return sum(entry.trajectories for entry in self.manifest.files.values())


class Demos(FileFolder):
    """Demonstrations of one task, a folder with a manifest; see `FileFolder`."""

    MANIFEST_CLASS = Manifest
    manifest: Manifest

    def open(self, object_id: str) -> DemoFile:
        """Return the file of an object; to be closed, or used in a `with` statement.

        Raises:
            UnknownNameError: there is none of this object.
            DemoError: it is damaged, or not what the manifest says.
        """
        for name, entry in self.manifest.files.items():
            if entry.object == object_id:
                return self._open(name, entry)
        raise UnknownNameError("object", object_id, self.objects, f"(of {str(self.folder)!r})")

    def files(self) -> Iterator[DemoFile]:
        """Yield all files, one after the other; each is closed before the next is opened."""
        for name, entry in self.manifest.files.items():
            with self._open(name, entry) as file:
                yield file

    def trajectories(self) -> Iterator[Trajectory]:
        """Yield all trajectories of all files."""
        for file in self.files():
            yield from file

    def _open(self, name: str, entry: FileEntry) -> DemoFile:
        file = DemoFile(self.folder / name)
        try:
            check_listed(file, self.manifest.settings, entry)
        except BaseException:
            file.close()
            raise
        return file


def load_demo_pack(task: str) -> Demos:
    """Return the demonstrations of a task that come with the package: a few, of three training objects.

    Raises:
        UnknownNameError: no such task, or none of it in the pack.
        MissingExtraError: h5py is not installed, when a file is opened.
    """
    check_name("task", task, [name for name in task_names() if (PACK / name).is_dir()], "(of the demo pack)")
    return Demos(PACK / task)


def find_folders(path: Path | str) -> list[Path]:
    """Return the folders of demonstrations that a path means: itself, or those right in it.

    Of the latter, those that hold something else are left out, and the log says so.

    Raises:
        DemoError: there are none.
    """
    path = checked_path(path)
    if is_file(path):
        raise DemoError(f"{str(path)!r} is a file; name its folder, {str(path.parent)!r}, which has the manifest")
    if (path / MANIFEST).exists() or any(path.glob("*.h5")):
        return [path]
    found = []
    for child in sorted(child.parent for child in path.glob(f"*/{MANIFEST}")):
        name = _read_loosely(child).get("format")
        if name in (DEMONSTRATIONS.name, None):
            found.append(child)
        else:
            _LOGGER.warning("%s is left out: it holds no demonstrations, but %s", child, name)
    if not found:
        raise DemoError(f"{str(path)!r} holds no demonstrations: neither it nor a folder in it has a {MANIFEST}")
    return found
