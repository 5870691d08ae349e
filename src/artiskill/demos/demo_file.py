"""`DemoFile`: one file of demonstrations, open for reading."""

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import is_nameable, load_object
from artiskill.assets.names import partnet_id
from artiskill.demos.arrays import Form, check_finite, check_forms
from artiskill.demos.hdf5 import reading
from artiskill.demos.header import Header
from artiskill.demos.manifest import FileEntry
from artiskill.demos.open_file import TRAJECTORY, OpenFile, whole_number
from artiskill.demos.recording import ARRAYS, Recording, key_frame_steps
from artiskill.demos.settings import Settings
from artiskill.demos.trajectory import Trajectory
from artiskill.demos.writing import ATTEMPT_TYPE, ATTEMPTS
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ArtiSkillError, DemoError, check_name, shown
from artiskill.tasks.levels import check_level

_ADVICE = "its folder may be handed over: `--objects FOLDER` of verify and replay, `--object FOLDER` of pictures"


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
        number = whole_number(i, "a trajectory's number")
        return self.trajectory(number + len(self) if -len(self) <= number < 0 else number)

    def trajectory(self, i: int) -> Trajectory:
        """One of them, read whole.

        Raises:
            IndexError: there are not so many.
            TypeError: no whole number.
            DemoError: it is damaged, or the file has been closed.
        """
        i = self.checked(i)
        arrays = {name: self.array(i, name) for name in ARRAYS}
        with reading(self.path, f"trajectory {i}"):
            header = self.header
            _check_arrays(arrays, header)
            about = self._file[f"{TRAJECTORY}{i}"].attrs
            target, level = str(about["target"]), check_level(about["level"])
            check_name("target", target, tuple(count.target for count in header.targets))
            recording = Recording(
                **arrays, state_columns=header.state_columns, key_frame_columns=header.key_frame_columns
            )
            if bool(about["success"]) != recording.success:
                raise ValueError(f"its attribute says success {about['success']}, its flags {recording.success}")
            return Trajectory(header, f"{self.path.name}, trajectory {i}", target, level, recording)

    def array(self, i: int, name: str) -> np.ndarray:
        """One array of a trajectory, without the others; names as in `Recording`.

        Raises:
            IndexError: there are not so many trajectories.
            TypeError: no whole number.
            DemoError: it is damaged, or the file has been closed.
        """
        i = self.checked(i)
        with reading(self.path, f"{name} of trajectory {i}"):
            found: np.ndarray = self._file[f"{TRAJECTORY}{i}"][name][()]
            return found

    @cached_property
    def attempts(self) -> np.ndarray:
        """(N,) all attempts that were made, in order; see `writing.ATTEMPT_TYPE`.

        Raises:
            DemoError: they are damaged, or the file has been closed.
        """
        self.check_open()
        with reading(self.path, "its attempts"):
            found: np.ndarray = self._file[ATTEMPTS][()]
            if found.dtype != ATTEMPT_TYPE or found.ndim != 1:
                raise ValueError(f"they are {found.dtype}, not {ATTEMPT_TYPE}")
            targets, numbers = found["target"], found["trajectory"]
            if len(found) and not 0 <= targets.min() <= targets.max() < len(self.header.targets):
                raise ValueError(f"the header has {len(self.header.targets)} targets")
            if sorted(numbers[numbers >= 0]) != list(range(len(self))):
                raise ValueError(f"they do not list the {len(self)} trajectories")
            if (found["success"] & (numbers < 0)).any():
                raise ValueError("one that was solved has no trajectory")
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

    def check_listed(self, settings: Settings, entry: FileEntry) -> None:
        """See whether it is what its manifest says.

        Args:
            settings: of the manifest.
            entry: of this file.

        Raises:
            DemoError: it is of other settings, or has another object, or other counts.
        """
        self.check_settings(settings)
        header = self.header
        listed = (entry.object, entry.content_hash, entry.targets, entry.trajectories)
        if listed != (header.object, header.content_hash, header.targets, len(self)):
            raise DemoError(f"{str(self.path)!r} holds something else than the manifest says")

    def check_counts(self) -> None:
        """See whether the table of attempts has as many as the header says.

        Raises:
            DemoError: it has not, or is damaged.
        """
        for k, count in enumerate(self.header.targets):
            rows = self.attempts[self.attempts["target"] == k]
            if (len(rows), int(rows["success"].sum())) != (count.attempts, count.successes):
                raise DemoError(f"{str(self.path)!r}: the attempts at {count.target} do not add up")

    def load_object(self, given: str | ArticulatedObject | None = None) -> ArticulatedObject:
        """The object, which must be the one that was demonstrated with.

        Args:
            given: where its own name does not lead to it: an imported one, say, or the name of its folder.

        Raises:
            DemoError: this version's, or this catalogue's, is another one; or there is none.
        """
        wanted = self.header.content_hash
        try:
            found = self._named_object() if given is None else given
            found = load_object(found) if isinstance(found, str) else found
        except ArtiSkillError as error:
            raise DemoError(f"{str(self.path)!r}: cannot load its object: {error} ({_ADVICE})") from error
        if found.content_hash != wanted:
            raise DemoError(
                f"{str(self.path)!r} was made with another {self.header.object!r}: its content hash was {wanted}, "
                f"now it is {found.content_hash}"
            )
        return found

    def _named_object(self) -> str:
        """The name that the file says its object has: never a path, which is for the user to choose."""
        name: str = self.header.facts["name"]
        if is_nameable(name) or partnet_id(name) is not None:
            return name
        raise DemoError(f"its file calls it {shown(name)}, which is no name that a file may choose")

    def make_env(
        self, obs_mode: str = "state", obj: str | ArticulatedObject | None = None, **options: Any
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


def _check_arrays(arrays: dict[str, np.ndarray], header: Header) -> None:
    """See whether a trajectory's arrays fit the header and one another.

    Raises:
        ValueError: they do not, or hold numbers that are not finite.
    """
    steps, columns = len(arrays["actions"]), header.state_columns
    drives = columns.slices["robot_qpos"]
    frames = len(key_frame_steps(steps, header.settings.store.key_frame_steps))
    wanted: dict[str, Form] = {
        "actions": ((steps, drives.stop - drives.start), np.float32),  # a number for each of the robot's joints
        "disturbed": ((steps,), np.bool_),
        "rewards": ((steps,), np.float64),
        "flags": ((steps, len(header.flag_names)), np.bool_),
        "digests": ((steps + 1,), np.uint64),
        "states": ((steps + 1, columns.width), np.float32),
        "key_frames": ((frames, header.key_frame_columns.width), np.float64),
    }
    check_forms(arrays, wanted)
    check_finite({name: arrays[name] for name in ("actions", "rewards", "states", "key_frames")})
