"""`build_training_set`: training files, or demonstrations, to a training set, a chunk of frames at a time.

Everything is written to `.unfinished` in the set's folder; at the end the files are moved to their places, the
manifest last, so a set is whole or not there. Reading training files again is cheap, so an interrupted build of
them starts anew; what was replayed of demonstrations is kept.
"""

import os
import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from artiskill.demos.demos import check_file
from artiskill.demos.file_format import TRAINING
from artiskill.demos.hdf5 import check_finite, check_forms, reading
from artiskill.demos.training_file import TrainingFile, TrainingFiles
from artiskill.errors import DemoError
from artiskill.files import atomic_write, file_sha256, lock_folder, output_path
from artiskill.learning.batch import Sizes
from artiskill.learning.observation import ObservationLayout
from artiskill.learning.set_sources import OnProgress, SetOptions, SetSource, Thinner, find_source, sampling_values
from artiskill.learning.training_set import (
    FRAMES,
    MANIFEST,
    STEPS,
    TRAJECTORIES,
    TRAJECTORY_TYPE,
    SetFile,
    SetManifest,
    TrainingSet,
    manifest_text,
    step_type,
)

_UNFINISHED, _REPLAYED = ".unfinished", "replayed"
_LEAST_ACTION_STD = 0.02  # of full speed: errors of a joint that hardly moves must not count for everything
_CHUNK_BYTES = 64_000_000  # of clouds that are in memory at once
_LEAST_STD = 1e-6
_CLOUD = ("xyz", "rgb", "seg")


def build_training_set(
    source: Path | str,
    folder: Path | str,
    options: SetOptions | None = None,
    task: str | None = None,
    workers: int = 1,
    on_progress: OnProgress | None = None,
) -> TrainingSet:
    """Make a training set, or open the one that is there if it was made from the same.

    Failures are left out. The source and the options determine its bytes.

    Args:
        source: a folder of training files (mode `pointcloud`), or of demonstrations, which are replayed first.
        folder: of the set.
        options: how it is made.
        task: that the source must be of; None for any.
        workers: processes that replay.
        on_progress: called after every trajectory.

    Raises:
        ConfigError: an illegal option, more points than there are, or another process is at the folder.
        DemoError: the source is damaged, changed, or of another task or mode; the folder holds something else, or
            cannot be written to.
        UnknownNameError: the source has no such object.
    """
    folder = output_path(folder)
    origin = find_source(Path(source), options or SetOptions())
    origin.check_task(task)
    with lock_folder(folder, "build of a training set"):
        if not (folder / MANIFEST).exists():
            files = origin.training_files(folder / _UNFINISHED / _REPLAYED, workers, on_progress)
            try:
                _Builder(folder, origin, files).build(on_progress)
            except OSError as error:
                raise DemoError(f"cannot write to {str(folder)!r}: {error.strerror or error}") from error
        origin.check_same(folder)
        shutil.rmtree(folder / _UNFINISHED, ignore_errors=True)
        return TrainingSet(folder)


class Moments:
    """Mean and standard deviation of rows that come in parts (Chan, Golub and LeVeque 1979)."""

    def __init__(self) -> None:
        self._count = 0
        self._mean: Any = 0.0
        self._squares: Any = 0.0  # sum of squared differences from the mean
        self._lowest: Any = np.inf
        self._highest: Any = -np.inf

    def add(self, rows: np.ndarray) -> None:
        """Add rows (R, D)."""
        if not len(rows):
            return
        values = rows.astype(np.float64)
        mean = values.mean(axis=0)
        gap, count = mean - self._mean, self._count + len(rows)
        self._squares = (
            self._squares + ((values - mean) ** 2).sum(axis=0) + gap**2 * (self._count * len(rows) / count)
        )
        self._mean = self._mean + gap * (len(rows) / count)
        self._count = count
        self._lowest = np.minimum(self._lowest, values.min(axis=0))
        self._highest = np.maximum(self._highest, values.max(axis=0))

    @property
    def mean(self) -> np.ndarray:
        """(D,) float32."""
        return np.asarray(self._mean, dtype=np.float32)

    @property
    def std(self) -> np.ndarray:
        """(D,) float32, above 0; 1 where a column never changes."""
        std = np.sqrt(self._squares / max(self._count, 1))
        never = self._lowest == self._highest
        return np.asarray(np.where(never, 1.0, np.maximum(std, _LEAST_STD)), dtype=np.float32)


