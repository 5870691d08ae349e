"""`artiskill demos`: its sub-commands, each with its options and what it does."""

import argparse
import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from artiskill.cli.demos_table import (
    note_unfinished,
    note_versions,
    print_collection,
    print_replay,
    print_stats,
    print_verify_results,
)
from artiskill.cli.parser import (
    UsageError,
    add_command,
    add_group,
    add_set,
    add_stored_task,
    add_workers,
    overrides_of,
    workers_of,
)
from artiskill.cli.progress import ProgressBar
from artiskill.tasks.levels import FIRST_DEMONSTRATED

if TYPE_CHECKING:
    from artiskill.assets.articulated_object import ArticulatedObject
    from artiskill.demos.demos import Demos, FileEntry, Manifest
    from artiskill.demos.plan import CollectionPlan
    from artiskill.demos.settings import Agent, Settings
    from artiskill.demos.training_file import ReplaySettings, Sampling
    from artiskill.jobs.ray_jobs import RayCluster

EXIT_FAULTS = EXIT_SHORT = 1
_COLLECT_EPILOG = """examples:
  artiskill demos collect --task PushChair --out demos/chairs
  artiskill demos collect --task OpenCabinetDoor --objects cabinet-0006 --targets link_1 --out demos/doors
  artiskill demos collect --task MoveBucket --control-mode operational_space --out demos/buckets-os
  artiskill demos collect --task PushChair --out demos/chairs --ray auto
  artiskill demos collect --task PushChair --objects chair-0002 --policy runs/chair --out demos/by-agents

After an interruption, the same command continues where it stopped. The exit status is 1 if an expert could not
solve an object often enough. docs/demonstrations.md describes the files."""
_VERIFY_EPILOG = """examples:
  artiskill demos verify demos/chairs
  artiskill demos verify demos               every folder of demonstrations in it

The exit status is 1 if anything is not as it was recorded. docs/demonstrations.md says what is compared."""
_STATS_EPILOG = """examples:
  artiskill demos stats demos/chairs
  artiskill demos stats demos --json demos/stats.json

docs/demonstrations.md says what the columns are."""
_REPLAY_EPILOG = """examples:
  artiskill demos replay demos/chairs --out training/chairs --obs-mode pointcloud
  artiskill demos replay demos/chairs --out training/full --obs-mode pointcloud --points all --count 5
  artiskill demos replay demos/drawers --out training/os --obs-mode state --control-mode operational_space

After an interruption, the same command continues where it stopped. docs/training_files.md describes the files."""
_EXPORT_EPILOG = """examples:
  artiskill demos export training/chairs --format minari --out ~/.minari/datasets
  artiskill demos export training/chairs --format lerobot --out exported/lerobot --name artiskill/chairs

PATH is a folder that `artiskill demos replay` has made. docs/training_files.md says what is where."""
_PICTURES_EPILOG = """examples:
  artiskill demos pictures demos/chairs --object chair-0004 --out chair.png
  artiskill demos pictures demos/doors --object cabinet-0006 --target link_1 --count 3 --out door.png"""

_FOLDERS = "a folder of demonstrations, or one with such folders"


def add_commands(commands: Any) -> None:
    """Add `demos` and its sub-commands."""
    subcommands = add_group(commands, "demos", "collect, verify, count, replay, export and draw demonstrations")
    for add in (_add_collect, _add_verify, _add_stats, _add_replay, _add_export, _add_pictures):
        add(subcommands)


def _add_collect(commands: Any) -> None:
    summary = "have experts demonstrate a task"
    parser = add_command(commands, "collect", _collect, summary, _COLLECT_EPILOG)
    add = parser.add_argument
    add("--task", required=True, help="name of the task, or module:Task of your own package")
    add("--out", type=Path, required=True, metavar="FOLDER", help="folder of this task's demonstrations")
    add("--objects", nargs="+", default=["train"], help="splits, ids, PartNet folders (default: train)")
    add(
        "--per-object",
        type=int,
        help="successful trajectories of each object, shared by its targets (default: 300)",
    )
    add("--per-target", type=int, help="successful trajectories of each target link, instead")
    add("--targets", nargs="+", metavar="LINK", help="demonstrate only these links (default: all)")
    add("--control-mode", default="joint", help="joint or operational_space (default: %(default)s)")
    summary = "first level of each object (default: %(default)s, as evaluations play from 0 on)"
    add("--first-level", "--seed", type=int, default=FIRST_DEMONSTRATED, help=summary)
    add("--keep-failures", action="store_true", help="store failed attempts, too")
    add("--policy", metavar="RUN", help="run of sac or ppo that demonstrates instead of the expert")
    add("--plain", action="store_true", help="never vary the expert's style, and never disturb it")
    add_set(parser, "values of the task's settings, see `artiskill config`")
    add("--workers", type=int, help="processes (default: one per core, of a cluster: per CPU)")
    add("--ray", metavar="ADDRESS", help="work on a Ray cluster: HOST:PORT, auto or local")


