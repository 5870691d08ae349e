"""Training files: how they are made (`ReplaySettings`), their manifest, and reading (`TrainingFiles`)."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import list_objects, load_object
from artiskill.config import check, differing, from_mapping, to_mapping
from artiskill.demos.demos import FileFolder, FolderManifest, check_file
from artiskill.demos.file_format import TRAINING, FileFormat
from artiskill.demos.hdf5 import (
    MOST_FRAMES_BYTES,
    TRAJECTORY,
    Form,
    TrajectoryFile,
    check_finite,
    check_forms,
    reading,
)
from artiskill.demos.replay_episode import STATE, OutcomeCounts, leaf_spaces
from artiskill.demos.settings import MOST_COMPRESSION, Settings
from artiskill.envs.control import CONTROL_MODES
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.options import OBSERVATION_MODES
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ArtiSkillError, ConfigError, DemoError, UnknownNameError, check_name, shown
from artiskill.files import parse_json
from artiskill.tasks.levels import check_level
from artiskill.tasks.point_shares import point_shares, shared_out
from artiskill.tasks.registry import SEEN_SECTIONS, make_task
from artiskill.tasks.task import Task

SIMULATE, RESTORE = "simulate", "restore"
SHARES = "shares"  # a method of choosing points
WAYS: tuple[str, ...] = (SIMULATE, RESTORE)
_SEEN = tuple(f"{section}." for section in SEEN_SECTIONS)
_MOST_NAMED = 3  # differences


def make_sampling(
    points: int | None,
    method: str = "maniskill",
    frame: str = "world",
    settings: Mapping[str, Any] | None = None,
    task: Task | None = None,
) -> Sampling | None:
    """Return the sampling of so many points; None for the full cloud, which is in the world's frame.

    Args:
        points: in all.
        method: see `PointCloudDownsample`.
        frame: of the points.
        settings: of the method.
        task: whose points are shared out as `point_shares` says, where the method is `shares` and has no settings.

    Raises:
        UnknownNameError: no such method or frame.
        ConfigError: an illegal number or setting, or a method or frame for the full cloud.
    """
    if points is not None:
        values = dict(settings or {})
        if method == SHARES and task is not None and not values:
            values = {"shares": shared_out(points, point_shares(task.name, task.mask_names))}
        return Sampling(points, method, frame, values)
    check(method == "maniskill", f"the full cloud has every point; method {method!r} is for fewer points")
    check(frame == "world", f"the full cloud is in the world's frame; {frame!r} is for fewer points")
    return None


@dataclass(frozen=True)
class ReplaySettings:
    """How training files are made: all that they depend on besides the demonstrations."""

    source: Settings  # settings of the demonstrations
    obs_mode: str  # `state`, `pointcloud` or `rgbd`
    control_mode: str  # of the actions
    way: str  # `simulate`, play the actions once more, or `restore`, restore every recorded state
    sampling: Sampling | None  # of point clouds; None for the full ones, and in other modes
    seen: dict[str, Any]  # other values of the task's sections `cameras`, `render` and `state`
    count: int | None  # trajectories of each object, evenly of its targets; None for all
    keep_failures: bool  # keep what is not solved, too
    compression: int  # level of gzip
    versions: dict[str, str]  # of the package, the engine and the numeric libraries

    def __post_init__(self) -> None:
        check_name("observation mode", self.obs_mode, OBSERVATION_MODES)
        check_name("control mode", self.control_mode, CONTROL_MODES)
        check_name("way of replaying", self.way, WAYS)
        is_cloud = self.obs_mode == "pointcloud"
        check(self.sampling is None or is_cloud, f"points are of obs_mode pointcloud, not of {self.obs_mode}")
        check(self.count is None or self.count >= 1, f"the count must be at least 1, not {self.count}")
        is_legal = 0 <= self.compression <= MOST_COMPRESSION
        check(is_legal, f"the compression must lie in [0, {MOST_COMPRESSION}], not {self.compression}")
        for key in self.seen:
            if not key.startswith(_SEEN):
                seen = ", ".join(f"{name}*" for name in _SEEN)
                raise ConfigError(
                    f"a replay can change what is seen ({seen}), not {shown(key)}: "
                    "the physics, the rewards and what counts as solved are those of the demonstrations"
                )

    @property
    def overrides(self) -> dict[str, Any]:
        """The task's configuration as `make_task` takes it."""
        return self.source.overrides | self.seen

    def make_task(self) -> Task:
        """Return the demonstrations' task, seen as these settings say.

        Raises:
            DemoError: this version of the package makes another task of the same configuration.
            ConfigError: an illegal value of what is seen.
        """
        self.source.make_task()
        return make_task(self.source.task, self.overrides)

    def make_env(self, obj: ArticulatedObject) -> ManipulationEnv:
        """Return an environment that observes and is controlled as the training files are.

        Raises:
            ConfigError: an illegal value of what is seen.
        """
        env = ManipulationEnv(
            self.source.task,
            [obj],
            obs_mode=self.obs_mode,
            control_mode=self.control_mode,
            config=self.overrides,
        )
        if self.sampling is not None:  # the wrapper changes the environment itself, and is not needed afterwards
            self.sampling.wrap(env)
        return env

    def differences(self, other: "ReplaySettings") -> str:
        """Return what differs in other settings, as text: the task, or the first things; empty if nothing does."""
        if self.source.task != other.source.task:
            return f"task {self.source.task} there, {other.source.task} here"
        found = differing(to_mapping(self), to_mapping(other))
        more = [f"and {len(found) - _MOST_NAMED} more"] if len(found) > _MOST_NAMED else []
        return "; ".join(found[:_MOST_NAMED] + more)


