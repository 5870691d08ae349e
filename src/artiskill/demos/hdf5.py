"""HDF5 files of trajectories: written whole or not at all, and read safely; h5py is an extra.

HDF5 follows links, raw data in other files and datasets that are views of others, wherever they lead: a file from
elsewhere could have a private file read into a training file. And a file of 4 kB can declare an array of 12 GB. So
before anything is read, a file must hold what we write, and nothing else (`_ContentChecker`).
"""

import errno
import math
import operator
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from artiskill.errors import ArtiSkillError, DemoError, MissingExtraError, shown
from artiskill.files import atomic_write, check_path, is_file, is_folder

TRAJECTORY = "traj_"  # and its number: the group of a trajectory
# Structures of HDF5 1.10: small, readable by every library of the last years; the same content, the same bytes.
_VERSIONS = ("v110", "v110")
_DISK_FULL = os.strerror(errno.ENOSPC)
_GROWTH_BYTES = 1 << 20  # of a file in memory
_SPARE_BYTES, _MEGA = 4_000_000, 1e6
MOST_ARRAY_BYTES = 1 << 28  # of an array of demonstrations; a long trajectory's states have 1 MB
MOST_FRAMES_BYTES = 1 << 34  # of an array of a training file; 200 frames of full clouds have 500 MB
# deflate's own limit: two bits stand for 258 bytes
_MOST_RATIO, _CHUNK_OVERHEAD = 1032, 64
_MOST_CHUNK_BYTES = 1 << 25
_MOST_ATTRIBUTES, _MOST_ATTRIBUTE_BYTES = 64, 1 << 20
_MOST_DEPTH = 8  # of groups; the deepest of ours are 3
_NUMBERS = "biuf"
# what h5py raises about damaged content, and what readers raise about content that they did not expect
_DAMAGED = (
    *(OSError, RuntimeError, LookupError, ValueError, TypeError, AttributeError, ArithmeticError),
    MemoryError,
)

Form = tuple[tuple[int, ...], Any]  # shape and type of an array


def load_h5py() -> Any:
    """Return the module.

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
    """Yield a new file, open for writing; it appears whole, and on the disk, or not at all.

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
def new_large_file(path: Path, content_bytes: int) -> Iterator[Any]:
    """Yield a new file like `new_whole_file`, of a size that memory may not hold.

    Its place on the disk is taken beforehand, so that HDF5 meets no full disk, whoever else is writing.

    Args:
        path: of the file.
        content_bytes: that its content will take at most.

    Raises:
        DemoError: it cannot be written, or the disk has too little space.
    """
    wanted = content_bytes + content_bytes // 50 + _SPARE_BYTES  # with what describes the content
    free = shutil.disk_usage(next(folder for folder in path.parents if is_folder(folder))).free
    if wanted > free:
        needs = f"{wanted / _MEGA:.0f} MB may be needed, {free / _MEGA:.0f} MB are free"
        raise DemoError(f"cannot write {str(path)!r}: {_DISK_FULL}: {needs}")
    with writing(path), atomic_write(path) as temporary, temporary.open("r+b") as place:
        with load_h5py().File(temporary, "w", libver=_VERSIONS) as file:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(place.fileno(), 0, wanted)
            yield file
            file.flush()
            size = file.id.get_filesize()
        place.truncate(size)
        os.fsync(place.fileno())


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn the errors of a file that cannot be written into a `DemoError` that names it and the reason."""
    try:
        yield
    except (OSError, RuntimeError) as error:  # h5py has both for a disk that is full
        if isinstance(error, ArtiSkillError):
            raise
        reason = getattr(error, "strerror", None) or (str(error).splitlines() or [type(error).__name__])[0]
        reason = _DISK_FULL if _DISK_FULL in str(error) else reason
        raise DemoError(f"cannot write {str(path)!r}: {reason}") from error


def write_compressed(group: Any, name: str, values: Any, compression: int) -> None:
    """Write a dataset in one chunk, its bytes sorted by significance and compressed; small or empty ones as is."""
    if values.size == 0 or compression == 0:
        group.create_dataset(name, data=values)
    else:
        group.create_dataset(
            name, data=values, chunks=values.shape, shuffle=True, compression="gzip", compression_opts=compression
        )


def checked_path(given: Path | str) -> Path:
    """Return a path of demonstrations, if a file system could have it.

    Raises:
        DemoError: it is no path, or one that no file system could have.
    """
    if not isinstance(given, Path | str) or not str(given).strip():
        raise DemoError(f"demonstrations are in a folder or file, whose path is given, not {shown(given)}")
    try:
        return check_path(given)
    except OSError as error:
        raise DemoError(f"{shown(str(given))} is not a path: {error.strerror}") from error


def open_file(path: Path, most_bytes: int = MOST_ARRAY_BYTES) -> Any:
    """Return a file, open for reading, that holds what we write and nothing that leads elsewhere.

    Args:
        path: of the file.
        most_bytes: of an array in it, unpacked.

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
            _ContentChecker(h5py, most_bytes).check_group(file.id, "", 0)
    except BaseException:
        file.close()
        raise
    return file


