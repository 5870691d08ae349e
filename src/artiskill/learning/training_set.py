"""`TrainingSet`: the steps of one task's demonstrations in a folder, read at random without being loaded.

`artiskill.learning.building` makes it. Reading needs neither the engine nor HDF5.

| file | content |
|---|---|
| `manifest.json` | `SetManifest` |
| `frames.bin` | a record per observation, see `ObservationLayout`; T + 1 per trajectory, one after the other |
| `steps.npy` | a row per step: `frame` that was seen (what is seen next is frame + 1), `trajectory`, `action`, `reward`, `terminated`, `disturbed` |
| `trajectories.npy` | a row per trajectory: `object` and `target` (indices of the manifest's), `level`, `first_step`, `steps` |
"""  # noqa: E501 - a table

import hashlib
import json
import os
import weakref
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.config import from_mapping, to_mapping
from artiskill.errors import ConfigError, DemoError, shown
from artiskill.files import check_path, file_sha256, is_file, parse_json, read_bytes
from artiskill.learning.batch import Sizes, Statistics
from artiskill.learning.observation import MOST_MASKS, ObservationLayout
from artiskill.tasks.registry import as_overrides

FORMAT, VERSION = "artiskill-training-set", 1
MANIFEST, FRAMES, STEPS, TRAJECTORIES = "manifest.json", "frames.bin", "steps.npy", "trajectories.npy"
TRAJECTORY_TYPE = np.dtype(
    [("object", "<i4"), ("target", "<i4"), ("level", "<i8"), ("first_step", "<i8"), ("steps", "<i4")]
)


def step_type(action: int) -> np.dtype[Any]:
    """Return the type of a row of `steps.npy` with actions of so many numbers."""
    return np.dtype(
        [
            ("frame", "<i8"),
            ("trajectory", "<i4"),
            ("action", "<f4", (action,)),
            ("reward", "<f4"),
            ("terminated", "?"),
            ("disturbed", "?"),
        ]
    )


@dataclass(frozen=True)
class SetFile:
    """A file of a training set."""

    bytes: int
    sha256: str


@dataclass(frozen=True)
class SetManifest:
    """What a training set holds and was made from."""

    task: str
    control_mode: str  # of the actions
    sampling: dict[str, Any]  # of the observations, acting too: num_points, method, frame, settings of the method
    sizes: Sizes
    objects: tuple[str, ...]  # ids
    targets: tuple[str, ...]  # names of links
    trajectories: int  # number of them
    steps: int
    frames: int
    point_mean: tuple[float, ...]  # these five: see `Statistics`
    point_std: tuple[float, ...]
    agent_mean: tuple[float, ...]
    agent_std: tuple[float, ...]
    action_std: tuple[float, ...]
    options: dict[str, Any]  # what else it was made with
    settings: dict[str, Any]  # of the training files, see `ReplaySettings`
    sources: dict[str, str]  # SHA-256 of the demonstrations, or of the training files, by name
    files: dict[str, SetFile]  # of the set

    @property
    def statistics(self) -> Statistics:
        """Normalisation."""
        return Statistics(
            *(np.array(one, dtype=np.float32) for one in (self.point_mean, self.point_std)),
            *(np.array(one, dtype=np.float32) for one in (self.agent_mean, self.agent_std, self.action_std)),
        )

    @property
    def overrides(self) -> dict[str, Any]:
        """The task's configuration as `make_task` takes it."""
        return as_overrides(self.settings["source"]["config"]) | self.settings["seen"]


def manifest_text(manifest: SetManifest) -> str:
    """Return the text of a manifest's file."""
    values = {"format": FORMAT, "version": VERSION, **to_mapping(manifest)}
    return json.dumps(values | {"checksum": _checksum(values)}, indent=1) + "\n"


