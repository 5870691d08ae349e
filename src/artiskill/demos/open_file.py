"""What the two kinds of files of trajectories share: they are open, and a context manager closes them."""

import operator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from artiskill.demos.hdf5 import open_file, reading
from artiskill.demos.hdf5_content import MOST_ARRAY_BYTES
from artiskill.demos.json_files import checked_path
from artiskill.errors import DemoError, shown

TRAJECTORY = "traj_"  # and its number: the group of a trajectory


def whole_number(given: int, what: str) -> int:
    """It, as an `int`.

    Raises:
        TypeError: it is none.
    """
    try:
        return operator.index(given)
    except TypeError as error:
        raise TypeError(f"{what} must be a whole number, not {shown(given)}") from error


class OpenFile:
    """An HDF5 file with groups of trajectories, open for reading.

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
        """Itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file."""
        self.close()

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()

    def checked(self, i: int) -> int:
        """A trajectory's number.

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
        """See whether it can still be read.

        Raises:
            DemoError: it has been closed.
        """
        if not self._file:
            raise DemoError(f"{str(self.path)!r} has been closed: read it before, or inside its `with` statement")

    def __len__(self) -> int:
        """How many trajectories it holds."""
        return self._count
