"""`artiskill demos replay`: training files with other observations, another control mode, fewer points."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from artiskill.assets.articulated_object import ArticulatedObject
    from artiskill.demos.demos import Demos
    from artiskill.demos.manifest import FileEntry
    from artiskill.demos.replay.settings import ReplaySettings

_EPILOG = """examples:
  artiskill demos replay demos/chairs --out training/chairs --obs-mode pointcloud
  artiskill demos replay demos/chairs --out training/full --obs-mode pointcloud --points all --count 5
  artiskill demos replay demos/drawers --out training/os --obs-mode state --control-mode operational_space

Stopped at any moment, the same command goes on from there. docs/demonstrations.md describes the files."""


def add_command(commands: Any) -> None:
    """Describe the sub-command."""
    parser = commands.add_parser(
        "replay",
        help="make training files: observations, control mode, down-sampling",
        description="Replay demonstrations into training files.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("path", type=Path, help="a folder of demonstrations")
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="for the training files")
    parser.add_argument("--obs-mode", required=True, help="state, pointcloud or rgbd")
    parser.add_argument("--points", help="of a cloud, or `all` (default: 1200)")
    parser.add_argument("--method", help="maniskill, uniform, voxel or fps (default: maniskill)")
    parser.add_argument("--frame", help="of the points: world, robot or end_effector (default: world)")
    parser.add_argument("--control-mode", help="joint or operational_space (default: the demonstrations')")
    way = parser.add_mutually_exclusive_group()
    way.add_argument("--simulate", dest="way", action="store_const", const="simulate", help="the default")
    way.add_argument(
        "--restore", dest="way", action="store_const", const="restore", help="put recorded states in place instead"
    )
    parser.add_argument("--objects", nargs="+", metavar="OBJECT", help="only these: ids, or PartNet folders")
    parser.add_argument(
        "--count", type=int, help="successes of each object, or attempts if failures are kept (default: all)"
    )
    parser.add_argument("--keep-failures", action="store_true", help="keep what is no longer solved, too")
    parser.add_argument("--compression", type=int, default=1, help="level of gzip, 0 to 9 (default: %(default)s)")
    parser.add_argument(
        "--set",
        nargs="+",
        action="extend",
        default=[],
        metavar="KEY=VALUE",
        help="cameras.* and render.* settings",
    )
    parser.add_argument("--workers", type=int, help="processes (default: one per core)")
    parser.set_defaults(run=run, way="simulate")


def run(arguments: argparse.Namespace) -> int:
    """Check everything, replay, show what came of it; the exit status."""
    from artiskill.cli.demos_table import note_unfinished, note_versions, print_replay
    from artiskill.cli.parser import overrides_of
    from artiskill.cli.progress import Progress
    from artiskill.demos.demos import Demos
    from artiskill.demos.replay.blocks import Replayed
    from artiskill.demos.replay.choice import select
    from artiskill.demos.replay.replay import Replaying, replay
    from artiskill.demos.replay.settings import SIMULATE
    from artiskill.jobs.parallel import available_cores

    demos = Demos(arguments.path)
    settings = settings_of(arguments, demos, overrides_of(arguments.set))
    objects = None if arguments.objects is None else [find_object(name, demos) for name in arguments.objects]
    workers = available_cores() if arguments.workers is None else arguments.workers
    title = f"{settings.source.task}, {settings.obs_mode}, {settings.control_mode}"
    total = sum(_wanted(entry, settings) for _, entry, _ in select(demos, objects))
    frames, start = 0, time.perf_counter()
    with Progress(title, max(total, 1), "trajectories") as progress:

        def on_start(replaying: Replaying) -> None:
            progress.skip(total - replaying.missing)

        def on_replayed(news: Replayed) -> None:
            nonlocal frames
            frames += news.frames
            if news.fault:
                progress.say(news.fault)
            progress.advance(news.success)

        manifest = replay(arguments.path, arguments.out, settings, workers, objects, on_replayed, on_start)
    print_replay(manifest, arguments.out, frames, time.perf_counter() - start)
    note_unfinished(arguments.path)
    if settings.way == SIMULATE:
        note_versions(arguments.path, demos.manifest.settings)
    return 0


def _wanted(entry: "FileEntry", settings: "ReplaySettings") -> int:
    """How many trajectories of an object are replayed."""
    if settings.count is None:
        return entry.trajectories
    successes = sum(target.successes for target in entry.targets)
    return min(settings.count, entry.trajectories if settings.keep_failures else successes)


def settings_of(arguments: argparse.Namespace, demos: "Demos", seen: dict[str, Any]) -> "ReplaySettings":
    """What the options mean."""
    from artiskill.cli.parser import UsageError
    from artiskill.demos.replay.settings import ReplaySettings, make_sampling
    from artiskill.versions import versions

    chosen = {"--points": arguments.points, "--method": arguments.method, "--frame": arguments.frame}
    sampling = None
    if arguments.obs_mode == "pointcloud":
        sampling = make_sampling(
            _points(arguments.points), arguments.method or "maniskill", arguments.frame or "world"
        )
    elif any(chosen.values()):
        name = next(name for name, value in chosen.items() if value)
        raise UsageError(f"{name} is for --obs-mode pointcloud, not for {arguments.obs_mode!r}")
    source = demos.manifest.settings
    return ReplaySettings(
        source=source,
        obs_mode=arguments.obs_mode,
        control_mode=arguments.control_mode or source.control_mode,
        way=arguments.way,
        sampling=sampling,
        seen=seen,
        count=arguments.count,
        keep_failures=arguments.keep_failures,
        compression=arguments.compression,
        versions=versions(),
    )


def _points(given: str | None) -> int | None:
    from artiskill.cli.parser import UsageError

    if given == "all":
        return None
    try:
        return 1200 if given is None else int(given)
    except ValueError as error:
        raise UsageError(f"--points is a number or `all`, not {given!r}") from error


def find_object(name: str, demos: "Demos") -> "str | ArticulatedObject":
    """An id that the demonstrations have, or what else the name leads to."""
    from artiskill.assets.catalog import load_object
    from artiskill.errors import ArtiSkillError, UnknownNameError

    if name in demos.objects:
        return name
    try:
        return load_object(name)
    except ArtiSkillError as error:
        raise UnknownNameError("object", name, demos.objects, f"(of {str(demos.folder)!r})") from error