class _Builder:
    """Writes a set from training files.

    Args:
        folder: of the set.
        origin: for its manifest.
        files: folder of the training files.
    """

    def __init__(self, folder: Path, origin: SetSource, files: Path) -> None:
        self._folder, self._origin = folder, origin
        self._work = folder / _UNFINISHED
        self._training = TrainingFiles(files)
        self._thinner = Thinner(self._training.settings.sampling, origin.num_points)
        self._sizes: Sizes | None = None
        self._frames = self._count = 0  # frames and steps that are written
        self._steps: list[np.ndarray] = []
        self._trajectories: list[tuple[str, str, int, int, int]] = []  # object, target, level, first step, steps
        self._points, self._agent = Moments(), Moments()

    def build(self, on_progress: OnProgress | None) -> None:
        """Write all files."""
        self._work.mkdir(parents=True, exist_ok=True)
        try:
            self._write_frames(on_progress)
            self._finish()
        except BaseException:
            for name in (FRAMES, STEPS, TRAJECTORIES):  # it starts again anyway, and the disk may be full
                (self._work / name).unlink(missing_ok=True)
            with suppress(OSError):  # not empty: of demonstrations the replayed ones stay
                self._work.rmdir()
            raise

    def _write_frames(self, on_progress: OnProgress | None) -> None:
        names, count = self._origin.sources, self._origin.options.count
        entries = {name: entry for name, entry in self._training.manifest.files.items() if name in names}
        total = sum(min(entry.trajectories, count or entry.trajectories) for entry in entries.values())
        done = 0
        with (self._work / FRAMES).open("wb") as out:
            for name, entry in entries.items():
                check_file(self._training.folder, name, entry, TRAINING)
                with TrainingFile(self._training.folder / name) as file:
                    for number in choose_trajectories(file, count):
                        self._add(file, number, out)
                        done += 1
                        if on_progress is not None:
                            on_progress("writing", done, total)
            _sync(out)

    def _add(self, file: TrainingFile, number: int, out: BinaryIO) -> None:
        group = file.groups[number]
        what = f"trajectory {number}"
        with reading(file.path, what):
            self._check_forms(group)
            steps = len(group["actions"])
            rows = np.zeros(steps, dtype=step_type(group["actions"].shape[1]))
            rows["frame"] = self._frames + np.arange(steps)
            rows["trajectory"] = len(self._trajectories)
            rows["action"], rows["reward"] = group["actions"][()], group["rewards"][()]
            rows["disturbed"] = group["disturbed"][()]
            rows["terminated"] = group["success"][()] & group["dones"][()]
            check_finite({"actions": rows["action"], "rewards": rows["reward"]})
            about = str(group.attrs["target"]), int(group.attrs["level"])
            chunks = list(self._records(group, about[1]))
        for records in chunks:  # a full disk is no fault of the source
            out.write(records.tobytes())
            self._frames += len(records)
            self._points.add(records["points"][records["codes"] >= 128])
            self._agent.add(records["agent"])
        self._trajectories.append((file.object, *about, self._count, steps))
        self._steps.append(rows)
        self._count += steps

    def _check_forms(self, group: Any) -> None:
        steps, action = group["actions"].shape
        cloud = group["obs/pointcloud/seg"].shape
        found = Sizes(self._thinner.sampling.num_points, cloud[2], group["obs/agent"].shape[1], action)
        self._sizes = self._sizes or found
        if found != self._sizes:
            raise ValueError(f"its sizes are {found}, those of the trajectories before {self._sizes}")
        if not steps:
            raise ValueError("it has no steps")
        frames = steps + 1
        check_forms(
            group,
            {
                "actions": ((steps, action), np.float32),
                "disturbed": ((steps,), np.bool_),
                "rewards": ((steps,), np.float64),
                "dones": ((steps,), np.bool_),
                "success": ((steps,), np.bool_),
                "obs/agent": ((frames, found.agent), np.float32),
                "obs/pointcloud/xyz": ((frames, cloud[1], 3), np.float32),
                "obs/pointcloud/rgb": ((frames, cloud[1], 3), np.uint8),
                "obs/pointcloud/seg": ((frames, *cloud[1:]), np.bool_),
            },
        )

    def _records(self, group: Any, level: int) -> Iterator[np.ndarray]:
        """Yield the records of a trajectory's observations, a chunk at a time."""
        assert self._sizes is not None
        layout = ObservationLayout(self._sizes.points, self._sizes.masks, self._sizes.agent)
        data = {name: group[f"obs/pointcloud/{name}"] for name in _CLOUD}
        bytes_each = sum(one[0].nbytes for one in data.values())
        size = max(1, _CHUNK_BYTES // bytes_each)
        for start in range(0, len(group["obs/agent"]), size):
            chunk = {name: one[start : start + size] for name, one in data.items()}
            agent = group["obs/agent"][start : start + size]
            thinned = self._thinner.thin(chunk, level, start)
            yield layout.encode(thinned["xyz"], thinned["rgb"], thinned["seg"], agent)

    def _finish(self) -> None:
        """Write the other files, and move all to their places."""
        if self._sizes is None:
            raise DemoError(f"{str(self._origin.folder)!r} has no solved trajectory to make a training set of")
        objects = tuple(sorted({row[0] for row in self._trajectories}))
        targets = tuple(sorted({row[1] for row in self._trajectories}))
        table = np.array(
            [(objects.index(o), targets.index(t), *rest) for o, t, *rest in self._trajectories], TRAJECTORY_TYPE
        )
        steps = np.concatenate(self._steps)
        for name, rows in ((STEPS, steps), (TRAJECTORIES, table)):
            with (self._work / name).open("wb") as out:
                np.save(out, rows)
                _sync(out)
        settings = self._training.settings
        manifest = SetManifest(
            task=settings.source.task,
            control_mode=settings.control_mode,
            sampling=sampling_values(self._thinner.sampling),
            sizes=self._sizes,
            objects=objects,
            targets=targets,
            trajectories=len(table),
            steps=len(steps),
            frames=self._frames,
            point_mean=_floats(self._points.mean),
            point_std=_floats(self._points.std),
            agent_mean=_floats(self._agent.mean),
            agent_std=_floats(self._agent.std),
            action_std=_floats(action_std(steps)),
            files={name: _listed(self._work / name) for name in (FRAMES, STEPS, TRAJECTORIES)},
            **self._origin.identity,
        )
        for name in (FRAMES, STEPS, TRAJECTORIES):
            os.replace(self._work / name, self._folder / name)
        with atomic_write(self._folder / MANIFEST) as temporary, temporary.open("w", encoding="utf-8") as text:
            text.write(manifest_text(manifest))
            _sync(text)


def choose_trajectories(file: TrainingFile, count: int | None) -> list[int]:
    """Return numbers of solved trajectories: all, or the first ones of each target, evenly of all targets."""
    with reading(file.path, "its trajectories"):
        solved = [i for i, group in enumerate(file.groups) if bool(group.attrs["success"])]
        targets = [str(file.groups[i].attrs["target"]) for i in solved]
    rank = [targets[:k].count(target) for k, target in enumerate(targets)]  # within its target
    order = sorted(range(len(solved)), key=lambda k: (rank[k], targets[k]))
    return sorted(solved[k] for k in order[:count])


def action_std(steps: np.ndarray) -> np.ndarray:
    """Return the standard deviation (A,) of the actions that are to be imitated, at least `_LEAST_ACTION_STD`.

    Args:
        steps: rows of `steps.npy`.
    """
    actions = steps["action"][~steps["disturbed"]].astype(np.float64)
    return np.maximum(actions.std(0), _LEAST_ACTION_STD) if len(actions) else np.ones(steps["action"].shape[1])


def _floats(values: np.ndarray) -> tuple[float, ...]:
    return tuple(map(float, values))


def _listed(path: Path) -> SetFile:
    return SetFile(path.stat().st_size, file_sha256(path))


def _sync(file: Any) -> None:
    file.flush()
    os.fsync(file.fileno())