def _collect(arguments: argparse.Namespace) -> int:
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
        agent=None if arguments.policy is None else _agent(arguments),
    )
    plan = make_plan(arguments.task, arguments.objects, options, config=overrides_of(arguments.set))
    manifest = _collect_with_progress(plan, arguments.out, workers_of(arguments), cluster)
    return EXIT_SHORT if print_collection(plan, manifest, arguments.out) else 0


def _agent(arguments: argparse.Namespace) -> "Agent":
    """Return the run that demonstrates.

    Raises:
        UsageError: it is of another task, or sees no state; or options do not go together.
        PolicyError: there is no run, or it is damaged.
    """
    from functools import partial

    from artiskill.demos.settings import Agent
    from artiskill.learning.run import FROM_STATE, load_run, read_info, run_folder, weights_digest

    load_run(arguments.policy)
    info = read_info(run_folder(arguments.policy))
    if info.algorithm not in FROM_STATE:
        raise UsageError(f"--policy takes runs of {' and '.join(FROM_STATE)}, not of {info.algorithm}")
    if info.task != arguments.task:
        raise UsageError(f"{arguments.policy!r} learned {info.task}, not {arguments.task}")
    if arguments.control_mode != info.control_mode:
        raise UsageError(f"{arguments.policy!r} acts in control mode {info.control_mode}")
    if arguments.ray is not None:
        raise UsageError("--policy and --ray do not go together: machines may lack the run")
    path = Path(arguments.policy).resolve()
    return Agent(info.algorithm, weights_digest(path), partial(load_run, path))


def _collect_with_progress(
    plan: "CollectionPlan", folder: Path, workers: int, cluster: "RayCluster | None"
) -> "Manifest":
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
            return collect(plan, folder, workers, on_attempt, on_start, cluster)
        except KeyboardInterrupt as interrupt:
            raise KeyboardInterrupt(f"interrupted; {KEPT}") from interrupt


def _add_verify(commands: Any) -> None:
    summary = "simulate demonstrations again and compare every bit"
    parser = add_command(commands, "verify", _verify, summary, _VERIFY_EPILOG)
    add = parser.add_argument
    add("path", type=Path, help=_FOLDERS)
    add("--objects", nargs="+", metavar="FOLDER", default=[], help="imported objects that cannot be found by name")
    add_stored_task(parser)
    add_workers(parser)


def _verify(arguments: argparse.Namespace) -> int:
    from artiskill.assets.catalog import load_object
    from artiskill.demos.demos import find_folders, read_manifest
    from artiskill.demos.verify import verify

    folders = find_folders(arguments.path)
    objects = [load_object(name) for name in arguments.objects]
    total = sum(entry.trajectories for folder in folders for entry in read_manifest(folder).files.values())
    results = []
    with ProgressBar("verifying", max(total, 1), "trajectories") as progress:
        for folder in folders:
            results += verify(folder, workers_of(arguments), lambda exact: progress.advance(), objects)
    print_verify_results(results)
    for folder in folders:
        note_unfinished(folder)
        note_versions(folder, read_manifest(folder).settings)
    return EXIT_FAULTS if any(result.faults for result in results) else 0


def _add_stats(commands: Any) -> None:
    summary = "count demonstrations: success rates, lengths, sizes, coverage"
    parser = add_command(commands, "stats", _stats, summary, _STATS_EPILOG)
    parser.add_argument("path", type=Path, help=_FOLDERS)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers to this file")


def _stats(arguments: argparse.Namespace) -> None:
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


