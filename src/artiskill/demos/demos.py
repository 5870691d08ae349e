"""`Demos`: a folder of demonstrations, or a single file, open for reading."""

import logging
from collections.abc import Iterator
from pathlib import Path

from artiskill.demos.demo_file import DemoFile
from artiskill.demos.header import FORMAT
from artiskill.demos.json_files import MANIFEST, checked_path, format_of
from artiskill.demos.manifest import FileEntry, Manifest, check_file, read_manifest
from artiskill.demos.trajectory import Trajectory
from artiskill.errors import DemoError, UnknownNameError
from artiskill.files import is_file

_LOGGER = logging.getLogger("artiskill.demos")


class Demos:
    """Demonstrations of one task.

    Args:
        path: a folder with a manifest.
        check: compare every file with the manifest's checksum first.

    Attributes:
        folder: of the files.
        manifest: its settings, and what it holds.

    Raises:
        DemoError: the folder holds no demonstrations, or a file is missing or differs from its checksum.
    """

    def __init__(self, path: Path | str, check: bool = False) -> None:
        self.folder = checked_path(path)
        self.manifest: Manifest = read_manifest(self.folder)
        for name, entry in self.manifest.files.items():
            if check:
                check_file(self.folder, name, entry)
            elif not is_file(self.folder / name):
                raise DemoError(f"{str(self.folder / name)!r} is missing: the manifest lists it")

    @property
    def objects(self) -> tuple[str, ...]:
        """Ids of the objects."""
        return tuple(entry.object for entry in self.manifest.files.values())

    def __len__(self) -> int:
        """How many trajectories there are."""
        return sum(entry.trajectories for entry in self.manifest.files.values())

    def open(self, object_id: str) -> DemoFile:
        """The file of an object; to be closed, or used in a `with` statement.

        Raises:
            UnknownNameError: there is none of this object.
            DemoError: it is damaged, or not what the manifest says.
        """
        for name, entry in self.manifest.files.items():
            if entry.object == object_id:
                return self._open(name, entry)
        raise UnknownNameError("object", object_id, self.objects, f"(of {str(self.folder)!r})")

    def files(self) -> Iterator[DemoFile]:
        """All files, one after the other; each is closed before the next is opened."""
        for name, entry in self.manifest.files.items():
            with self._open(name, entry) as file:
                yield file

    def trajectories(self) -> Iterator[Trajectory]:
        """All trajectories of all files."""
        for file in self.files():
            yield from file

    def _open(self, name: str, entry: FileEntry) -> DemoFile:
        file = DemoFile(self.folder / name)
        try:
            file.check_listed(self.manifest.settings, entry)
        except BaseException:
            file.close()
            raise
        return file


def find_folders(path: Path | str) -> list[Path]:
    """The folders of demonstrations that a path means: itself, or those right in it.

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
        held = format_of(child)
        if held in (FORMAT, None):
            found.append(child)
        else:
            _LOGGER.warning("%s is left out: it holds no demonstrations, but %s", child, held)
    if not found:
        raise DemoError(f"{str(path)!r} holds no demonstrations: neither it nor a folder in it has a {MANIFEST}")
    return found
