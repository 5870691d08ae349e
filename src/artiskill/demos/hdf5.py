"""HDF5 as demonstrations use it; h5py is an extra."""

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from artiskill.demos.hdf5_content import MOST_ARRAY_BYTES, check_content
from artiskill.errors import ArtiSkillError, DemoError, MissingExtraError
from artiskill.files import atomic_write, is_file, is_folder

# Structures of HDF5 1.10: small, readable by every library of the last years; the same content, the same bytes.
_VERSIONS = ("v110", "v110")
_NO_ROOM = os.strerror(errno.ENOSPC)
_GROWTH_BYTES = 1 << 20  # of a file in memory
_SPARE_BYTES, _MEGA = 4_000_000, 1e6
# what h5py raises about damaged content, and what readers raise about content that they did not expect
_DAMAGED = (
    *(OSError, RuntimeError, LookupError, ValueError, TypeError, AttributeError, ArithmeticError),
    MemoryError,
)


def load_h5py() -> Any:
    """The module.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import h5py
    except ImportError as error:
        raise MissingExtraError("a file of demonstrations", "demos") from error
    return h5py


@contextmanager
def new_whole_file(path: Path) -> Iterator[Any]:
    """A new file, open for writing; it appears whole, and on the disk, or not at all.

    It is made in memory: HDF5 may take the whole process down with it when it meets a full disk.

    Raises:
        DemoError: it cannot be written.
    """
    memory = {"driver": "core", "backing_store": False, "block_size": _GROWTH_BYTES}
    with load_h5py().File(path.name, "w", libver=_VERSIONS, **memory) as file:
        yield file
        file.flush()
        image = file.id.get_file_image()
    with writing(path), atomic_write(path) as temporary, temporary.open("wb") as written:
        written.write(image)
        written.flush()
        os.fsync(written.fileno())


@contextmanager
def new_large_file(path: Path, room: int) -> Iterator[Any]:
    """`new_whole_file` of one that memory may not hold.

    Its place on the disk is taken beforehand, so that HDF5 meets no full disk, whoever else is writing.

    Args:
        path: of the file.
        room: bytes that its content will take at most.

    Raises:
        DemoError: it cannot be written, or there is no room for it.
    """
    check_room(path, room)
    with writing(path), atomic_write(path) as temporary, temporary.open("r+b") as place:
        with load_h5py().File(temporary, "w", libver=_VERSIONS) as file:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(place.fileno(), 0, _with_spare(room))
            yield file
            file.flush()
            size = file.id.get_filesize()
        place.truncate(size)
        os.fsync(place.fileno())


def _with_spare(room: int) -> int:
    """Bytes of a file with such content, what describes it included."""
    return room + room // 50 + _SPARE_BYTES


def check_room(path: Path, room: int) -> None:
    """See whether there is room on the disk for a file, and a little more.

    Raises:
        DemoError: there is not.
    """
    free = shutil.disk_usage(next(folder for folder in path.parents if is_folder(folder))).free
    wanted = _with_spare(room)
    if wanted > free:
        needs = f"{wanted / _MEGA:.0f} MB may be needed, {free / _MEGA:.0f} MB are free"
        raise DemoError(f"cannot write {str(path)!r}: {_NO_ROOM}: {needs}")


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn what is raised when a file cannot be written into an error that names it and the reason.

    Raises:
        DemoError: it cannot be written.
    """
    try:
        yield
    except (OSError, RuntimeError) as error:  # h5py has both for a disk that is full
        if isinstance(error, ArtiSkillError):
            raise
        raise DemoError(f"cannot write {str(path)!r}: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    """One line."""
    if _NO_ROOM in str(error):
        return _NO_ROOM
    return getattr(error, "strerror", None) or (str(error).splitlines() or [type(error).__name__])[0]


def open_file(path: Path, most_bytes: int = MOST_ARRAY_BYTES) -> Any:
    """A file, open for reading, that holds what we write and nothing that leads elsewhere (`hdf5_content`).

    Args:
        path: of the file.
        most_bytes: of an array in it.

    Raises:
        DemoError: there is none, or it is no HDF5, or not whole, or it holds something else.
        MissingExtraError: h5py is not installed.
    """
    h5py = load_h5py()
    if not is_file(path):
        raise DemoError(f"there is no file {str(path)!r}")
    try:
        file = h5py.File(path, "r")
    except (OSError, RuntimeError, ValueError) as error:
        reason = "it is truncated" if "truncated" in str(error) else "it is no HDF5 file, or a damaged one"
        raise DemoError(f"cannot read {str(path)!r}: {reason}") from error
    try:
        with reading(path, "what it holds"):
            check_content(file, most_bytes)
    except BaseException:
        file.close()
        raise
    return file


@contextmanager
def reading(path: Path, what: str) -> Iterator[None]:
    """Turn what h5py raises about damaged content into an error that names the file.

    Raises:
        DemoError: something is not there, or cannot be read.
    """
    try:
        yield
    except _DAMAGED as error:
        if isinstance(error, DemoError):
            raise
        if _NO_ROOM in str(error):  # of copying from this file to another one
            raise OSError(errno.ENOSPC, _NO_ROOM) from error
        raise DemoError(f"{str(path)!r} is damaged: cannot read {what} ({error})") from error


def write_compressed(group: Any, name: str, values: Any, compression: int) -> None:
    """A dataset in one chunk, its bytes sorted by significance and compressed; small or empty ones as they are."""
    if values.size == 0 or compression == 0:
        group.create_dataset(name, data=values)
    else:
        group.create_dataset(
            name, data=values, chunks=values.shape, shuffle=True, compression="gzip", compression_opts=compression
        )
