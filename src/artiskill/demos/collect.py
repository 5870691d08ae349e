"""Collecting demonstrations into a folder: however it ends, the same command continues where it stopped.

Attempts at objects that are not finished have a file each: what a killed collector leaves to the next one.
"""

import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import LEGAL_ID
from artiskill.assets.catalog import object_of
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demonstrator import CollectJob, DemoAttempt, fault_kind, run_collect_job
from artiskill.demos.demos import (
    KEPT,
    MANIFEST,
    UNFINISHED,
    WORKER_HINT,
    Manifest,
    check_file,
    check_listed,
    entry_of,
    file_name,
    read_manifest,
    remove_unfinished,
    unlisted_files,
    write_manifest,
)
from artiskill.demos.file_format import TargetCount, make_header, write_object_file
from artiskill.demos.plan import CollectionPlan, LevelQueue, ObjectPlan
from artiskill.demos.recording import ARRAYS, Columns, Recording
from artiskill.demos.settings import Settings, settings_hash
from artiskill.errors import DemoError
from artiskill.files import DAMAGED_ARCHIVE, atomic_write, lock_folder, remove_leftovers
from artiskill.jobs.parallel import check_workers, run_source
from artiskill.jobs.ray_jobs import RayCluster, connected
from artiskill.tasks.levels import check_level

OnAttempt = Callable[[DemoAttempt], None]
# what an attempt's file says about it, beside its recording
_ABOUT = {"object": str, "target": str, "level": int, "success": bool, "steps": int, "fault": str}


def collect(
    plan: CollectionPlan,
    folder: Path | str,
    workers: int = 1,
    on_attempt: OnAttempt | None = None,
    on_start: Callable[["Collection"], None] | None = None,
    cluster: RayCluster | None = None,
) -> Manifest:
    """Collect what a plan asks for.

    The plan determines the files, bit for bit: neither the number of workers or machines, nor the order in which
    they finish, nor how often the collection is killed and continued, changes them.

    Args:
        plan: see `make_plan`.
        folder: for one task and one plan's settings; more objects may follow later.
        workers: processes.
        on_attempt: called after every attempt.
        on_start: called once, when it is known what an earlier collector has left.
        cluster: where to work, instead of in `workers` processes here.

    Raises:
        MissingExtraError: a cluster without the extra `distributed`.
        ClusterError: the cluster cannot be reached, breaks down, or would give other results.
        ConfigError: an illegal number of workers, or another collector is at the folder.
        DemoError: the folder holds a collection of other settings, or is damaged, or cannot be written to.
        PolicyError: a worker died, or an episode met an error that is not its own.
    """
    folder = Path(folder)
    check_workers(workers)
    with ExitStack() as stack:
        local = partial(run_source, workers=workers, hint=WORKER_HINT)
        run = local if cluster is None else stack.enter_context(connected(cluster))
        stack.enter_context(lock_folder(folder, "collector or replay"))
        collection = Collection(plan, folder, on_attempt or (lambda attempt: None))
        if on_start is not None:
            on_start(collection)
        collection.finish_ready()
        run(run_collect_job, collection, on_message=collection.add_attempt, describe=lambda job: job.label)
    return collection.manifest


