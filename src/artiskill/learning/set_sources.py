"""What a training set is made from: training files, or demonstrations that are replayed first; and its options."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from artiskill.config import check, differing
from artiskill.demos.demos import MANIFEST, Demos
from artiskill.demos.file_format import DEMONSTRATIONS, TRAINING
from artiskill.demos.replay import ReplayRun, replay, select
from artiskill.demos.settings import plain
from artiskill.demos.training_file import SIMULATE, ReplaySettings, TrainingFiles, make_sampling
from artiskill.errors import DemoError, check_name, shown
from artiskill.files import parse_json, read_bytes
from artiskill.learning.training_set import read_set_manifest
from artiskill.versions import versions

_MOST_NAMED = 3  # differences
OnProgress = Callable[[str, int, int], None]  # what is done, how many trajectories of how many


@dataclass(frozen=True)
class SetOptions:
    """What a training set is made of, and how.

    Control mode, method and frame belong to the training files; where demonstrations are given, None means their
    control mode, `maniskill` and `world`.
    """

    num_points: int = 256  # of a cloud
    objects: tuple[str, ...] | None = None  # only these; None for all
    count: int | None = None  # successes of each object, evenly of its targets; None for all
    control_mode: str | None = None
    method: str | None = None  # of choosing points
    frame: str | None = None  # of the points

    def __post_init__(self) -> None:
        check(self.num_points >= 1, f"the number of points must be at least 1, not {self.num_points}")
        check(self.count is None or self.count >= 1, f"the count must be at least 1, not {self.count}")


@dataclass(frozen=True)
class SetSource:
    """What a set is made from."""

    folder: Path
    options: SetOptions
    settings: ReplaySettings  # of the training files
    sources: dict[str, str]  # SHA-256 by name of file
    is_demos: bool

    @property
    def identity(self) -> dict[str, Any]:
        """What determines the set's bytes, as its manifest has it."""
        return {
            "options": plain(self.options),
            "settings": plain(self.settings),
            "sources": self.sources,
        }

    def check_task(self, task: str | None) -> None:
        """Raise `DemoError` if the source is of another task."""
        found = self.settings.source.task
        if task not in (None, found):
            raise DemoError(f"{str(self.folder)!r} is of task {found}, not {shown(task)}")

    def check_same(self, folder: Path) -> None:
        """Raise `DemoError` unless the set in a folder was made from the same."""
        there = plain(read_set_manifest(folder))
        here = self.identity
        if self.is_demos:  # replayed with other versions, they would still be these demonstrations
            there["settings"]["versions"] = here["settings"]["versions"]
        found = differing({name: there[name] for name in here}, here)
        if found:
            raise DemoError(
                f"{str(folder)!r} is a training set made from something else ({'; '.join(found[:_MOST_NAMED])}); "
                "choose another folder, or remove it"
            )

    def training_files(self, replayed: Path, workers: int, on_progress: OnProgress | None) -> Path:
        """Return the folder of training files; of demonstrations they are made in the folder `replayed`."""
        if not self.is_demos:
            return self.folder
        done, total = 0, 0

        def on_replayed(_: object) -> None:
            nonlocal done
            done += 1
            if on_progress is not None:
                on_progress("replaying", done, total)

        def on_start(run: ReplayRun) -> None:
            nonlocal total
            total = run.missing

        replay(self.folder, replayed, self.settings, workers, self.options.objects, on_replayed, on_start)
        return replayed


def find_source(folder: Path, options: SetOptions) -> SetSource:
    """Return what a folder's manifest says that it holds, if a set can be made from it as the options say.

    Raises:
        DemoError: it holds something else, or of another control mode, method or frame.
        UnknownNameError: it has no such object.
    """
    try:
        kind = parse_json(read_bytes(folder / MANIFEST))["format"]
    except (OSError, ValueError, LookupError, TypeError):
        kind = None
    if kind == DEMONSTRATIONS.name:
        return _source_of_demos(folder, options)
    if kind == TRAINING.name:
        return _source_of_training_files(folder, options)
    found = "" if kind is None else f": its manifest's format is {shown(kind)}"
    raise DemoError(f"{str(folder)!r} holds neither training files nor demonstrations{found}")


def _source_of_demos(folder: Path, options: SetOptions) -> SetSource:
    demos = Demos(folder)
    source = demos.manifest.settings
    settings = ReplaySettings(
        source=source,
        obs_mode="pointcloud",
        control_mode=options.control_mode or source.control_mode,
        way=SIMULATE,
        sampling=make_sampling(options.num_points, options.method or "maniskill", options.frame or "world"),
        seen={},
        count=options.count,
        keep_failures=False,
        compression=1,
        versions=versions(),
    )
    sources = {name: entry.sha256 for name, entry, _ in select(demos, options.objects)}
    return SetSource(folder, options, settings, sources, True)


def _source_of_training_files(folder: Path, options: SetOptions) -> SetSource:
    found = TrainingFiles(folder)
    settings = found.settings
    if settings.obs_mode != "pointcloud":
        raise DemoError(
            f"{str(folder)!r} has training files of obs_mode {settings.obs_mode}, a set needs pointcloud: "
            "replay the demonstrations with --obs-mode pointcloud"
        )
    sampling = settings.sampling
    held = {
        "control mode": (settings.control_mode, options.control_mode),
        "method": ("maniskill" if sampling is None else sampling.method, options.method),
        "frame": ("world" if sampling is None else sampling.frame, options.frame),
    }
    for what, (here, wanted) in held.items():
        if wanted not in (None, here):
            raise DemoError(f"{str(folder)!r} has training files of {what} {here}, not {shown(wanted)}")
    entries = {entry.object: (name, entry.sha256) for name, entry in found.manifest.files.items()}
    for name in options.objects or ():
        check_name("object", name, entries, f"(of {str(folder)!r})")
    chosen = entries if options.objects is None else options.objects
    return SetSource(folder, options, settings, dict(sorted(entries[name] for name in chosen)), False)
