"""The sub-commands of `artiskill demos`: each checks its options, works, and prints what came of it."""

import argparse
import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from artiskill.assets.articulated_object import ArticulatedObject
    from artiskill.demos.demos import Demos, FileEntry, Manifest
    from artiskill.demos.plan import CollectionPlan
    from artiskill.demos.training_file import ReplaySettings, Sampling
    from artiskill.jobs.ray_jobs import RayCluster

EXIT_FAULTS = EXIT_SHORT = 1


def run_collect(arguments: argparse.Namespace) -> int:
    """Collect demonstrations; 1 if an expert could not solve an object often enough."""
    from artiskill.cli.demos_table import print_collection
    from artiskill.cli.parser import overrides_of
    from artiskill.demos.hdf5 import load_h5py
    from artiskill.demos.plan import CollectionOptions, make_plan
    from artiskill.jobs.ray_jobs import RayCluster

    load_h5py()  # it is needed in the end: better said now
    cluster = None if arguments.ray is None else RayCluster(arguments.ray, arguments.workers)
    if cluster is not None:
        cluster.check()
    options = CollectionOptions(
        per_object=arguments.per_object,
        per_target=arguments.per_target,
        targets=arguments.targets,
        control_mode=arguments.control_mode,
        first_level=arguments.first_level,
        keep_failures=arguments.keep_failures,
        variety=not arguments.plain,
    )
    plan = make_plan(arguments.task, arguments.objects, options, config=overrides_of(arguments.set))
    manifest = _collect(plan, arguments.out, arguments.workers, cluster)
    return EXIT_SHORT if print_collection(plan, manifest, arguments.out) else 0


def _collect(
    plan: "CollectionPlan", folder: Path, workers: int | None, cluster: "RayCluster | None"
) -> "Manifest":
    from artiskill.cli.progress import ProgressBar
    from artiskill.demos.collect import Collection, collect
    from artiskill.demos.demonstrator import DemoAttempt
    from artiskill.demos.demos import KEPT

    total = sum(plan.wanted(one) for one in plan.objects)
    with ProgressBar(f"{plan.settings.task}, {plan.settings.control_mode}", total, "trajectories") as progress:

        def on_start(collection: Collection) -> None:
            progress.skip(total - collection.missing)

        def on_attempt(attempt: DemoAttempt) -> None:
            progress.attempt(attempt.success)

        try:
            return collect(plan, folder, _workers(workers), on_attempt, on_start, cluster)
        except KeyboardInterrupt as interrupt:
            raise KeyboardInterrupt(f"interrupted; {KEPT}") from interrupt


def _workers(given: int | None) -> int:
    from artiskill.jobs.parallel import available_cores

    return available_cores() if given is None else given


def run_verify(arguments: argparse.Namespace) -> int:
    """Simulate demonstrations again and compare; 1 if anything differs."""
    from artiskill.assets.catalog import load_object
    from artiskill.cli.demos_table import note_unfinished, note_versions, print_verify_results
    from artiskill.cli.progress import ProgressBar
    from artiskill.demos.demos import find_folders, read_manifest
    from artiskill.demos.verify import verify

    folders = find_folders(arguments.path)
    objects = [load_object(name) for name in arguments.objects]
    total = sum(entry.trajectories for folder in folders for entry in read_manifest(folder).files.values())
    results = []
    with ProgressBar("verifying", max(total, 1), "trajectories") as progress:
        for folder in folders:
            results += verify(folder, _workers(arguments.workers), lambda exact: progress.advance(), objects)
    print_verify_results(results)
    for folder in folders:
        note_unfinished(folder)
        note_versions(folder, read_manifest(folder).settings)
    return EXIT_FAULTS if any(result.faults for result in results) else 0


def run_stats(arguments: argparse.Namespace) -> None:
    """Count demonstrations."""
    from artiskill.cli.demos_table import note_unfinished, print_stats
    from artiskill.cli.progress import ProgressBar
    from artiskill.demos.demos import find_folders, read_manifest
    from artiskill.demos.stats import folder_stats

    folders = find_folders(arguments.path)
    total = sum(len(read_manifest(folder).files) for folder in folders)
    with ProgressBar("reading", max(total, 1), "files") as progress:
        found = [folder_stats(folder, progress.advance) for folder in folders]
    for folder, stats in zip(folders, found, strict=True):
        print_stats(stats)
        note_unfinished(folder)
    if arguments.json is not None:
        _write_json([stats.to_mapping() for stats in found], arguments.json)
        print(f"numbers: {arguments.json}")


def _write_json(content: Any, path: Path) -> None:
    from artiskill.errors import ConfigError
    from artiskill.files import atomic_write

    try:
        with atomic_write(path) as temporary:
            temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"cannot write {str(path)!r}: {error.strerror or error}") from error


