"""Training files from demonstrations; whatever ends it, the same command goes on from where it was."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.config import check
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import Demos
from artiskill.demos.manifest import FileEntry, check_file
from artiskill.demos.replay.blocks import Block, Replayed, run_block
from artiskill.demos.replay.choice import choose, select
from artiskill.demos.replay.layout import leaf_spaces
from artiskill.demos.replay.manifest import (
    WHAT,
    TrainingManifest,
    check_training_file,
    read_training_manifest,
    write_training_manifest,
)
from artiskill.demos.replay.merging import merge
from artiskill.demos.replay.settings import ReplaySettings
from artiskill.demos.unfinished import UNFINISHED, WORKER_HINT, check_manifest, remove_unfinished
from artiskill.errors import DemoError, shown
from artiskill.files import lock_folder, output_path, remove_leftovers
from artiskill.jobs.parallel import run_source

# Trajectories that a worker replays at a stretch, and keeps in memory: so many, or fewer if their observations may
# take more than this, before they are compressed. Both are constants: where in a file things lie depends on them.
_BLOCK_TRAJECTORIES, _BLOCK_BYTES = 10, 500_000_000
OnReplayed = Callable[[Replayed], None]


def replay(
    demos: Path | str,
    folder: Path | str,
    settings: ReplaySettings,
    workers: int = 1,
    objects: Sequence[str | ArticulatedObject] | None = None,
    on_replayed: OnReplayed | None = None,
    on_start: Callable[["Replaying"], None] | None = None,
) -> TrainingManifest:
    """Make training files.

    They are a function of the demonstrations and the settings, bit for bit: not of the number of workers, nor of
    how often this is killed and goes on.

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
        PolicyError: a worker ended by itself.
    """
    folder = output_path(folder)
    is_legal = isinstance(workers, int) and not isinstance(workers, bool) and workers >= 1
    check(is_legal, f"workers must be a whole number of at least 1, not {shown(workers)}")
    source = Demos(demos)
    check_is_other = folder.resolve() != source.folder.resolve()
    check(
        check_is_other, f"{str(folder)!r} holds the demonstrations; choose another folder for the training files"
    )
    settings.make_task()
    with lock_folder(folder, "collector or replay"):
        replaying = Replaying(source, folder, settings, objects, on_replayed or (lambda news: None))
        if on_start is not None:
            on_start(replaying)
        replaying.finish_ready()
        run_source(
            run_block,
            replaying,
            workers,
            replaying.take_in,
            describe=lambda block: block.label,
            hint=WORKER_HINT,
        )
        return replaying.manifest


@dataclass(eq=False)
class _Work:
    """One object: its blocks, those that still wait, and those that a worker has."""

    name: str
    entry: FileEntry
    object_name: str
    blocks: list[Block]
    waiting: list[Block]
    at_work: int = 0


class Replaying:
    """A replay on its way; the jobs of `run_source` are its blocks of trajectories.

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
        on_replayed: OnReplayed,
    ) -> None:
        self._demos, self._folder, self._settings = demos, folder, settings
        self.take_in = on_replayed
        self.manifest = _open_manifest(settings, folder)
        self._open: list[_Work] = []
        self._given: dict[int, _Work] = {}
        for name, entry, given in select(demos, objects):
            if self._is_finished(name, entry):
                remove_unfinished(folder, entry.object)  # killed before it could
            else:
                self._open.append(self._prepare(name, entry, given))
        self.missing = sum(len(block.numbers) for work in self._open for block in work.waiting)

    def next(self) -> Block | None:
        """The next block."""
        for work in self._open:
            if work.waiting:
                work.at_work += 1
                self._given[len(self._given)] = work
                return work.waiting.pop(0)
        return None

    def finished(self, number: int, result: None) -> None:
        """A block has been replayed."""
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
        check_training_file(self._folder, name, entry)
        return True

    def _prepare(self, name: str, entry: FileEntry, given: ArticulatedObject | None) -> _Work:
        check_file(self._demos.folder, name, entry)
        with DemoFile(self._demos.folder / name) as file:
            file.check_settings(self._settings.source)
            size = self._block_size(file.load_object(given))
            numbers = choose(file, self._settings.count, self._settings.keep_failures)
            object_name = str(file.header.facts["name"])
        parts = self._folder / UNFINISHED / entry.object
        try:
            parts.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise DemoError(f"cannot write to {str(parts)!r}: {error.strerror or error}") from error
        remove_leftovers(parts)
        starts = range(0, len(numbers), size)
        blocks = [
            Block(
                settings=self._settings,
                path=self._demos.folder / name,
                source_sha256=entry.sha256,
                object=entry.object,
                given=given,
                numbers=numbers[k : k + size],
                part=parts / f"{k}.h5",
            )
            for k in starts
        ]
        return _Work(name, entry, object_name, blocks, [block for block in blocks if not block.is_done()])

    def _block_size(self, obj: ArticulatedObject) -> int:
        """How many trajectories a block has."""
        env = self._settings.make_env(obj)
        leaves = leaf_spaces(env.observation_space).values()
        frame = sum(math.prod(leaf.shape) * leaf.dtype.itemsize for leaf in leaves)
        return max(1, min(_BLOCK_TRAJECTORIES, _BLOCK_BYTES // (frame * (env.task.episode_steps + 1))))

    def _finish(self, work: _Work) -> None:
        entry = merge(self._folder / work.name, work.blocks, work.entry, work.object_name, self._settings)
        self.manifest = self.manifest.with_file(work.name, entry)
        write_training_manifest(self.manifest, self._folder)
        remove_unfinished(self._folder, work.entry.object)


def _open_manifest(settings: ReplaySettings, folder: Path) -> TrainingManifest:
    """The folder's manifest, which must be of these settings; a new one where there is none."""
    is_new = not check_manifest(folder, WHAT)
    manifest = TrainingManifest(settings) if is_new else read_training_manifest(folder)
    differences = manifest.settings.differences(settings)
    if differences:
        raise DemoError(
            f"{str(folder)!r} holds training files of other settings ({differences}); choose another folder"
        )
    remove_leftovers(folder)
    if is_new:
        write_training_manifest(manifest, folder)
    return manifest