def _checksum(values: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


def read_set_manifest(folder: Path) -> SetManifest:
    """Read the manifest of a training set.

    Raises:
        DemoError: there is none, or it is damaged, edited, foreign or of another version.
    """
    path = folder / MANIFEST
    try:
        given = parse_json(read_bytes(path))
    except (FileNotFoundError, NotADirectoryError) as error:
        raise DemoError(f"{str(folder)!r} is no training set: it has no {MANIFEST}") from error
    except (OSError, ValueError) as error:
        raise DemoError(f"{str(path)!r} is damaged: {getattr(error, 'strerror', None) or error}") from error
    if not isinstance(given, dict) or given.get("format") != FORMAT:
        found = given.get("format") if isinstance(given, dict) else None
        raise DemoError(
            f"{str(folder)!r} is no training set: its manifest's format is {shown(found)}, not {FORMAT!r}"
        )
    if given.get("version") != VERSION:
        raise DemoError(
            f"{str(folder)!r} is a training set of version {shown(given.get('version'))}; this version of "
            f"artiskill reads {VERSION}: use the version of artiskill that wrote it, or make it anew"
        )
    if given.pop("checksum", None) != _checksum(given):
        raise DemoError(f"{str(path)!r} was edited or damaged since it was written: make the training set anew")
    try:
        return from_mapping(
            SetManifest, {k: v for k, v in given.items() if k not in ("format", "version")}, str(path)
        )
    except ConfigError as error:
        raise DemoError(f"a damaged manifest: {error}") from error


class TrainingSet:
    """A folder with the steps of demonstrations, open for reading; threads and processes may share it.

    Args:
        folder: of the set.
        check: compare its files with the manifest's checksums first.

    Attributes:
        folder: of the set.
        manifest: what it holds, and was made from.
        sizes: of arrays that a network is built for.
        statistics: normalisation.
        layout: of a record of `frames.bin`.
        steps: (steps,) rows, mapped into memory; see the module.
        trajectories: (trajectories,) rows.

    Raises:
        DemoError: the folder holds no training set, or one that is damaged, truncated or of another version.
    """

    def __init__(self, folder: Path | str, check: bool = False) -> None:
        try:
            self.folder = check_path(folder)
        except OSError as error:
            raise DemoError(f"{shown(str(folder))} is not a path: {error.strerror}") from error
        self.manifest = read_set_manifest(self.folder)
        self.sizes, self.statistics = self.manifest.sizes, self.manifest.statistics
        self.layout = ObservationLayout(self.sizes.points, self.sizes.masks, self.sizes.agent)
        _check_sizes(self.manifest, self.layout, self.folder)
        for name, listed in self.manifest.files.items():
            _check_set_file(self.folder / name, listed, check)
        self.steps = self._load(STEPS, step_type(self.sizes.action), self.manifest.steps)
        self.trajectories = self._load(TRAJECTORIES, TRAJECTORY_TYPE, self.manifest.trajectories)
        self._handle = _open_for_random_reads(self.folder / FRAMES)
        self._close = weakref.finalize(self, os.close, self._handle)

    def __len__(self) -> int:
        """Return the number of steps."""
        return self.manifest.steps

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the path: another process opens the set itself."""
        return type(self), (self.folder,)

    @cached_property
    def groups(self) -> tuple[tuple[str, str], ...]:
        """Pairs of object and target that occur, sorted."""
        return tuple((self.manifest.objects[o], self.manifest.targets[t]) for o, t in self._group_rows[0])

    @cached_property
    def group_of_trajectory(self) -> np.ndarray:
        """(trajectories,) indices of `groups`."""
        return self._group_rows[1]

    @cached_property
    def _group_rows(self) -> tuple[np.ndarray, np.ndarray]:
        pairs = np.stack([self.trajectories["object"], self.trajectories["target"]], axis=1)
        found, inverse = np.unique(pairs, axis=0, return_inverse=True)
        return found, inverse.reshape(-1)

    def read(self, frames: np.ndarray, following: int = 0) -> np.ndarray:
        """Read observations, in one go each.

        Args:
            frames: (B,) indices.
            following: also so many that follow each.

        Returns:
            (B, 1 + following) records, see `layout`.

        Raises:
            DemoError: the file is shorter than it was, or cannot be read.
        """
        size = self.layout.dtype.itemsize
        records = np.empty((len(frames), 1 + following), dtype=self.layout.dtype)
        target = records.view(np.uint8).reshape(-1).data
        length = size * (1 + following)
        for row in np.argsort(frames, kind="stable").tolist():
            self._read_into(target[row * length : (row + 1) * length], int(frames[row]) * size)
        return records

    def _read_into(self, target: memoryview, offset: int) -> None:
        try:
            found = os.preadv(self._handle, [target], offset)
        except OSError as error:
            raise DemoError(f"cannot read {str(self.folder / FRAMES)!r}: {error.strerror}") from error
        if found != len(target):
            raise DemoError(f"{str(self.folder / FRAMES)!r} was truncated while it was read")

    def require(
        self,
        task: str | None = None,
        control_mode: str | None = None,
        num_points: int | None = None,
        frame: str | None = None,
    ) -> None:
        """Raise `DemoError` unless the set is of this task, control mode, number of points, frame; None: any."""
        held = self.manifest
        pairs = (
            ("task", task, held.task),
            ("control mode", control_mode, held.control_mode),
            ("number of points", num_points, self.sizes.points),
            ("frame", frame, held.sampling["frame"]),
        )
        for what, wanted, found in pairs:
            if wanted is not None and wanted != found:
                raise DemoError(f"the training set {str(self.folder)!r} is of {what} {found}, not {shown(wanted)}")

    def _load(self, name: str, dtype: np.dtype[Any], count: int) -> np.ndarray:
        path = self.folder / name
        try:
            found: np.ndarray = np.load(path, mmap_mode="r" if count else None)
        except (OSError, ValueError) as error:
            raise DemoError(f"{str(path)!r} is damaged: {error}") from error
        if found.dtype != dtype or found.shape != (count,):
            raise DemoError(f"{str(path)!r} does not hold what the manifest says; make the training set anew")
        return found


def _open_for_random_reads(path: Path) -> int:
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    if hasattr(os, "posix_fadvise"):
        os.posix_fadvise(handle, 0, 0, os.POSIX_FADV_RANDOM)  # the neighbours of a record are not wanted
    return handle


def _check_sizes(manifest: SetManifest, layout: ObservationLayout, folder: Path) -> None:
    """Raise `DemoError` unless a manifest lists the files of a set, and enough bytes for its frames."""
    try:
        wanted = manifest.frames * layout.dtype.itemsize
        agrees = set(manifest.files) == {FRAMES, STEPS, TRAJECTORIES} and manifest.files[FRAMES].bytes == wanted
    except (ValueError, OverflowError):  # sizes that no array has
        agrees = False
    if not agrees or not 0 <= manifest.sizes.masks <= MOST_MASKS:
        raise DemoError(f"{str(folder / MANIFEST)!r} contradicts itself: make the training set anew")


def _check_set_file(path: Path, listed: SetFile, checksum: bool) -> None:
    if not is_file(path):
        raise DemoError(f"{str(path)!r} is missing: the training set was not copied whole")
    found = path.stat().st_size
    if found != listed.bytes:
        raise DemoError(
            f"{str(path)!r} has {found} bytes, the manifest says {listed.bytes}: it was truncated or changed"
        )
    if checksum and file_sha256(path) != listed.sha256:
        raise DemoError(f"{str(path)!r} was changed or damaged since it was written: its SHA-256 is another one")


def is_training_set(folder: Path | str) -> bool:
    """Whether a folder's manifest is that of a training set, whatever its state."""
    try:
        given = parse_json(read_bytes(Path(folder) / MANIFEST))
    except (OSError, ValueError):
        return False
    return isinstance(given, dict) and given.get("format") == FORMAT
