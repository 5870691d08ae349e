"""What a folder holds on its way: work on objects that have no file yet, and nothing without a manifest."""

import shutil
from pathlib import Path

from artiskill.demos.json_files import MANIFEST, listed_files
from artiskill.errors import DemoError

UNFINISHED = ".unfinished"
# of a worker that ends by itself, and of a disk that is full
KEPT = "all that was made before is kept: the same command goes on from there"
WORKER_HINT = f"it was killed, or memory ran out; {KEPT}, with fewer --workers if memory is short"
_MOST_NAMED = 3


def check_manifest(folder: Path, what: str) -> bool:
    """Whether a folder has a manifest; it may lack one only if nothing was ever made in it.

    Without its manifest, nobody knows by which options the rest was made: other options would mix with it, or
    overwrite it.

    Args:
        folder: that is about to be written to.
        what: it holds, for the error.

    Raises:
        DemoError: it has files, or unfinished ones, and no manifest.
    """
    if (folder / MANIFEST).exists():
        return True
    found = sorted(path.name for path in folder.glob("*.h5"))
    if (folder / UNFINISHED).exists():
        found.append(UNFINISHED)
    if found:
        named = ", ".join(found[:_MOST_NAMED]) + (", ..." if len(found) > _MOST_NAMED else "")
        raise DemoError(
            f"{str(folder)!r} has {what} ({named}), but its {MANIFEST} is missing, which says how they were made: "
            f"put it back, choose another folder, or remove these files"
        )
    return False


def remove_unfinished(folder: Path, object_id: str) -> None:
    """Forget the unfinished work on an object, whose file is there."""
    unfinished = folder / UNFINISHED
    shutil.rmtree(unfinished / object_id, ignore_errors=True)
    if unfinished.is_dir() and not any(unfinished.iterdir()):
        unfinished.rmdir()


def unfinished_objects(folder: Path) -> list[str]:
    """Ids of objects that work was begun on, or is to be, and that the manifest does not list."""
    unfinished, listed = folder / UNFINISHED, listed_files(folder)
    found = sorted(path.name for path in unfinished.iterdir()) if unfinished.is_dir() else []
    return [name for name in found if f"{name}.h5" not in listed]


def unlisted_files(folder: Path) -> list[Path]:
    """Files that the manifest does not list: copied in, or written right before the process was killed."""
    listed = listed_files(folder)
    found = sorted(path for path in folder.glob("*.h5") if not path.name.startswith("."))
    return [path for path in found if path.name not in listed]
