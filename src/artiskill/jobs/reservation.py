"""A folder that one process at a time writes to."""

import errno
import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from artiskill.errors import ConfigError
from artiskill.jobs.whole_files import output_path

LOCK_FILE = ".artiskill.lock"
_TRIES = 100
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)


@contextmanager
def reserved(folder: Path, what: str = "evaluation") -> Iterator[None]:
    """Make the folder and keep others out; leaves neither the lock nor a folder made in vain.

    The lock is the kernel's (`flock`) on a file in the folder: it ends with its process, however that ends. Where
    a file system has no such locks, nothing is kept out.

    Args:
        folder: that is written to.
        what: another one of which is kept out, for the error.

    Raises:
        ConfigError: another process is at it, or the folder cannot be made.
    """
    folder = output_path(folder)
    made = [path for path in (folder, *folder.parents) if not path.exists()]  # deepest first
    try:
        handle = _lock(folder, what)
        try:
            yield
        finally:
            (folder / LOCK_FILE).unlink(missing_ok=True)  # while it is ours
            os.close(handle)
    finally:
        for path in made:
            with suppress(OSError):  # not empty
                path.rmdir()


def _lock(folder: Path, what: str) -> int:
    """The handle of the lock file that others find there, too."""
    try:
        for left in reversed(range(_TRIES)):  # its last owner may remove the file, or the folder, while we take it
            try:
                handle = _try_lock(folder, what)
            except FileNotFoundError:
                if not left:
                    raise
            else:
                if handle is not None:
                    return handle
    except OSError as error:
        raise ConfigError(f"cannot write to {str(folder)!r}: {error.strerror or error}") from error
    raise ConfigError(f"cannot write to {str(folder)!r}: its lock disappears again and again")


def _try_lock(folder: Path, what: str) -> int | None:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / LOCK_FILE
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    is_ours = False
    try:
        _flock(handle)
        is_ours = os.path.samestat(os.fstat(handle), os.stat(path))
        if is_ours:
            os.ftruncate(handle, 0)
            os.pwrite(handle, str(os.getpid()).encode(), 0)
    except BlockingIOError as error:
        owner = os.pread(handle, 20, 0).decode(errors="replace")
        by = f" (process {owner})" if owner else ""
        raise ConfigError(f"another {what}{by} writes to {str(folder)!r}; choose another folder") from error
    finally:
        if not is_ours:
            os.close(handle)
    return handle if is_ours else None


def _flock(handle: int) -> None:
    """Lock it; `BlockingIOError` if somebody else has."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
