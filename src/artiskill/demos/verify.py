"""Verifying demonstrations: everything is simulated once more, from the level and the actions."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import object_of
from artiskill.demos.demo_file import DemoFile, Trajectory
from artiskill.demos.demonstrator import RecordedActions
from artiskill.demos.demos import FileEntry, check_file, check_listed, read_manifest
from artiskill.demos.file_format import object_facts
from artiskill.demos.hdf5 import checked_path
from artiskill.demos.recording import ARRAYS, UNREPEATED, Recording, record
from artiskill.demos.settings import Settings, plain
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ArtiSkillError, DemoError
from artiskill.jobs.parallel import check_workers, run_jobs

_JOB_TRAJECTORIES = 25


@dataclass(frozen=True)
class VerifyResult:
    """What came of some trajectories of a file."""

    path: str  # of the file
    object: str  # id
    trajectories: int = 0  # that were simulated
    steps: int = 0  # in all
    exact: int = 0  # trajectories that came out bit for bit
    faults: tuple[str, ...] = ()  # what did not; empty if all is well

    def __add__(self, other: "VerifyResult") -> "VerifyResult":
        """Return the result of both, of the same file."""
        return VerifyResult(
            path=self.path,
            object=self.object,
            trajectories=self.trajectories + other.trajectories,
            steps=self.steps + other.steps,
            exact=self.exact + other.exact,
            faults=self.faults + other.faults,
        )


@dataclass(frozen=True)
class _Job:
    path: Path
    object: str
    numbers: tuple[int, ...]
    given: ArticulatedObject | None


def verify(
    folder: Path | str,
    workers: int = 1,
    on_trajectory: Callable[[bool], None] | None = None,
    objects: Sequence[str | ArticulatedObject] = (),
) -> list[VerifyResult]:
    """Simulate every trajectory of a folder again, and compare every bit of it.

    Compared are the digests of all states, the exact states, rewards and flags, whether it was solved where
    it ends, the hash of the object's content and the facts about it, the task's configuration, the names of flags
    and columns, the manifest's settings, counts and checksums. Which actions were disturbed does not follow from
    them: of this only the form is compared.

    Args:
        folder: with a manifest.
        workers: processes.
        on_trajectory: called with the outcome of each.
        objects: that the demonstrations' own names do not lead to, imported ones say, or their folders' names.

    Returns:
        One result per file, in the manifest's order.

    Raises:
        DemoError: the folder has no manifest that can be read. What is wrong with a file stands in its result.
        ConfigError: an illegal number of workers.
    """
    folder = checked_path(folder)
    check_workers(workers)
    loaded = [object_of(one) for one in objects]
    manifest, given = read_manifest(folder), {obj.id: obj for obj in loaded}
    results: dict[str, VerifyResult] = {}
    jobs: list[_Job] = []
    for name, entry in manifest.files.items():
        path, obj = folder / name, given.get(entry.object)
        fault = _fault_of_file(path, entry, manifest.settings, obj)
        results[str(path)] = VerifyResult(str(path), entry.object, faults=(fault,) if fault else ())
        jobs += [_Job(path, entry.object, part, obj) for part in _parts(0 if fault else entry.trajectories)]
    for result in run_jobs(_verify_part, jobs, workers, on_trajectory, describe=lambda job: str(job.path)):
        results[result.path] += result
    return list(results.values())


def _parts(trajectories: int) -> list[tuple[int, ...]]:
    """Return the numbers of the trajectories of each job."""
    starts = range(0, trajectories, _JOB_TRAJECTORIES)
    return [tuple(range(start, min(start + _JOB_TRAJECTORIES, trajectories))) for start in starts]


def differences(trajectory: Trajectory, env: ManipulationEnv, obj: ArticulatedObject) -> str:
    """Return what differs when a trajectory is simulated again, as text; empty if nothing does."""
    settings = trajectory.header.settings
    actor = RecordedActions(trajectory.actions)
    try:
        found = record(env, obj, trajectory.level, trajectory.target, actor, settings.store)
    except ArtiSkillError as error:  # it diverges, or there is no such level, target or action
        return str(error)
    return "; ".join(_different(trajectory.recording, found))


def _different(stored: Recording, found: Recording) -> Iterator[str]:
    if len(found.actions) != len(stored.actions):
        yield f"the episode ends after {len(found.actions)} steps, not {len(stored.actions)}"
        return
    for name in ("state_columns", "key_frame_columns"):
        if getattr(stored, name) != getattr(found, name):
            yield f"the file's {name} are other ones"
    for name in ARRAYS:
        ours, theirs = getattr(stored, name), getattr(found, name)
        if ours.shape != theirs.shape:
            yield f"{name} are {theirs.shape}, not {ours.shape}"
        elif name != UNREPEATED and ours.tobytes() != theirs.tobytes():
            unequal = np.flatnonzero((ours != theirs).reshape(len(ours), -1).any(axis=1))
            where = f" from row {unequal[0]} on" if len(unequal) else ""
            yield f"{name} differ{where}"


def _fault_of_file(path: Path, entry: FileEntry, settings: Settings, given: ArticulatedObject | None) -> str:
    """Return what is wrong with a file before anything is simulated; empty if nothing is."""
    try:
        check_file(path.parent, path.name, entry)
        with DemoFile(path) as file:
            check_listed(file, settings, entry)
            file.check_counts()
            if entry.bytes != path.stat().st_size:
                raise DemoError(f"{str(path)!r} holds something else than the manifest says")
            _check_names(file, file.load_object(given))
    except ArtiSkillError as error:
        return str(error)
    return ""


def _check_names(file: DemoFile, obj: ArticulatedObject) -> None:
    """Compare what readers may want to know of object and flags with the object and the task."""
    header = file.header
    if header.facts != plain(object_facts(obj)):
        raise DemoError(f"{str(file.path)!r} has other facts than {obj.id!r}: {header.facts}")
    flags = header.settings.make_task().flag_names
    if header.flag_names != flags:
        raise DemoError(f"{str(file.path)!r} has flags {header.flag_names}, the task {flags}")


def _verify_part(job: _Job, send: Callable[[bool], None]) -> VerifyResult:
    steps, exact, faults = 0, 0, []
    with DemoFile(job.path) as file:
        obj = file.load_object(job.given)
        env = file.make_env(obj=obj)
        listed = _listed(file)
        for number in job.numbers:
            try:
                trajectory = file.trajectory(number)
                fault = differences(trajectory, env, obj)
                found = (trajectory.target, trajectory.level, trajectory.success, len(trajectory))
                steps += len(trajectory)
            except DemoError as error:
                fault, found = str(error), None
            if not fault and found != listed.get(number):
                fault = "it is not what the table of attempts says"
            if fault:
                faults.append(f"trajectory {number}: {fault}")
            exact += not fault
            send(not fault)
    return VerifyResult(str(job.path), job.object, len(job.numbers), steps, exact, tuple(faults))


def _listed(file: DemoFile) -> dict[int, tuple[str, int, bool, int]]:
    """Return number of a trajectory -> target, level, success and steps, as the table of attempts says."""
    names = [count.target for count in file.header.targets]
    return {
        int(row["trajectory"]): (names[row["target"]], int(row["level"]), bool(row["success"]), int(row["steps"]))
        for row in file.attempts
    }
