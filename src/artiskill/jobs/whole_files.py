"""Files that appear whole or not at all."""

import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from artiskill.errors import ConfigError, shown
from artiskill.files import check_path, check_writable

# of names that a killed process may leave behind; whoever owns a folder alone may remove them
TEMPORARY_PREFIX = ".part-"
_TEMPORARY = re.compile(re.escape(TEMPORARY_PREFIX) + r"[a-z0-9_]{8}(\.[a-z0-9]+)?")


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary name beside a path; what is written there gets the path's name at the end, if all went well.

    The file's mode is what the user's umask leaves of 0666, as of every file that a program makes.

    Raises:
        OSError: a folder, a device or a pipe is in its place, or nothing can be written there.
    """
    check_writable(path)
    temporary = path.with_name(f"{TEMPORARY_PREFIX}{secrets.token_hex(4)}{path.suffix.lower()}")
    os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666))
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def output_path(given: Path | str) -> Path:
    """The path of a file or folder that is to be written, if any could bear it; better said before the work.

    Raises:
        ConfigError: it is no path, or a device or pipe is there.
    """
    if not isinstance(given, Path | str):
        raise ConfigError(f"the path of a file or folder was expected, not {shown(given)}")
    try:
        return check_writable(given)
    except IsADirectoryError:
        return check_path(given)
    except OSError as error:
        raise ConfigError(f"cannot write {shown(str(given))}: {error.strerror}") from error


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of `whole_file` in a folder that nobody else is writing to."""
    for path in folder.glob(f"{TEMPORARY_PREFIX}*"):
        if _TEMPORARY.fullmatch(path.name) and path.is_file():
            path.unlink(missing_ok=True)