class Collection:
    """A collection in progress; its jobs, for `run_source`, are levels of one target.

    Args:
        plan: what is collected.
        folder: `lock_folder` for it.
        on_attempt: called after every attempt.

    Attributes:
        manifest: of what is finished.

    Raises:
        DemoError: the folder holds a collection of other settings, or is damaged.
    """

    def __init__(self, plan: CollectionPlan, folder: Path, on_attempt: OnAttempt) -> None:
        self._plan, self._folder, self._on_attempt = plan, folder, on_attempt
        self._store = AttemptStore(folder, settings_hash(plan.settings))
        self._open: dict[str, tuple[ObjectPlan, list[LevelQueue]]] = {}
        self.manifest = self._open_manifest()
        for one in plan.objects:
            if self._is_finished(one):
                self._store.remove(one.id)
                continue
            self._open[one.id] = one, plan.queues(one)
            for attempt in self._store.load(one.id, one.content_hash):
                self._restore(attempt)
        remove_leftovers(folder)
        write_manifest(self.manifest, folder)
        for name in self._open:
            self._store.begin(name)

    @property
    def missing(self) -> int:
        """Successful trajectories that are still to be made, if no target is given up."""
        queues = [queue for _, queues in self._open.values() for queue in queues if queue.end is None]
        return sum(queue.wanted - queue.successes for queue in queues)

    def next(self) -> CollectJob | None:
        """Return the next job."""
        for one, queues in self._open.values():
            for queue in queues:
                levels = queue.take(self._plan.block_levels)
                if levels:
                    return CollectJob(self._plan.settings, one.item, queue.target, levels, self._plan.agent)
        return None

    def add_attempt(self, attempt: DemoAttempt) -> None:
        """Store an attempt that a worker has made."""
        one, queues = self._open[attempt.object]
        self._store.save(attempt, one.content_hash)
        queue = next(queue for queue in queues if queue.target == attempt.target)
        queue.add_result(attempt.level, attempt.success)
        self._on_attempt(attempt)

    def finished(self, number: int, result: None) -> None:
        """Note that a job is finished."""
        self.finish_ready()

    def finish_ready(self) -> None:
        """Write the files of objects with nothing left to try."""
        for one, queues in list(self._open.values()):
            if all(queue.end is not None and not queue.in_progress for queue in queues):
                self._finish(one, queues)
                del self._open[one.id]

    def _restore(self, attempt: DemoAttempt) -> None:
        """Add an earlier collector's attempt; one at a level that is not its target's does not count."""
        for queue in self._open[attempt.object][1]:
            if queue.target == attempt.target and queue.owns(attempt.level):
                queue.add_result(attempt.level, attempt.success)

    def _open_manifest(self) -> Manifest:
        """Return the folder's manifest, which must be of the plan's settings; a new one where there is none."""
        wanted = self._plan.settings
        if (self._folder / MANIFEST).exists():
            manifest = read_manifest(self._folder)
            check_same(self._folder, manifest.settings, wanted)
        else:
            manifest = Manifest(wanted)
            self._store.check()
        return with_unlisted(manifest, self._folder)

    def _is_finished(self, one: ObjectPlan) -> bool:
        path = self._folder / file_name(one.id)
        entry = self.manifest.files.get(path.name)
        if entry is None or not path.exists():
            return False
        check_file(self._folder, path.name, entry)
        if entry.content_hash != one.content_hash:
            raise DemoError(
                f"{str(self._folder)!r} holds demonstrations of another {one.id!r}: its content hash was "
                f"{entry.content_hash}, now it is {one.content_hash}; choose another folder"
            )
        with DemoFile(path) as file:
            check_listed(file, self._plan.settings, entry)
        return True

    def _finish(self, one: ObjectPlan, queues: list[LevelQueue]) -> None:
        known = {(a.target, a.level): a for a in self._store.load(one.id, one.content_hash)}
        counted = [(queue.target, level) for queue in queues for level in queue.levels]
        lost = [key for key in counted if key not in known]
        if lost:
            raise DemoError(
                f"{str(self._folder)!r}: {len(lost)} of {len(counted)} attempts at {one.id!r} were damaged or "
                "removed while others were made; the same command makes them again"
            )
        attempts = [known[key] for key in counted]
        faults = {key: fault_kind(attempt.fault) for key, attempt in known.items()}
        counts = tuple(_count(queue, faults) for queue in queues)
        obj = object_of(one.item)
        header = make_header(obj, self._plan.settings, counts, self._plan.flag_names, attempts)
        path = self._folder / file_name(one.id)
        write_object_file(path, header, attempts)
        with DemoFile(path) as file:
            self.manifest = self.manifest.with_file(path.name, entry_of(file))
        write_manifest(self.manifest, self._folder)
        self._store.remove(one.id)


def _count(queue: LevelQueue, faults: Mapping[tuple[str, int], str]) -> TargetCount:
    """Count what came of a target; `faults` has the kind of fault of each target and level."""
    kinds = sorted(fault for level in queue.levels if (fault := faults[queue.target, level]))
    successes = sum(queue.outcomes[level] for level in queue.levels)
    return TargetCount(
        target=queue.target,
        wanted=queue.wanted,
        successes=successes,
        attempts=len(queue.levels),
        gave_up=successes < queue.wanted,
        faults=dict(Counter(kinds)),
    )


def check_same(folder: Path, there: Settings, here: Settings) -> None:
    """Raise `DemoError` unless a folder's settings are the plan's."""
    if there.task != here.task:
        raise DemoError(
            f"{str(folder)!r} holds demonstrations of {there.task}, not of {here.task}; choose another folder"
        )
    differences = there.differences(here)
    if differences:
        raise DemoError(
            f"{str(folder)!r} holds demonstrations of other settings ({differences}); choose another folder"
        )


def with_unlisted(manifest: Manifest, folder: Path) -> Manifest:
    """Return the manifest with the files of the folder that it did not list; each is read whole.

    Raises:
        DemoError: one was made with other settings, or is damaged, or no file of demonstrations.
    """
    for path in unlisted_files(folder):
        try:
            with DemoFile(path) as file:
                _check_belongs(file, manifest)
                manifest = manifest.with_file(path.name, entry_of(file))
        except DemoError as error:
            raise DemoError(
                f"{str(folder)!r} has a file that its manifest does not list, and that does not fit: {error}; "
                "move it elsewhere, or choose another folder"
            ) from error
    return manifest


