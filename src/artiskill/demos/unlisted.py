"""Files of demonstrations and a manifest that does not list them yet."""

from pathlib import Path

from artiskill.assets.articulated_object import LEGAL_ID
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.manifest import FileEntry, Manifest, sha256_of
from artiskill.demos.unfinished import unlisted_files
from artiskill.errors import DemoError


def file_name(object_id: str) -> str:
    """Of an object's demonstrations."""
    return f"{object_id}.h5"


def entry_of(file: DemoFile) -> FileEntry:
    """A file as a manifest lists it."""
    return FileEntry(
        object=file.header.object,
        content_hash=file.header.content_hash,
        sha256=sha256_of(file.path),
        bytes=file.path.stat().st_size,
        trajectories=len(file),
        targets=file.header.targets,
    )


def with_unlisted(manifest: Manifest, folder: Path) -> Manifest:
    """The manifest, and in it the files of the folder that it did not know.

    Each is read whole, and says itself with which settings it was made.

    Raises:
        DemoError: one was made with other settings, or is damaged, or no file of demonstrations.
    """
    for path in unlisted_files(folder):
        try:
            with DemoFile(path) as file:
                _check_belongs(file, manifest)
                manifest = manifest.with_file(path.name, entry_of(file))
        except DemoError as error:
            raise DemoError(
                f"{str(folder)!r} has a file that its manifest does not list, and that does not fit: {error}; "
                "move it elsewhere, or choose another folder"
            ) from error
    return manifest


def _check_belongs(file: DemoFile, manifest: Manifest) -> None:
    object_id, name = file.header.object, file.path.name
    differences = file.header.settings.differences(manifest.settings)
    if differences:
        raise DemoError(f"{name} was made with other settings ({differences})")
    if name != file_name(object_id) or not LEGAL_ID.fullmatch(object_id):
        raise DemoError(f"{name} holds demonstrations of {object_id!r}")
    file.check_counts()
    for number in range(len(file)):
        file.trajectory(number)
