"""Where an export goes: under a home and a name, whole or not at all."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from artiskill.demos.hdf5 import writing
from artiskill.demos.replay.training_file import TrainingFiles
from artiskill.errors import DemoError
from artiskill.jobs.whole_files import TEMPORARY_PREFIX


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """A temporary folder beside a path; it gets the path's name at the end, if all went well.

    Raises:
        DemoError: the path exists, or cannot be written to.
    """
    if path.exists():
        raise DemoError(f"{str(path)!r} exists: remove it, or choose another folder or name")
    temporary = None
    try:
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            temporary = Path(tempfile.mkdtemp(prefix=TEMPORARY_PREFIX, dir=path.parent))
            temporary.chmod(0o755)
            yield temporary
            temporary.rename(path)
    finally:
        if temporary is not None:
            shutil.rmtree(temporary, ignore_errors=True)


def check_not_empty(training: TrainingFiles) -> None:
    """See whether there is anything to export.

    Raises:
        DemoError: there is not.
    """
    if not len(training):
        raise DemoError(f"{str(training.folder)!r} holds no trajectories")