def _check_belongs(file: DemoFile, manifest: Manifest) -> None:
    object_id, name = file.header.object, file.path.name
    differences = file.header.settings.differences(manifest.settings)
    if differences:
        raise DemoError(f"{name} was made with other settings ({differences})")
    if name != file_name(object_id) or not LEGAL_ID.fullmatch(object_id):
        raise DemoError(f"{name} holds demonstrations of {object_id!r}")
    file.check_counts()
    for number in range(len(file)):
        file.trajectory(number)


class AttemptStore:
    """The attempts in a folder of demonstrations.

    Args:
        folder: of the demonstrations.
        settings_hash: of the collection's settings.
    """

    def __init__(self, folder: Path, settings_hash: str) -> None:
        self._demos, self._folder, self._settings_hash = folder, folder / UNFINISHED, settings_hash

    def begin(self, object_id: str) -> None:
        """Leave a trace of an object that is to be collected, even if killed before its first attempt.

        Raises:
            DemoError: it cannot be written.
        """
        with _writing(self._folder):
            (self._folder / object_id).mkdir(parents=True, exist_ok=True)

    def save(self, attempt: DemoAttempt, content_hash: str) -> None:
        """Save an attempt at an object with this content hash.

        Raises:
            DemoError: it cannot be written; what was written before is as it was.
        """
        # levels differ from target to target; the names of links may be anything, `../up` say
        path = self._folder / attempt.object / f"{attempt.level}.npz"
        about = {name: getattr(attempt, name) for name in _ABOUT}
        arrays: dict[str, Any] = {}
        if attempt.recording is not None:
            for name in ("state_columns", "key_frame_columns"):
                about[name] = getattr(attempt.recording, name).to_list()
            arrays = {name: getattr(attempt.recording, name) for name in ARRAYS}
        about |= {"content_hash": content_hash, "settings_hash": self._settings_hash}
        with _writing(path.parent):
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_write(path) as temporary, temporary.open("wb") as file:
                np.savez(file, about=np.array(json.dumps(about)), **arrays)

    def load(self, object_id: str, content_hash: str | None = None) -> list[DemoAttempt]:
        """Return all attempts at an object that can be read; others are as if they had never been made.

        Args:
            object_id: of the object.
            content_hash: of the object; None for whichever they were made with.

        Raises:
            DemoError: some were made with another object of this id, or with other settings.
        """
        folder = self._folder / object_id
        found = [read for path in sorted(folder.glob("*.npz")) if (read := _read(path)) is not None]
        for _, made_of, made_with in found:
            for what, there, here in (
                (f"with another {object_id!r}: its content hash was", made_of, content_hash or made_of),
                ("with other settings: their hash was", made_with, self._settings_hash),
            ):
                if there != here:
                    raise DemoError(
                        f"{str(folder)!r} holds attempts made {what} {there}, now it is {here}; "
                        "choose another folder, or remove this one to make them anew"
                    )
        remove_leftovers(folder)
        return [attempt for attempt, _, _ in found if attempt.object == object_id]

    def check(self) -> None:
        """Raise `DemoError` unless all attempts, at any object, were made with the collection's settings."""
        for folder in sorted(self._folder.glob("*")):
            self.load(folder.name)

    def remove(self, object_id: str) -> None:
        """Remove the attempts at an object, whose file is finished."""
        remove_unfinished(self._demos, object_id)


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """Turn what the file system raises into an error that names the folder."""
    try:
        yield
    except OSError as error:
        raise DemoError(f"cannot write to {str(folder)!r}: {error.strerror or error}; {KEPT}") from error


def _read(path: Path) -> tuple[DemoAttempt, str, str] | None:
    """Return an attempt, and the hashes of its object and settings; None if the file is damaged."""
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            about = json.loads(str(file["about"]))
            hashes = str(about.pop("content_hash")), str(about.pop("settings_hash"))
            check_level(about["level"])
            wrong = [name for name, kind in _ABOUT.items() if type(about[name]) is not kind]
            is_recorded = "state_columns" in about
            if wrong or (about["success"] and not is_recorded):
                return None
            columns = ("state_columns", "key_frame_columns") if is_recorded else ()
            layout: dict[str, Any] = {name: Columns.from_list(about.pop(name)) for name in columns}
            recording = Recording(**{name: file[name] for name in ARRAYS}, **layout) if is_recorded else None
            return DemoAttempt(**about, recording=recording), *hashes
    except DAMAGED_ARCHIVE:
        return None
