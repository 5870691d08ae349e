"""`TrainingFile` and `TrainingFiles`: training files, open for reading."""

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import list_objects, load_object
from artiskill.config import from_mapping
from artiskill.demos.arrays import Form, check_finite, check_forms
from artiskill.demos.hdf5 import reading
from artiskill.demos.hdf5_content import MOST_FRAMES_BYTES
from artiskill.demos.header import check_format
from artiskill.demos.json_files import checked_path
from artiskill.demos.open_file import TRAJECTORY, OpenFile
from artiskill.demos.replay.layout import STATE, leaf_spaces
from artiskill.demos.replay.manifest import (
    FORMAT,
    SCHEMA_VERSION,
    WHAT,
    TrainingManifest,
    check_training_file,
    read_training_manifest,
)
from artiskill.demos.replay.settings import ReplaySettings
from artiskill.errors import ArtiSkillError, DemoError, UnknownNameError
from artiskill.files import is_file, parse_json
from artiskill.tasks.levels import check_level


class TrainingFile(OpenFile):
    """The training file of one object; a context manager that closes it.

    Args:
        path: of the file.

    Attributes:
        path: of the file.
        object: id.
        name: of the object, as `load_object` takes it.
        settings: how it was made.
        groups: the trajectories, as h5py groups; docs/demonstrations.md says what is in them.

    Raises:
        DemoError: there is no such file, or it is damaged, foreign or of another version.
        MissingExtraError: h5py is not installed.
    """

    def __init__(self, path: Path | str) -> None:
        super().__init__(path, "its attributes", MOST_FRAMES_BYTES)

    def _read_header(self, given: dict[str, Any]) -> None:
        check_format(given.get("format"), given.get("schema_version"), self.path, FORMAT, SCHEMA_VERSION, WHAT)
        self.object, self.name = str(given["object"]), str(given["name"])
        self.settings = from_mapping(ReplaySettings, parse_json(given["settings"]), str(self.path))
        self.groups: list[Any] = [self._file[f"{TRAJECTORY}{i}"] for i in range(len(self))]

    def array(self, i: int, path: str) -> np.ndarray:
        """One array of a trajectory: `actions`, or `obs/pointcloud/xyz`, say.

        Raises:
            IndexError: there are not so many trajectories.
            TypeError: no whole number.
            UnknownNameError: there is no such array.
            DemoError: it is damaged, or the file has been closed.
        """
        i = self.checked(i)
        with reading(self.path, f"trajectory {i}"):
            names = _array_names(self.groups[i])
        if path not in names:
            raise UnknownNameError("array", path, names, f"(of {str(self.path)!r})")
        with reading(self.path, f"{path} of trajectory {i}"):
            found: np.ndarray = self.groups[i][path][()]
            return found

    def check(self, spaces: tuple[Any, Any]) -> None:
        """See whether all trajectories have what training files have, in shape and type, and fit the spaces.

        Args:
            spaces: of observations and of actions.

        Raises:
            DemoError: one does not, or numbers that are not finite are in it.
        """
        for i, group in enumerate(self.groups):
            with reading(self.path, f"trajectory {i}"):
                _check_trajectory(group, spaces)


def _array_names(group: Any, prefix: str = "") -> list[str]:
    """Paths of all arrays in a group and those below."""
    found: list[str] = []
    for name, item in group.items():
        below = hasattr(item, "items")
        found += _array_names(item, f"{prefix}{name}/") if below else [prefix + name]
    return found


def _check_trajectory(group: Any, spaces: tuple[Any, Any]) -> None:
    steps = len(group["actions"])
    if not steps:
        raise ValueError("it has no steps")
    wanted: dict[str, Form] = {
        "actions": ((steps, *spaces[1].shape), np.float32),
        "disturbed": ((steps,), np.bool_),
        "rewards": ((steps,), np.float64),
        "dones": ((steps,), np.bool_),
        "success": ((steps,), np.bool_),
    }
    leaves = leaf_spaces(spaces[0])
    wanted |= {f"obs/{path}": ((steps + 1, *leaf.shape), leaf.dtype) for path, leaf in leaves.items()}
    check_forms(group, wanted)
    check_finite({name: group[name][()] for name in ("actions", "rewards", f"obs/{STATE}")})
    check_level(group.attrs["level"])
    if not isinstance(group.attrs["target"], str):
        raise ValueError(f"its target is {group.attrs['target']!r}")


class TrainingFiles:
    """A folder of training files.

    Args:
        path: of the folder.
        check: compare every file with the manifest's checksum first.

    Attributes:
        folder: of the files.
        manifest: how they were made, and what they hold.

    Raises:
        DemoError: the folder holds no training files, or one is missing or differs from its checksum.
    """

    def __init__(self, path: Path | str, check: bool = False) -> None:
        self.folder = checked_path(path)
        self.manifest: TrainingManifest = read_training_manifest(self.folder)
        for name, entry in self.manifest.files.items():
            if check:
                check_training_file(self.folder, name, entry)
            elif not is_file(self.folder / name):
                raise DemoError(f"{str(self.folder / name)!r} is missing: the manifest lists it")

    @property
    def settings(self) -> ReplaySettings:
        """How the files were made."""
        return self.manifest.settings

    def __len__(self) -> int:
        """How many trajectories there are."""
        return sum(entry.trajectories for entry in self.manifest.files.values())

    def files(self, check: bool = False) -> Iterator[TrainingFile]:
        """All files, one after the other; each is closed before the next is opened.

        Args:
            check: compare each with the manifest's checksum, and its arrays with what they should be.

        Raises:
            DemoError: one is damaged, or differs from its checksum.
        """
        for name, entry in self.manifest.files.items():
            if check:
                check_training_file(self.folder, name, entry)
            with TrainingFile(self.folder / name) as file:
                if check:
                    file.check(self.spaces)
                yield file

    @cached_property
    def spaces(self) -> tuple[Any, Any]:
        """Spaces of observations and of actions, as the environment has them."""
        env = self.settings.make_env(self._any_object())
        return env.observation_space, env.action_space

    def _any_object(self) -> ArticulatedObject:
        """One of the task's objects: the spaces do not depend on it."""
        try:
            return load_object(list_objects(task=self.settings.source.task)[0])
        except ArtiSkillError as error:
            raise DemoError(f"{str(self.folder)!r}: cannot make its environment: {error}") from error