def _add_replay(commands: Any) -> None:
    summary = "make training files: observations, control mode, down-sampling"
    parser = add_command(commands, "replay", _replay, summary, _REPLAY_EPILOG)
    add = parser.add_argument
    add("path", type=Path, help="a folder of demonstrations")
    add("--out", type=Path, required=True, metavar="FOLDER", help="folder of the training files")
    add("--obs-mode", required=True, help="state, pointcloud or rgbd")
    add("--points", help="number of points, or `all` (default: 1200)")
    add("--method", help="how points are chosen: maniskill, shares, uniform, voxel or fps (default: maniskill)")
    add("--frame", help="frame of the points: world, robot or end_effector (default: world)")
    add("--control-mode", help="joint or operational_space (default: the demonstrations')")
    way = parser.add_mutually_exclusive_group()
    way.add_argument(
        "--simulate", dest="way", action="store_const", const="simulate", help="play the actions again (default)"
    )
    way.add_argument(
        "--restore", dest="way", action="store_const", const="restore", help="restore the recorded states instead"
    )
    parser.set_defaults(way="simulate")
    add("--objects", nargs="+", metavar="OBJECT", help="replay only these: ids, or PartNet folders")
    add(
        "--count",
        type=int,
        help="number of successes per object, or of attempts if failures are kept (default: all)",
    )
    add("--keep-failures", action="store_true", help="keep trajectories that are no longer solved, too")
    add("--compression", type=int, default=1, help="gzip level, 0 to 9 (default: %(default)s)")
    add_set(parser, "values of the settings cameras.*, render.* and, of cabinets, state.*")
    add_stored_task(parser)
    add_workers(parser)


def _replay(arguments: argparse.Namespace) -> int:
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

        workers = workers_of(arguments)
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
        sampling=_sampling(arguments, source),
        seen=seen,
        count=arguments.count,
        keep_failures=arguments.keep_failures,
        compression=arguments.compression,
        versions=versions(),
    )


def _sampling(arguments: argparse.Namespace, source: "Settings") -> "Sampling | None":
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
    method, frame = arguments.method or "maniskill", arguments.frame or "world"
    return make_sampling(number, method, frame, task=source.make_task())


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


def _add_export(commands: Any) -> None:
    summary = "export training files as a Minari dataset or a LeRobotDataset"
    parser = add_command(commands, "export", _export, summary, _EXPORT_EPILOG)
    add = parser.add_argument
    add("path", type=Path, help="a folder of training files")
    add("--format", required=True, choices=("minari", "lerobot"), metavar="FORMAT", help="minari or lerobot")
    add("--out", type=Path, required=True, metavar="HOME", help="the library's folder of datasets")
    add("--name", help="id of the dataset, which is its folder in HOME")
    add_stored_task(parser)


def _export(arguments: argparse.Namespace) -> None:
    from artiskill.demos.export import export_dataset
    from artiskill.demos.training_file import TrainingFiles

    training = TrainingFiles(arguments.path)
    with ProgressBar(f"writing {arguments.format}", max(len(training), 1), "trajectories") as progress:
        path = export_dataset(training, arguments.out, arguments.format, arguments.name, progress.advance)
    print(f"{len(training)} trajectories: {path}")
    note_unfinished(arguments.path, "replayed")


def _add_pictures(commands: Any) -> None:
    summary = "draw the most different demonstrations of an object, a row each"
    parser = add_command(commands, "pictures", _pictures, summary, _PICTURES_EPILOG)
    add = parser.add_argument
    add("path", type=Path, help="a folder of demonstrations")
    add("--object", required=True, help="id, or a PartNet folder")
    add("--out", type=Path, required=True, metavar="FILE", help=".png or .jpg")
    add("--target", metavar="LINK", help="draw only demonstrations of this link")
    add("--count", type=int, default=5, help="number of demonstrations (default: %(default)s)")
    add("--moments", type=int, default=5, help="number of pictures of each (default: %(default)s)")
    add("--view", default="world", help="world, sensor, cloud, all or points (default: %(default)s)")
    add("--width", type=int, default=320, help="width of a picture in pixels (default: %(default)s)")
    add("--azimuth", type=float, metavar="DEG", help="direction of the camera, from +x counterclockwise")
    add("--elevation", type=float, metavar="DEG", help="elevation of the camera above the horizon")
    add("--distance", type=float, metavar="METRES", help="distance of the camera from its target")
    add_stored_task(parser)


def _pictures(arguments: argparse.Namespace) -> None:
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
