"""Where an export goes: under a home and a name, whole or not at all."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from artiskill.demos.hdf5 import writing
from artiskill.demos.training_file import TrainingFiles
from artiskill.errors import DemoError
from artiskill.files import TEMPORARY_PREFIX, lock_folder, output_path


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """A temporary folder beside a path; it gets the path's name at the end, if all went well.

    What an export under this name that was killed has left is removed.

    Raises:
        DemoError: the path exists, or cannot be written to.
        ConfigError: another process exports under this name.
    """
    path = output_path(path)
    with writing(path):
        _check_is_free(path)
    place = path.parent / f"{TEMPORARY_PREFIX}{path.name}"
    temporary = place / "dataset"
    try:
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
        with lock_folder(place, "export"), writing(path):
            _check_is_free(path)
            try:
                shutil.rmtree(temporary, ignore_errors=True)
                temporary.mkdir()
                yield temporary
                temporary.rename(path)
            finally:
                shutil.rmtree(temporary, ignore_errors=True)
    finally:
        with suppress(OSError):  # not empty: another process is at it
            place.rmdir()


def _check_is_free(path: Path) -> None:
    if path.exists():
        raise DemoError(f"{str(path)!r} exists: remove it, or choose another folder or name")


def check_not_empty(training: TrainingFiles) -> None:
    """See whether there is anything to export.

    Raises:
        DemoError: there is not.
    """
    if not len(training):
        raise DemoError(f"{str(training.folder)!r} holds no trajectories")