@contextmanager
def reading(path: Path, what: str) -> Iterator[None]:
    """Turn the errors of damaged content into a `DemoError` that names the file and what was read."""
    try:
        yield
    except _DAMAGED as error:
        if isinstance(error, DemoError):
            raise
        if _DISK_FULL in str(error):  # of copying from this file to another one
            raise OSError(errno.ENOSPC, _DISK_FULL) from error
        raise DemoError(f"{str(path)!r} is damaged: cannot read {what} ({error})") from error


class _ContentChecker:
    """Checks that a file holds groups and arrays of numbers, all in itself, none larger than it can be.

    Raises `ValueError` about a link to elsewhere, another kind of thing, a filter that we do not use, or a size
    that its bytes on the disk cannot unpack to; besides, whatever h5py raises about damaged files.
    """

    def __init__(self, h5py: Any, most_bytes: int) -> None:
        self._h5, self._most_bytes = h5py, most_bytes
        self._groups: set[int] = set()
        self._arrays: set[int] = set()

    def check_group(self, group: Any, path: str, depth: int) -> None:
        """Check a group's attributes, links and what they lead to; a group met twice would be walked for ever."""
        h5 = self._h5
        address = h5.h5o.get_info(group).addr
        if address in self._groups or depth > _MOST_DEPTH:
            raise ValueError(f"group {path or '/'} is in itself, in two places, or nested too deeply")
        self._groups.add(address)
        self._check_attributes(group, path)
        links: list[tuple[bytes, int]] = []
        group.links.iterate(lambda name, info: links.append((name, info.type)), info=True)
        for raw, kind in links:
            name = f"{path}/{raw.decode('utf-8', 'replace')}"
            if kind != h5.h5l.TYPE_HARD:
                raise ValueError(f"{name} is a link to elsewhere, which is not followed")
            item = h5.h5o.open(group, raw)
            if isinstance(item, h5.h5g.GroupID):
                self.check_group(item, name, depth + 1)
            elif isinstance(item, h5.h5d.DatasetID):
                self._check_array(item, name)
            else:
                raise ValueError(f"{name} is neither a group nor an array")

    def _check_array(self, array: Any, name: str) -> None:
        address = self._h5.h5o.get_info(array).addr
        if address in self._arrays:  # another name of an array that is in order
            return
        self._arrays.add(address)
        self._check_attributes(array, name)
        if not _is_numbers(array.dtype):
            raise ValueError(f"{name} holds {array.dtype}, not numbers")
        made, h5d, h5z = array.get_create_plist(), self._h5.h5d, self._h5.h5z
        if made.get_layout() not in (h5d.COMPACT, h5d.CONTIGUOUS, h5d.CHUNKED) or made.get_external_count():
            raise ValueError(f"{name} has its values in another file or array, which is not followed")
        filters = [made.get_filter(i)[0] for i in range(made.get_nfilters())]
        if not set(filters) <= {h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE} or len(filters) != len(set(filters)):
            raise ValueError(f"{name} has the filters {filters}; only gzip and shuffle are legal, each once")
        chunk = made.get_chunk() if made.get_layout() == h5d.CHUNKED else ()
        self._check_size(array, name, chunk, h5z.FILTER_DEFLATE in filters)

    def _check_size(self, array: Any, name: str, chunk: tuple[int, ...], is_packed: bool) -> None:
        size = math.prod(array.shape) * array.dtype.itemsize
        if size > self._most_bytes:
            raise ValueError(f"{name} has {size} bytes, more than the {self._most_bytes} that are legal")
        if chunk and math.prod(chunk) * array.dtype.itemsize > max(size, _MOST_CHUNK_BYTES):
            raise ValueError(f"{name} has chunks of {chunk}, larger than the array")
        stored = array.get_storage_size() if size else 0
        if size > (stored * _MOST_RATIO + _CHUNK_OVERHEAD if is_packed else stored):
            raise ValueError(f"{name} declares {size} bytes, but has {stored} on the disk")

    def _check_attributes(self, item: Any, name: str) -> None:
        h5a = self._h5.h5a
        count = h5a.get_num_attrs(item)
        if count > _MOST_ATTRIBUTES:
            raise ValueError(f"{name or '/'} has {count} attributes; at most {_MOST_ATTRIBUTES} are legal")
        for i in range(count):
            attribute = h5a.open(item, index=i)
            kind = attribute.get_type()
            size = math.prod(attribute.shape) * kind.get_size()
            is_text = isinstance(kind, self._h5.h5t.TypeStringID)
            if size > _MOST_ATTRIBUTE_BYTES or not (is_text or _is_numbers(attribute.dtype)):
                raise ValueError(f"{name or '/'} has an attribute that is no text and no few numbers")


