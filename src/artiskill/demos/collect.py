"""Collecting demonstrations into a folder: whatever ends it, the same command goes on from where it was."""

from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from artiskill.assets.catalog import load_object
from artiskill.demos.attempts import Attempt, Block, fault_kind, run_block
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.header import TargetCount
from artiskill.demos.json_files import MANIFEST
from artiskill.demos.manifest import Manifest, check_file, read_manifest, write_manifest
from artiskill.demos.plan import ObjectPlan, Plan
from artiskill.demos.settings import Settings, settings_hash
from artiskill.demos.staging import Staging
from artiskill.demos.streams import Stream
from artiskill.demos.unfinished import WORKER_HINT
from artiskill.demos.unlisted import entry_of, file_name, with_unlisted
from artiskill.demos.writing import make_header, write_object_file
from artiskill.errors import ConfigError, DemoError, shown
from artiskill.files import lock_folder, remove_leftovers
from artiskill.jobs.parallel import run_source
from artiskill.jobs.ray_jobs import RayCluster, connected

OnAttempt = Callable[[Attempt], None]


def collect(
    plan: Plan,
    folder: Path | str,
    workers: int = 1,
    on_attempt: OnAttempt | None = None,
    on_start: Callable[["Collection"], None] | None = None,
    cluster: RayCluster | None = None,
) -> Manifest:
    """Collect what a plan asks for.

    The files are a function of the plan only, bit for bit: neither the number of workers or machines, nor the
    order in which they come to their ends, nor how often the collection is killed and goes on, changes them.

    Args:
        plan: see `make_plan`.
        folder: for one task and one plan's settings; more objects may follow later.
        workers: processes.
        on_attempt: called after every attempt.
        on_start: called once, when it is known what an earlier collector has left.
        cluster: play there, and not in `workers` processes here.

    Raises:
        MissingExtraError: a cluster without the extra `distributed`.
        ClusterError: the cluster cannot be reached, breaks down, or would give other results.
        ConfigError: an illegal number of workers, or another collector is at the folder.
        DemoError: the folder holds a collection of other settings, or is damaged, or cannot be written to.
        PolicyError: a worker ended by itself, or an episode met an error that is not its own.
    """
    folder = Path(folder)
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise ConfigError(f"workers must be a whole number of at least 1, not {shown(workers)}")
    with ExitStack() as stack:
        local = partial(run_source, workers=workers, hint=WORKER_HINT)
        run = local if cluster is None else stack.enter_context(connected(cluster))
        stack.enter_context(lock_folder(folder, "collector or replay"))
        collection = Collection(plan, folder, on_attempt or (lambda attempt: None))
        if on_start is not None:
            on_start(collection)
        collection.finish_ready()
        run(run_block, collection, on_message=collection.take_in, describe=lambda block: block.label)
        return collection.manifest


