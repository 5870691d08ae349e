"""Verifying demonstrations: everything is simulated once more, from the level and the actions."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demonstrator import Replay
from artiskill.demos.header import object_facts
from artiskill.demos.json_files import checked_path
from artiskill.demos.manifest import FileEntry, check_file, read_manifest
from artiskill.demos.recording import ARRAYS, UNREPEATED, Recording, record
from artiskill.demos.settings import Settings, plain
from artiskill.demos.trajectory import Trajectory
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ArtiSkillError, ConfigError, DemoError, shown
from artiskill.jobs.parallel import run_jobs

_JOB_TRAJECTORIES = 25


@dataclass(frozen=True)
class Verdict:
    """What came of some trajectories of a file.

    Attributes:
        path: of the file.
        object: id.
        trajectories: that were simulated.
        steps: in all.
        exact: trajectories that came out bit for bit.
        faults: what did not; empty if all is well.
    """

    path: str
    object: str
    trajectories: int
    steps: int
    exact: int
    faults: tuple[str, ...]


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
) -> list[Verdict]:
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
        One verdict per file, in the manifest's order.

    Raises:
        DemoError: the folder has no manifest that can be read. What is wrong with a file stands in its verdict.
        ConfigError: an illegal number of workers.
    """
    folder = checked_path(folder)
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise ConfigError(f"workers must be a whole number of at least 1, not {shown(workers)}")
    loaded = [load_object(one) if isinstance(one, str) else one for one in objects]
    manifest, given = read_manifest(folder), {obj.id: obj for obj in loaded}
    parts: dict[str, list[Verdict]] = {}
    jobs: list[_Job] = []
    for name, entry in manifest.files.items():
        path = folder / name
        fault = _fault_of_file(path, entry, manifest.settings, given.get(entry.object))
        parts[str(path)] = [Verdict(str(path), entry.object, 0, 0, 0, (fault,) if fault else ())]
        if not fault:
            numbers = tuple(range(entry.trajectories))
            starts = range(0, entry.trajectories, _JOB_TRAJECTORIES)
            jobs += [
                _Job(path, entry.object, numbers[k : k + _JOB_TRAJECTORIES], given.get(entry.object))
                for k in starts
            ]
    for verdict in run_jobs(_verify_part, jobs, workers, on_trajectory, describe=lambda job: str(job.path)):
        parts[verdict.path].append(verdict)
    return [_total(verdicts) for verdicts in parts.values()]


def differences(trajectory: Trajectory, env: ManipulationEnv, obj: ArticulatedObject) -> str:
    """What comes out otherwise when a trajectory is simulated again, as text; empty if nothing does."""
    settings = trajectory.header.settings
    try:
        found = record(env, obj, trajectory.level, trajectory.target, Replay(trajectory.actions), settings.store)
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
    """What is wrong with a file before anything is simulated; empty if nothing is."""
    try:
        check_file(path.parent, path.name, entry)
        with DemoFile(path) as file:
            file.check_listed(settings, entry)
            file.check_counts()
            if entry.bytes != path.stat().st_size:
                raise DemoError(f"{str(path)!r} holds something else than the manifest says")
            _check_names(file, file.load_object(given))
    except ArtiSkillError as error:
        return str(error)
    return ""


def _check_names(file: DemoFile, obj: ArticulatedObject) -> None:
    """What readers may want to know of object and flags, against the object and the task."""
    header = file.header
    if header.facts != plain(object_facts(obj)):
        raise DemoError(f"{str(file.path)!r} has other facts than {obj.id!r}: {header.facts}")
    flags = header.settings.make_task().flag_names
    if header.flag_names != flags:
        raise DemoError(f"{str(file.path)!r} has flags {header.flag_names}, the task {flags}")


def _verify_part(job: _Job, tell: Callable[[bool], None]) -> Verdict:
    steps, exact, faults = 0, 0, []
    with DemoFile(job.path) as file:
        obj = file.load_object(job.given)
        env = file.make_env(obj=obj)
        listed = _listed(file)
        for number in job.numbers:
            try:
                trajectory = file.trajectory(number)
                fault = differences(trajectory, env, obj)
                told = (trajectory.target, trajectory.level, trajectory.success, len(trajectory))
                steps += len(trajectory)
            except DemoError as error:
                fault, told = str(error), None
            if not fault and told != listed.get(number):
                fault = "it is not what the table of attempts says"
            if fault:
                faults.append(f"trajectory {number}: {fault}")
            exact += not fault
            tell(not fault)
    return Verdict(str(job.path), job.object, len(job.numbers), steps, exact, tuple(faults))


def _listed(file: DemoFile) -> dict[int, tuple[str, int, bool, int]]:
    """Number of a trajectory -> target, level, success and steps that the table of attempts says."""
    names = [count.target for count in file.header.targets]
    return {
        int(row["trajectory"]): (names[row["target"]], int(row["level"]), bool(row["success"]), int(row["steps"]))
        for row in file.attempts
    }


def _total(verdicts: list[Verdict]) -> Verdict:
    return Verdict(
        path=verdicts[0].path,
        object=verdicts[0].object,
        trajectories=sum(v.trajectories for v in verdicts),
        steps=sum(v.steps for v in verdicts),
        exact=sum(v.exact for v in verdicts),
        faults=tuple(fault for v in verdicts for fault in v.faults),
    )
