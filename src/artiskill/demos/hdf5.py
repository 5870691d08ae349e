"""HDF5 as demonstrations use it; h5py is an extra."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from artiskill.errors import DemoError, MissingExtraError

# Structures of HDF5 1.10: small, readable by every library of the last years; the same content, the same bytes.
_VERSIONS = ("v110", "v110")


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


def new_file(path: Path) -> Any:
    """A new, empty file, open for writing."""
    return load_h5py().File(path, "w", libver=_VERSIONS)


def open_file(path: Path) -> Any:
    """A file, open for reading.

    Raises:
        DemoError: there is none, or it is no HDF5, or not whole.
        MissingExtraError: h5py is not installed.
    """
    h5py = load_h5py()
    if not path.is_file():
        raise DemoError(f"there is no file {str(path)!r}")
    try:
        return h5py.File(path, "r")
    except OSError as error:
        reason = "it is truncated" if "truncated" in str(error) else "it is no HDF5 file, or a damaged one"
        raise DemoError(f"cannot read {str(path)!r}: {reason}") from error


@contextmanager
def reading(path: Path, what: str) -> Iterator[None]:
    """Turn what h5py raises about damaged content into an error that names the file.

    Raises:
        DemoError: something is not there, or cannot be read.
    """
    try:
        yield
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, IndexError, AttributeError) as error:
        if isinstance(error, DemoError):
            raise
        raise DemoError(f"{str(path)!r} is damaged: cannot read {what} ({error})") from error


def write_compressed(group: Any, name: str, values: Any, compression: int) -> None:
    """A dataset in one chunk, its bytes sorted by significance and compressed; small or empty ones as they are."""
    if values.size == 0 or compression == 0:
        group.create_dataset(name, data=values)
    else:
        group.create_dataset(
            name, data=values, chunks=values.shape, shuffle=True, compression="gzip", compression_opts=compression
        )