class Collection:
    """A collection on its way; the jobs of `run_source` are its blocks of levels.

    Args:
        plan: what is collected.
        folder: `lock_folder` for it.
        on_attempt: called after every attempt.

    Attributes:
        manifest: of what is finished.
        restored: successful trajectories that an earlier collector has left, of objects that are not finished.

    Raises:
        DemoError: the folder holds a collection of other settings, or is damaged.
    """

    def __init__(self, plan: Plan, folder: Path, on_attempt: OnAttempt) -> None:
        self.restored = 0
        self._plan, self._folder, self._on_attempt = plan, folder, on_attempt
        self._staging = Staging(folder, settings_hash(plan.settings))
        self._open: dict[str, tuple[ObjectPlan, list[Stream]]] = {}
        self.manifest = self._open_manifest()
        for one in plan.objects:
            if self._is_finished(one):
                self._staging.remove(one.id)
                continue
            self._open[one.id] = one, plan.streams(one)
            for attempt in self._staging.load(one.id, one.content_hash):
                self._take_back(attempt)
        remove_leftovers(folder)
        write_manifest(self.manifest, folder)
        for name in self._open:
            self._staging.begin(name)

    @property
    def missing(self) -> int:
        """Successful trajectories that are still to be made, if no target is given up."""
        streams = [stream for _, streams in self._open.values() for stream in streams if stream.end is None]
        return sum(stream.wanted - stream.successes for stream in streams)

    def next(self) -> Block | None:
        """The next block of levels."""
        for one, streams in self._open.values():
            for stream in streams:
                levels = stream.take(self._plan.block_levels)
                if levels:
                    return Block(self._plan.settings, one.item, stream.target, levels)
        return None

    def take_in(self, attempt: Attempt) -> None:
        """Keep an attempt."""
        self._staging.save(attempt, self._open[attempt.object][0].content_hash)
        self._stream(attempt).tell(attempt.level, attempt.success)
        self._on_attempt(attempt)

    def finished(self, number: int, result: None) -> None:
        """A block has been worked through."""
        self.finish_ready()

    def finish_ready(self) -> None:
        """Write the files of objects with nothing left to try."""
        for one, streams in list(self._open.values()):
            is_at_work = any(stream.handed_out for stream in streams)
            if not is_at_work and all(stream.end is not None for stream in streams):
                self._finish(one, streams)
                del self._open[one.id]

    def _stream(self, attempt: Attempt) -> Stream:
        return next(s for s in self._open[attempt.object][1] if s.target == attempt.target)

    def _take_back(self, attempt: Attempt) -> None:
        """An earlier collector's attempt; one that nobody would make counts for nothing."""
        for stream in self._open[attempt.object][1]:
            if stream.target == attempt.target and stream.has(attempt.level):
                stream.tell(attempt.level, attempt.success)
                self.restored += attempt.success

    def _open_manifest(self) -> Manifest:
        """The folder's manifest, which must be of the plan's settings; one made anew where there is none."""
        wanted = self._plan.settings
        if (self._folder / MANIFEST).exists():
            manifest = read_manifest(self._folder)
            _check_same(self._folder, manifest.settings, wanted)
        else:
            manifest = Manifest(wanted)
            self._staging.check()
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
            file.check_listed(self._plan.settings, entry)
        return True

    def _finish(self, one: ObjectPlan, streams: list[Stream]) -> None:
        known = {(a.target, a.level): a for a in self._staging.load(one.id, one.content_hash)}
        counted = [(stream.target, level) for stream in streams for level in stream.levels]
        lost = [key for key in counted if key not in known]
        if lost:
            raise DemoError(
                f"{str(self._folder)!r}: {len(lost)} of {len(counted)} attempts at {one.id!r} were damaged or "
                "removed while others were made; the same command makes them again"
            )
        attempts = [known[key] for key in counted]
        faults = {key: fault_kind(attempt.fault) for key, attempt in known.items()}
        counts = tuple(_count(stream, faults) for stream in streams)
        obj = load_object(one.item) if isinstance(one.item, str) else one.item
        header = make_header(obj, self._plan.settings, counts, self._plan.flag_names, attempts)
        path = self._folder / file_name(one.id)
        write_object_file(path, header, attempts)
        with DemoFile(path) as file:
            self.manifest = self.manifest.with_file(path.name, entry_of(file))
        write_manifest(self.manifest, self._folder)
        self._staging.remove(one.id)


def _count(stream: Stream, faults: Mapping[tuple[str, int], str]) -> TargetCount:
    """What came of a stream; of each target and level, the kind of fault that ended it."""
    kinds = sorted(fault for level in stream.levels if (fault := faults[stream.target, level]))
    successes = sum(stream.outcomes[level] for level in stream.levels)
    return TargetCount(
        target=stream.target,
        wanted=stream.wanted,
        successes=successes,
        attempts=len(stream.levels),
        gave_up=successes < stream.wanted,
        faults=dict(Counter(kinds)),
    )


def _check_same(folder: Path, there: Settings, here: Settings) -> None:
    """See whether two collections' settings are the same."""
    if there.task != here.task:
        raise DemoError(
            f"{str(folder)!r} holds demonstrations of {there.task}, not of {here.task}; choose another folder"
        )
    differences = there.differences(here)
    if differences:
        raise DemoError(
            f"{str(folder)!r} holds demonstrations of other settings ({differences}); choose another folder"
        )