def _is_numbers(dtype: Any) -> bool:
    """Return whether an array's elements are numbers, or rows of them."""
    if dtype.names is None:
        return dtype.kind in _NUMBERS
    return all(dtype[name].kind in _NUMBERS for name in dtype.names)


def check_forms(arrays: Mapping[str, Any], wanted: Mapping[str, Form]) -> None:
    """Raise `ValueError` unless arrays, or datasets of a file, have the shapes and types that they must have."""
    for name, (shape, dtype) in wanted.items():
        found = arrays[name]
        if found.shape != shape or found.dtype != np.dtype(dtype):
            raise ValueError(f"{name} are {found.dtype} {found.shape}, not {np.dtype(dtype)} {shape}")


def check_finite(arrays: Mapping[str, np.ndarray]) -> None:
    """Raise `ValueError` unless all numbers are finite."""
    for name, values in arrays.items():
        if not np.isfinite(values).all():
            raise ValueError(f"{name} have numbers that are not finite")


def whole_number(given: int, what: str) -> int:
    """Return a whole number as an `int`; raise `TypeError` if it is none."""
    try:
        return operator.index(given)
    except TypeError as error:
        raise TypeError(f"{what} must be a whole number, not {shown(given)}") from error


class TrajectoryFile:
    """An HDF5 file with groups of trajectories, open for reading; a context manager that closes it.

    Args:
        path: of the file.
        what: that `_read_header` reads, for errors.
        most_bytes: of an array in it.

    Attributes:
        path: of the file.

    Raises:
        DemoError: there is no such file, or it is damaged, foreign or of another version.
        MissingExtraError: h5py is not installed.
    """

    def __init__(self, path: Path | str, what: str, most_bytes: int = MOST_ARRAY_BYTES) -> None:
        self.path = checked_path(path)
        self._file = open_file(self.path, most_bytes)
        try:
            with reading(self.path, what):
                self._count = sum(name.startswith(TRAJECTORY) for name in self._file)
                self._read_header(dict(self._file.attrs))
        except BaseException:
            self.close()
            raise

    def _read_header(self, given: dict[str, Any]) -> None:
        """Read what the file's attributes say; `self` is open, and its length known."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        """Return the file itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file."""
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __len__(self) -> int:
        """Return how many trajectories the file holds."""
        return self._count

    def checked(self, i: int) -> int:
        """Return the number of a trajectory that the file holds.

        Raises:
            IndexError: there are not so many.
            TypeError: it is no whole number.
            DemoError: the file has been closed.
        """
        self.check_open()
        number = whole_number(i, "a trajectory's number")
        if not 0 <= number < self._count:
            held = f"the trajectories 0 to {self._count - 1}" if self._count else "no trajectories"
            raise IndexError(f"{str(self.path)!r} has {held}, not {i}")
        return number

    def check_open(self) -> None:
        """Raise `DemoError` if the file has been closed."""
        if not self._file:
            raise DemoError(f"{str(self.path)!r} has been closed: read it before, or inside its `with` statement")