@dataclass(frozen=True)
class TrainingEntry:
    """One file of a folder of training files."""

    object: str  # whose trajectories it holds
    name: str  # of the object, as `load_object` takes it
    content_hash: str  # of the object
    source_sha256: str  # of the file of demonstrations
    sha256: str  # of the file
    bytes: int  # of the file
    trajectories: int  # that it holds
    frames: int  # observations in all
    counts: OutcomeCounts  # what came of the trajectories that were replayed


@dataclass(frozen=True)
class TrainingManifest(FolderManifest):
    """What a folder of training files holds."""

    FORMAT: ClassVar[FileFormat] = TRAINING

    settings: ReplaySettings
    files: dict[str, TrainingEntry] = field(default_factory=dict)


class TrainingFile(TrajectoryFile):
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
        TRAINING.check(given.get("format"), given.get("schema_version"), self.path)
        self.object, self.name = str(given["object"]), str(given["name"])
        self.settings = from_mapping(ReplaySettings, parse_json(given["settings"]), str(self.path))
        self.groups: list[Any] = [self._file[f"{TRAJECTORY}{i}"] for i in range(len(self))]

    def array(self, i: int, path: str) -> np.ndarray:
        """Read one array of a trajectory: `actions`, or `obs/pointcloud/xyz`, say.

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
        """Raise `DemoError` unless all trajectories have the arrays of training files, finite, and fit the spaces.

        Args:
            spaces: of observations and of actions.
        """
        for i, group in enumerate(self.groups):
            with reading(self.path, f"trajectory {i}"):
                _check_trajectory(group, spaces)


def _array_names(group: Any, prefix: str = "") -> list[str]:
    """Return the paths of all arrays in a group and those below."""
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


class TrainingFiles(FileFolder):
    """A folder of training files with a manifest; see `FileFolder`."""

    MANIFEST_CLASS = TrainingManifest
    manifest: TrainingManifest

    @property
    def settings(self) -> ReplaySettings:
        """How the files were made."""
        return self.manifest.settings

    def files(self, check: bool = False) -> Iterator[TrainingFile]:
        """Yield all files, one after the other; each is closed before the next is opened.

        Args:
            check: compare each with the manifest's checksum, and its arrays with what they should be.

        Raises:
            DemoError: one is damaged, or differs from its checksum.
        """
        for name, entry in self.manifest.files.items():
            if check:
                check_file(self.folder, name, entry, TRAINING)
            with TrainingFile(self.folder / name) as file:
                if check:
                    file.check(self.spaces)
                yield file

    @cached_property
    def spaces(self) -> tuple[Any, Any]:
        """Spaces of observations and of actions, as the environment has them; the same for every object."""
        try:
            obj = load_object(list_objects(task=self.settings.source.task)[0])
        except ArtiSkillError as error:
            raise DemoError(f"{str(self.folder)!r}: cannot make its environment: {error}") from error
        env = self.settings.make_env(obj)
        return env.observation_space, env.action_space