def run_replay(arguments: argparse.Namespace) -> int:
    """Make training files."""
    from artiskill.cli.demos_table import note_unfinished, note_versions, print_replay
    from artiskill.cli.parser import overrides_of
    from artiskill.cli.progress import ProgressBar
    from artiskill.demos.demos import Demos
    from artiskill.demos.replay import ReplayRun, replay, select
    from artiskill.demos.replay_jobs import ReplayedTrajectory
    from artiskill.demos.training_file import SIMULATE

    demos = Demos(arguments.path)
    settings = replay_settings(arguments, demos, overrides_of(arguments.set))
    objects = None if arguments.objects is None else [_find_object(name, demos) for name in arguments.objects]
    title = f"{settings.source.task}, {settings.obs_mode}, {settings.control_mode}"
    total = sum(_wanted(entry, settings) for _, entry, _ in select(demos, objects))
    frames, start = 0, time.perf_counter()
    with ProgressBar(title, max(total, 1), "trajectories") as progress:

        def on_start(run: ReplayRun) -> None:
            progress.skip(total - run.missing)

        def on_replayed(replayed: ReplayedTrajectory) -> None:
            nonlocal frames
            frames += replayed.frames
            if replayed.fault:
                progress.print(replayed.fault)
            progress.advance(replayed.success)

        workers = _workers(arguments.workers)
        manifest = replay(arguments.path, arguments.out, settings, workers, objects, on_replayed, on_start)
    print_replay(manifest, arguments.out, frames, time.perf_counter() - start)
    note_unfinished(arguments.path)
    if settings.way == SIMULATE:
        note_versions(arguments.path, demos.manifest.settings)
    return 0


def replay_settings(arguments: argparse.Namespace, demos: "Demos", seen: dict[str, Any]) -> "ReplaySettings":
    """Return what the options of `replay` mean."""
    from artiskill.demos.training_file import ReplaySettings
    from artiskill.versions import versions

    source = demos.manifest.settings
    return ReplaySettings(
        source=source,
        obs_mode=arguments.obs_mode,
        control_mode=arguments.control_mode or source.control_mode,
        way=arguments.way,
        sampling=_sampling(arguments),
        seen=seen,
        count=arguments.count,
        keep_failures=arguments.keep_failures,
        compression=arguments.compression,
        versions=versions(),
    )


def _sampling(arguments: argparse.Namespace) -> "Sampling | None":
    from artiskill.cli.parser import UsageError
    from artiskill.demos.training_file import make_sampling

    if arguments.obs_mode != "pointcloud":
        for name in ("points", "method", "frame"):
            if getattr(arguments, name):
                raise UsageError(f"--{name} is for --obs-mode pointcloud, not for {arguments.obs_mode!r}")
        return None
    points = 1200 if arguments.points is None else arguments.points
    try:
        number = None if points == "all" else int(points)
    except ValueError as error:
        raise UsageError(f"--points is a number or `all`, not {points!r}") from error
    return make_sampling(number, arguments.method or "maniskill", arguments.frame or "world")


def _wanted(entry: "FileEntry", settings: "ReplaySettings") -> int:
    """Return how many trajectories of an object are replayed."""
    if settings.count is None:
        return entry.trajectories
    successes = sum(target.successes for target in entry.targets)
    return min(settings.count, entry.trajectories if settings.keep_failures else successes)


def _find_object(name: str, demos: "Demos") -> "str | ArticulatedObject":
    """Return an id that the demonstrations have, or what else the name leads to."""
    from artiskill.assets.catalog import load_object
    from artiskill.errors import ArtiSkillError, UnknownNameError

    if name in demos.objects:
        return name
    try:
        return load_object(name)
    except ArtiSkillError as error:
        raise UnknownNameError("object", name, demos.objects, f"(of {str(demos.folder)!r})") from error


def run_export(arguments: argparse.Namespace) -> None:
    """Export training files."""
    from artiskill.cli.demos_table import note_unfinished
    from artiskill.cli.progress import ProgressBar
    from artiskill.demos.export import export_dataset
    from artiskill.demos.training_file import TrainingFiles

    training = TrainingFiles(arguments.path)
    with ProgressBar(f"writing {arguments.format}", max(len(training), 1), "trajectories") as progress:
        path = export_dataset(training, arguments.out, arguments.format, arguments.name, progress.advance)
    print(f"{len(training)} trajectories: {path}")
    note_unfinished(arguments.path, "replayed")


def run_pictures(arguments: argparse.Namespace) -> None:
    """Draw the most different demonstrations of an object."""
    from artiskill.demos.demos import Demos
    from artiskill.envs.rendering import Viewpoint
    from artiskill.evaluation.pictures import save_demos_picture
    from artiskill.evaluation.scene_pictures import PictureStyle

    demos = Demos(arguments.path)
    found = _find_object(arguments.object, demos)
    name, given = (found, None) if isinstance(found, str) else (found.id, found)
    sensor = arguments.view == "sensor"
    style = PictureStyle(
        view=arguments.view,
        width=None if sensor else arguments.width,
        height=None if sensor else arguments.width * 3 // 4,
        viewpoint=Viewpoint(arguments.azimuth, arguments.elevation, arguments.distance),
    )
    with demos.open(name) as file:
        numbers = save_demos_picture(
            arguments.out, file, style, arguments.count, arguments.moments, arguments.target, given
        )
    print(f"{arguments.out}: {name}, demonstrations {', '.join(map(str, numbers))}")
