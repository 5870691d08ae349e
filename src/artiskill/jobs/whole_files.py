"""Files that appear whole or not at all."""

import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# of names that a killed process may leave behind; whoever owns a folder alone may remove them
TEMPORARY_PREFIX = ".part-"
_TEMPORARY = re.compile(re.escape(TEMPORARY_PREFIX) + r"[a-z0-9_]{8}(\.[a-z0-9]+)?")  # as `mkstemp` makes them


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary name beside a path; what is written there gets the path's name at the end, if all went well."""
    handle, name = tempfile.mkstemp(prefix=TEMPORARY_PREFIX, suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o644)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of `whole_file` in a folder that nobody else is writing to."""
    for path in folder.glob(f"{TEMPORARY_PREFIX}*"):
        if _TEMPORARY.fullmatch(path.name) and path.is_file():
            path.unlink(missing_ok=True)
