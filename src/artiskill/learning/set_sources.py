"""What a training set is made from: training files, or demonstrations that are replayed first; and its points.

A set may have fewer points than its training files, as if the sensor had been asked for so few. The rows of a
sampled cloud stand in the order of drawing, so the first ones are a sample, too. Drawing anew from a sample by
`maniskill` would draw the points of small masks twice as often as the sensor does: they are a larger share of the
sample than of the cloud.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.config import check, differing
from artiskill.demos.demos import MANIFEST, Demos
from artiskill.demos.file_format import DEMONSTRATIONS, TRAINING
from artiskill.demos.replay import ReplayRun, replay, select
from artiskill.demos.settings import plain
from artiskill.demos.training_file import (
    SHARES,
    SIMULATE,
    ReplaySettings,
    Sampling,
    TrainingFiles,
    make_sampling,
)
from artiskill.errors import DemoError, check_name, shown
from artiskill.files import parse_json, read_bytes
from artiskill.learning.observation import REAL
from artiskill.learning.training_set import read_set_manifest
from artiskill.sensors.observations.sampling import (
    ManiskillSampler,
    Sampler,
    ShareSampler,
    downsample,
    make_sampler,
)
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.point_shares import shared_out
from artiskill.versions import versions

_MOST_NAMED = 3  # differences
_POINTS = 256  # of a cloud, where no number is given
_COUNTS = ("masked_points", "points_per_mask")  # settings that are numbers of points
OnProgress = Callable[[str, int, int], None]  # what is done, how many trajectories of how many


@dataclass(frozen=True)
class SetOptions:
    """What a training set is made of, and how.

    Control mode, method and frame belong to the training files; where demonstrations are given, None means their
    control mode, `maniskill` and `world`.
    """

    num_points: int | None = None  # of a cloud; None for 256, or all where training files have fewer
    objects: tuple[str, ...] | None = None  # only these; None for all
    count: int | None = None  # successes of each object, evenly of its targets; None for all
    control_mode: str | None = None
    method: str | None = None  # of choosing points
    frame: str | None = None  # of the points

    def __post_init__(self) -> None:
        points = self.num_points
        check(points is None or points >= 1, f"the number of points must be at least 1, not {points}")
        check(self.count is None or self.count >= 1, f"the count must be at least 1, not {self.count}")


@dataclass(frozen=True)
class SetSource:
    """What a set is made from."""

    folder: Path
    options: SetOptions
    num_points: int  # of a cloud
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
    num_points = options.num_points or _POINTS
    settings = ReplaySettings(
        source=source,
        obs_mode="pointcloud",
        control_mode=options.control_mode or source.control_mode,
        way=SIMULATE,
        sampling=make_sampling(
            num_points, options.method or "maniskill", options.frame or "world", task=source.make_task()
        ),
        seen={},
        count=options.count,
        keep_failures=False,
        compression=1,
        versions=versions(),
    )
    sources = {name: entry.sha256 for name, entry, _ in select(demos, options.objects)}
    return SetSource(folder, replace(options, num_points=num_points), num_points, settings, sources, True)


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
    num_points = options.num_points or (_POINTS if sampling is None else min(_POINTS, sampling.num_points))
    options, sources = replace(options, num_points=num_points), dict(sorted(entries[name] for name in chosen))
    return SetSource(folder, options, num_points, settings, sources, False)


def thinned_sampling(sampling: Sampling | None, num_points: int) -> Sampling:
    """Return the sampling of so many points that is like another one; None for the full cloud's.

    Raises:
        ConfigError: the other one has fewer points, or they are no legal number.
    """
    if sampling is None:
        return Sampling(num_points)
    had = sampling.num_points
    check(
        num_points <= had, f"the training files have {had} points each: choose at most so many, not {num_points}"
    )
    settings = {
        name: value * num_points // had if name in _COUNTS else value for name, value in sampling.settings.items()
    }
    if sampling.method == SHARES:
        settings["shares"] = shared_out(num_points, sampling.settings.get("shares", (1,)))
    return Sampling(num_points, sampling.method, sampling.frame, settings)


class Thinner:
    """Keeps some points of each cloud of a training file.

    Args:
        source: sampling of the file; None for full clouds.
        num_points: that are kept.

    Attributes:
        sampling: of the result, as an environment is to be given it.

    Raises:
        ConfigError: see `thinned_sampling`.
    """

    def __init__(self, source: Sampling | None, num_points: int) -> None:
        self._source = source
        self.sampling = thinned_sampling(source, num_points)
        self._sampler = _sampler_of(self.sampling)
        self._had = None if source is None else _sampler_of(source)

    def thin(self, clouds: Mapping[str, np.ndarray], level: int, first_step: int) -> dict[str, np.ndarray]:
        """Return fewer points of the clouds of consecutive steps.

        Args:
            clouds: `xyz` (F, P, 3), `rgb` (F, P, 3) and `seg` (F, P, K).
            level: of the episode.
            first_step: of the episode, from 0; that of the first cloud.

        Returns:
            The same with `num_points` rows each; rows of zeros at the end where there are too few.
        """
        if self._had is not None and self._had.num_points == self.sampling.num_points:
            return dict(clouds)
        frames = len(clouds["xyz"])
        made = {
            name: np.zeros((frames, self.sampling.num_points, values.shape[2]), dtype=values.dtype)
            for name, values in clouds.items()
        }
        codes = None if self._had is None else _codes(clouds)
        for row in range(frames):
            if codes is None:  # bit for bit what the environment gives
                rng = level_generator(level, RngStream.POINTS, first_step + row)
                xyz, rgb, seg = (clouds[name][row] for name in ("xyz", "rgb", "seg"))
                for name, values in downsample(xyz, rgb, seg, self._sampler, rng).items():
                    made[name][row] = values
            else:
                chosen = self._choose(codes[row], level, first_step + row)
                for name, values in clouds.items():
                    made[name][row, : len(chosen)] = values[row, chosen]
        return made

    def _choose(self, codes: np.ndarray, level: int, step: int) -> np.ndarray:
        had, wanted = self._had, self._sampler
        if isinstance(wanted, ShareSampler):  # of a sample that has so many of each mask, or all that were seen
            return wanted.choose(codes, _no_positions, level_generator(level, RngStream.POINTS, step))
        if not (isinstance(had, ManiskillSampler) and isinstance(wanted, ManiskillSampler)):
            return np.flatnonzero(codes)[: wanted.num_points]
        if np.count_nonzero(codes > REAL) < had.masked_points:  # every masked point that was seen is there
            rng = level_generator(level, RngStream.POINTS, step)
            return wanted.choose(codes, _no_positions, rng)
        return choose_first_drawn(codes, had, wanted)


def choose_first_drawn(codes: np.ndarray, had: ManiskillSampler, wanted: ManiskillSampler) -> np.ndarray:
    """Return indices of the points that were drawn first: of each mask, of all masks together, and of the rest.

    Args:
        codes: (P,) uint8 in the order of drawing; bit k: in mask k, `REAL`: no padding.
        had: how they were drawn; there are `masked_points` masked ones.
        wanted: how many are to be kept.
    """
    masked = np.flatnonzero(codes > REAL)
    first: list[np.ndarray] = []
    start = 0
    for mask in range(7):
        outside = np.flatnonzero((codes[masked[start : start + had.points_per_mask]] >> mask) & 1 == 0)
        size = int(outside[0]) if len(outside) else min(had.points_per_mask, len(masked) - start)
        first.append(masked[start : start + min(size, wanted.points_per_mask)])
        start += size
    kept = np.concatenate(first)
    others = masked[start:][: wanted.masked_points - len(kept)]
    unmasked = np.flatnonzero(codes == REAL)[: wanted.num_points - len(kept) - len(others)]
    return np.concatenate([kept, others, unmasked])


def _codes(clouds: Mapping[str, np.ndarray]) -> np.ndarray:
    bits = np.left_shift(np.uint8(1), np.arange(clouds["seg"].shape[-1], dtype=np.uint8))
    codes = (clouds["seg"] * bits).sum(axis=-1, dtype=np.uint8)
    return np.where(clouds["xyz"].any(axis=-1), codes | REAL, np.uint8(0))


def _sampler_of(sampling: Sampling) -> Sampler:
    return make_sampler(sampling.method, sampling.num_points, sampling.all_settings)


def _no_positions(indices: np.ndarray) -> np.ndarray:
    raise AssertionError("this method asks for no positions")


def sampling_values(sampling: Sampling) -> dict[str, Any]:
    """Return a sampling as a manifest stores it, all settings resolved."""
    return {
        "num_points": sampling.num_points,
        "method": sampling.method,
        "frame": sampling.frame,
        "settings": sampling.all_settings,
    }
