"""Training files from demonstrations; however it ends, the same command continues where it stopped."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.config import check
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import (
    MANIFEST,
    UNFINISHED,
    WORKER_HINT,
    Demos,
    FileEntry,
    check_file,
    read_manifest_of,
    remove_unfinished,
    write_manifest,
)
from artiskill.demos.file_format import TRAINING
from artiskill.demos.replay_episode import leaf_spaces
from artiskill.demos.replay_jobs import ReplayedTrajectory, ReplayJob, merge_parts, run_replay_job
from artiskill.demos.training_file import ReplaySettings, TrainingManifest
from artiskill.errors import DemoError, UnknownNameError
from artiskill.files import lock_folder, output_path, remove_leftovers
from artiskill.jobs.parallel import check_workers, run_source

# Trajectories of one job, which a worker keeps in memory: so many, or fewer if their observations may take more
# than this, before they are compressed. Both are constants: where in a file things lie depends on them.
_JOB_TRAJECTORIES, _JOB_BYTES = 10, 500_000_000
_MOST_NAMED = 3  # files
OnReplayed = Callable[[ReplayedTrajectory], None]
Selected = tuple[str, FileEntry, ArticulatedObject | None]


def replay(
    demos: Path | str,
    folder: Path | str,
    settings: ReplaySettings,
    workers: int = 1,
    objects: Sequence[str | ArticulatedObject] | None = None,
    on_replayed: OnReplayed | None = None,
    on_start: Callable[["ReplayRun"], None] | None = None,
) -> TrainingManifest:
    """Make training files.

    The demonstrations and the settings determine them, bit for bit: not the number of workers, nor how often this
    is killed and continued.

    Args:
        demos: a folder of demonstrations.
        folder: for the training files; more objects may follow later.
        settings: how they are made.
        workers: processes.
        objects: only these; an `ArticulatedObject` where no name leads to it. None for all.
        on_replayed: called after every trajectory.
        on_start: called once, when it is known what is there already.

    Raises:
        UnknownNameError: no demonstrations of an object.
        ConfigError: an illegal number of workers or value of what is seen, or another replay is at the folder.
        DemoError: the demonstrations are damaged or of another catalogue, the folder holds other training files,
            or cannot be written to.
        PolicyError: a worker died.
    """
    folder, source = _check_arguments(demos, folder, settings, workers)
    with lock_folder(folder, "collector or replay"):
        run = ReplayRun(source, folder, settings, objects)
        if on_start is not None:
            on_start(run)
        run.finish_ready()
        run_source(run_replay_job, run, workers, on_replayed, describe=lambda job: job.label, hint=WORKER_HINT)
        return run.manifest


def _check_arguments(
    demos: Path | str, folder: Path | str, settings: ReplaySettings, workers: int
) -> tuple[Path, Demos]:
    folder = output_path(folder)
    check_workers(workers)
    source = Demos(demos)
    is_other = folder.resolve() != source.folder.resolve()
    check(is_other, f"{str(folder)!r} holds the demonstrations; choose another folder for the training files")
    settings.make_task()
    return folder, source


def select(demos: Demos, objects: Sequence[str | ArticulatedObject] | None) -> list[Selected]:
    """Return the files of some objects, or of all: name, entry, and the object where it was handed in.

    Raises:
        UnknownNameError: there are no demonstrations of an object.
    """
    by_object = {entry.object: (name, entry) for name, entry in demos.manifest.files.items()}
    if objects is None:
        return [(name, entry, None) for name, entry in by_object.values()]
    found: dict[str, Selected] = {}
    for item in objects:
        given = item if isinstance(item, ArticulatedObject) else None
        key = item.id if isinstance(item, ArticulatedObject) else item
        if key not in by_object:
            raise UnknownNameError("object", key, by_object, f"(of {str(demos.folder)!r})")
        found[key] = *by_object[key], given
    return [found[key] for key in by_object if key in found]


def choose(file: DemoFile, count: int | None, keep_failures: bool = False) -> tuple[int, ...]:
    """Return numbers of trajectories: all, or the first ones of each target, evenly of all targets.

    Args:
        file: of demonstrations.
        count: so many; None for all.
        keep_failures: failures count, too; else `count` successes are chosen.
    """
    if count is None:
        return tuple(range(len(file)))
    attempts = file.attempts
    rows = attempts[(attempts["trajectory"] >= 0) & (attempts["success"].astype(bool) | keep_failures)]
    rank = np.zeros(len(rows), dtype=int)  # within its target
    for target in np.unique(rows["target"]):
        of_target = np.flatnonzero(rows["target"] == target)
        rank[of_target] = np.arange(len(of_target))
    first = np.lexsort((rows["target"], rank))[:count]
    return tuple(sorted(int(number) for number in rows["trajectory"][first]))


@dataclass(eq=False)
class _ObjectWork:
    """One object: all its jobs, those that still wait, and how many workers have."""

    name: str
    entry: FileEntry
    object_name: str
    jobs: list[ReplayJob]
    waiting: list[ReplayJob]
    at_work: int = 0


class ReplayRun:
    """A replay in progress; its jobs, for `run_source`, are trajectories of one object.

    Attributes:
        manifest: of what is finished.
        missing: trajectories that are still to be replayed.
    """

    def __init__(
        self,
        demos: Demos,
        folder: Path,
        settings: ReplaySettings,
        objects: Sequence[str | ArticulatedObject] | None,
    ) -> None:
        self._demos, self._folder, self._settings = demos, folder, settings
        self.manifest = _open_manifest(settings, folder)
        self._open: list[_ObjectWork] = []
        self._given: list[_ObjectWork] = []
        for name, entry, given in select(demos, objects):
            if self._is_finished(name, entry):
                remove_unfinished(folder, entry.object)  # killed before it could
            else:
                self._open.append(self._prepare(name, entry, given))
        self.missing = sum(len(job.numbers) for work in self._open for job in work.waiting)

    def next(self) -> ReplayJob | None:
        """Return the next job."""
        for work in self._open:
            if work.waiting:
                work.at_work += 1
                self._given.append(work)
                return work.waiting.pop(0)
        return None

    def finished(self, number: int, result: None) -> None:
        """Note that the `number`-th job is finished."""
        self._given[number].at_work -= 1
        self.finish_ready()

    def finish_ready(self) -> None:
        """Write the files of objects with nothing left to replay."""
        for work in list(self._open):
            if not work.waiting and not work.at_work:
                self._finish(work)
                self._open.remove(work)

    def _is_finished(self, name: str, source: FileEntry) -> bool:
        entry = self.manifest.files.get(name)
        if entry is None or not (self._folder / name).exists():
            return False
        if entry.source_sha256 != source.sha256:
            raise DemoError(
                f"{str(self._folder / name)!r} was made from other demonstrations of {source.object!r} than "
                f"{str(self._demos.folder)!r} holds; choose another folder"
            )
        check_file(self._folder, name, entry, TRAINING)
        return True

    def _prepare(self, name: str, entry: FileEntry, given: ArticulatedObject | None) -> _ObjectWork:
        path = self._demos.folder / name
        check_file(self._demos.folder, name, entry)
        with DemoFile(path) as file:
            file.check_settings(self._settings.source)
            size = self._job_size(file.load_object(given))
            numbers = choose(file, self._settings.count, self._settings.keep_failures)
            object_name = str(file.header.facts["name"])
        parts = self._folder / UNFINISHED / entry.object
        try:
            parts.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise DemoError(f"cannot write to {str(parts)!r}: {error.strerror or error}") from error
        remove_leftovers(parts)
        jobs = [
            ReplayJob(
                settings=self._settings,
                path=path,
                source_sha256=entry.sha256,
                object=entry.object,
                given=given,
                numbers=numbers[k : k + size],
                part=parts / f"{k}.h5",
            )
            for k in range(0, len(numbers), size)
        ]
        return _ObjectWork(name, entry, object_name, jobs, [job for job in jobs if not job.is_done()])

    def _job_size(self, obj: ArticulatedObject) -> int:
        """Return how many trajectories a job has."""
        env = self._settings.make_env(obj)
        leaves = leaf_spaces(env.observation_space).values()
        frame = sum(math.prod(leaf.shape) * leaf.dtype.itemsize for leaf in leaves)
        return max(1, min(_JOB_TRAJECTORIES, _JOB_BYTES // (frame * (env.task.episode_steps + 1))))

    def _finish(self, work: _ObjectWork) -> None:
        path = self._folder / work.name
        entry = merge_parts(path, work.jobs, work.entry, work.object_name, self._settings)
        self.manifest = self.manifest.with_file(work.name, entry)
        write_manifest(self.manifest, self._folder)
        remove_unfinished(self._folder, work.entry.object)


def _open_manifest(settings: ReplaySettings, folder: Path) -> TrainingManifest:
    """Return the folder's manifest, which must be of these settings; a new one where there is none."""
    is_new = not (folder / MANIFEST).exists()
    if is_new:
        _check_untouched(folder)
    manifest = TrainingManifest(settings) if is_new else read_manifest_of(TrainingManifest, folder)
    differences = manifest.settings.differences(settings)
    if differences:
        raise DemoError(
            f"{str(folder)!r} holds training files of other settings ({differences}); choose another folder"
        )
    remove_leftovers(folder)
    if is_new:
        write_manifest(manifest, folder)
    return manifest


def _check_untouched(folder: Path) -> None:
    """Raise `DemoError` if a folder without a manifest has files, or unfinished ones.

    Nobody knows by which options they were made: other options would mix with them, or overwrite them.
    """
    found = sorted(path.name for path in folder.glob("*.h5"))
    if (folder / UNFINISHED).exists():
        found.append(UNFINISHED)
    if found:
        named = ", ".join(found[:_MOST_NAMED]) + (", ..." if len(found) > _MOST_NAMED else "")
        raise DemoError(
            f"{str(folder)!r} has {TRAINING.holds} ({named}), but its {MANIFEST} is missing, which says how they "
            "were made: put it back, choose another folder, or remove these files"
        )
