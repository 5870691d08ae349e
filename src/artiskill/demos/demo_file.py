"""`DemoFile`: one file of demonstrations, open for reading."""

import operator
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object
from artiskill.demos.hdf5 import reading
from artiskill.demos.header import Header
from artiskill.demos.open_file import OpenFile
from artiskill.demos.recording import ARRAYS, Recording
from artiskill.demos.settings import Settings
from artiskill.demos.trajectory import Trajectory
from artiskill.demos.writing import ATTEMPT_TYPE, ATTEMPTS
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ArtiSkillError, DemoError


class DemoFile(OpenFile):
    """The demonstrations of one object; a sequence of `Trajectory`, and a context manager that closes the file.

    Args:
        path: of the file.

    Attributes:
        path: of the file.
        header: all but the trajectories.

    Raises:
        DemoError: there is no such file, or it is damaged, foreign or of another version.
        MissingExtraError: h5py is not installed.
    """

    def __init__(self, path: Path | str) -> None:
        super().__init__(path, "its header")

    def _read_header(self, given: dict[str, Any]) -> None:
        self.header = Header.from_attributes(given, self.path)

    def __iter__(self) -> Iterator[Trajectory]:
        """All trajectories."""
        return (self.trajectory(i) for i in range(len(self)))

    def __getitem__(self, i: int) -> Trajectory:
        """`trajectory(i)`; negative numbers count from the end."""
        number = operator.index(i)
        return self.trajectory(number + len(self) if number < 0 else number)

    def trajectory(self, i: int) -> Trajectory:
        """One of them, read whole.

        Raises:
            IndexError: there are not so many.
            DemoError: it is damaged.
        """
        arrays = {name: self.array(i, name) for name in ARRAYS}
        with reading(self.path, f"trajectory {i}"):
            header = self.header
            recording = Recording(
                **arrays, state_columns=header.state_columns, key_frame_columns=header.key_frame_columns
            )
            widths = {"states": header.state_columns.width, "key_frames": header.key_frame_columns.width}
            for name, width in widths.items():
                if arrays[name].shape[1:] != (width,):
                    raise ValueError(f"{name} are {arrays[name].shape}, the header has {width} columns")
            about = self._file[f"traj_{i}"].attrs
            return Trajectory(
                header, f"{self.path.name}, trajectory {i}", str(about["target"]), int(about["level"]), recording
            )

    def array(self, i: int, name: str) -> np.ndarray:
        """One array of a trajectory, without the others; names as in `Recording`.

        Raises:
            IndexError: there are not so many trajectories.
            DemoError: it is damaged.
        """
        if not 0 <= i < len(self):
            raise IndexError(f"{str(self.path)!r} has the trajectories 0 to {len(self) - 1}, not {i}")
        with reading(self.path, f"{name} of trajectory {i}"):
            found: np.ndarray = self._file[f"traj_{i}"][name][()]
            return found

    @cached_property
    def attempts(self) -> np.ndarray:
        """(N,) all attempts that were made, in order; see `writing.ATTEMPT_TYPE`.

        Raises:
            DemoError: they are damaged.
        """
        with reading(self.path, "its attempts"):
            found: np.ndarray = self._file[ATTEMPTS][()]
            if found.dtype != ATTEMPT_TYPE or found.ndim != 1:
                raise ValueError(f"they are {found.dtype}, not {ATTEMPT_TYPE}")
            targets, numbers = found["target"], found["trajectory"]
            if len(found) and not 0 <= targets.min() <= targets.max() < len(self.header.targets):
                raise ValueError(f"the header has {len(self.header.targets)} targets")
            if sorted(numbers[numbers >= 0]) != list(range(len(self))):
                raise ValueError(f"they do not list the {len(self)} trajectories")
            return found

    def check_settings(self, wanted: Settings) -> None:
        """See whether it was made with these settings, its manifest's say.

        Raises:
            DemoError: it was not.
        """
        differences = self.header.settings.differences(wanted)
        if differences:
            raise DemoError(
                f"{str(self.path)!r} was made with other settings than its manifest says: {differences} "
                "(there: the file, here: the manifest); one of the two was changed"
            )

    def load_object(self, given: ArticulatedObject | None = None) -> ArticulatedObject:
        """The object, which must be the one that was demonstrated with.

        Args:
            given: where no name leads to it: an imported one, say, or one's own.

        Raises:
            DemoError: this version's, or this catalogue's, is another one; or there is none.
        """
        wanted = self.header.content_hash
        try:
            found = load_object(self.header.facts["name"]) if given is None else given
        except ArtiSkillError as error:
            raise DemoError(f"{str(self.path)!r}: cannot load its object: {error}") from error
        if found.content_hash != wanted:
            raise DemoError(
                f"{str(self.path)!r} was made with another {self.header.object!r}: its content hash was {wanted}, "
                f"now it is {found.content_hash}"
            )
        return found

    def make_env(
        self, obs_mode: str = "state", obj: ArticulatedObject | None = None, **options: Any
    ) -> ManipulationEnv:
        """An environment of its task, control mode and object.

        Args:
            obs_mode: as `ManipulationEnv` takes it.
            obj: as in `load_object`.
            options: further arguments of `ManipulationEnv`.

        Raises:
            DemoError: its object or task has changed.
        """
        obj = self.load_object(obj)
        self.header.settings.make_task()
        return self.header.settings.make_env([obj], obs_mode, **options)
