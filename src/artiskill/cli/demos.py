"""`artiskill demos`: the options of its sub-commands; `demos_run.py` does what they say."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from artiskill.cli import demos_run
from artiskill.cli.parser import add_group

_COLLECT_EPILOG = """examples:
  artiskill demos collect --task PushChair --out demos/chairs
  artiskill demos collect --task OpenCabinetDoor --objects cabinet-0006 --targets link_1 --out demos/doors
  artiskill demos collect --task MoveBucket --control-mode operational_space --out demos/buckets-os
  artiskill demos collect --task PushChair --out demos/chairs --ray auto

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

After an interruption, the same command continues where it stopped. docs/demonstrations.md describes the files."""
_EXPORT_EPILOG = """examples:
  artiskill demos export training/chairs --format minari --out ~/.minari/datasets
  artiskill demos export training/chairs --format lerobot --out exported/lerobot --name artiskill/chairs

PATH is a folder that `artiskill demos replay` has made. docs/demonstrations.md says what is where."""
_PICTURES_EPILOG = """examples:
  artiskill demos pictures demos/chairs --object chair-0004 --out chair.png
  artiskill demos pictures demos/doors --object cabinet-0006 --target link_1 --count 3 --out door.png"""

_FOLDERS = "a folder of demonstrations, or one with such folders"


def add_commands(commands: Any) -> None:
    """Describe the command and its sub-commands."""
    subcommands = add_group(commands, "demos", "collect, verify, count, replay, export and draw demonstrations")
    for add in (_add_collect, _add_verify, _add_stats, _add_replay, _add_export, _add_pictures):
        add(subcommands)
    for child in subcommands.choices.values():
        child.set_defaults(parser=child)
        child.add_argument("--debug", action="store_true", help="show the traceback of an error")


def _add_parser(
    commands: Any, name: str, run: Callable[[Any], int | None], summary: str, about: str, epilog: str
) -> Any:
    parser = commands.add_parser(
        name,
        help=summary,
        description=about,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
    return parser


def _add_collect(commands: Any) -> None:
    summary = "have experts demonstrate a task"
    about = "Have experts demonstrate a task, and store what they do."
    parser = _add_parser(commands, "collect", demos_run.run_collect, summary, about, _COLLECT_EPILOG)
    add = parser.add_argument
    add("--task", required=True, help="name of the task")
    add("--out", type=Path, required=True, metavar="FOLDER", help="of this task's demonstrations")
    add("--objects", nargs="+", default=["train"], help="splits, ids, PartNet folders (default: train)")
    add("--per-object", type=int, help="successful trajectories, which its targets share (default: 300)")
    add("--per-target", type=int, help="successful trajectories of each target link instead")
    add("--targets", nargs="+", metavar="LINK", help="only these links (default: all)")
    add("--control-mode", default="joint", help="joint or operational_space (default: %(default)s)")
    add("--first-level", "--seed", type=int, default=0, help="of each object (default: 0)")
    add("--keep-failures", action="store_true", help="store failed attempts, too")
    add("--plain", action="store_true", help="experts always in their usual style, and never disturbed")
    add("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="task settings")
    add("--workers", type=int, help="processes (default: one per core, of a cluster: per CPU)")
    add("--ray", metavar="ADDRESS", help="work on a Ray cluster: HOST:PORT, auto or local")


def _add_verify(commands: Any) -> None:
    summary = "simulate demonstrations again and compare every bit"
    about = "Simulate demonstrations again, from level and actions, and compare every bit."
    parser = _add_parser(commands, "verify", demos_run.run_verify, summary, about, _VERIFY_EPILOG)
    add = parser.add_argument
    add("path", type=Path, help=_FOLDERS)
    add("--objects", nargs="+", metavar="FOLDER", default=[], help="imported objects that no name leads to")
    add("--workers", type=int, help="processes (default: one per core)")


def _add_stats(commands: Any) -> None:
    summary = "count demonstrations: success rates, lengths, sizes, coverage"
    parser = _add_parser(commands, "stats", demos_run.run_stats, summary, "Count demonstrations.", _STATS_EPILOG)
    parser.add_argument("path", type=Path, help=_FOLDERS)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers here")


def _add_replay(commands: Any) -> None:
    summary = "make training files: observations, control mode, down-sampling"
    about = "Replay demonstrations into training files."
    parser = _add_parser(commands, "replay", demos_run.run_replay, summary, about, _REPLAY_EPILOG)
    add = parser.add_argument
    add("path", type=Path, help="a folder of demonstrations")
    add("--out", type=Path, required=True, metavar="FOLDER", help="for the training files")
    add("--obs-mode", required=True, help="state, pointcloud or rgbd")
    add("--points", help="of a cloud, or `all` (default: 1200)")
    add("--method", help="maniskill, uniform, voxel or fps (default: maniskill)")
    add("--frame", help="of the points: world, robot or end_effector (default: world)")
    add("--control-mode", help="joint or operational_space (default: the demonstrations')")
    way = parser.add_mutually_exclusive_group()
    way.add_argument("--simulate", dest="way", action="store_const", const="simulate", help="the default")
    way.add_argument(
        "--restore", dest="way", action="store_const", const="restore", help="restore recorded states instead"
    )
    parser.set_defaults(way="simulate")
    add("--objects", nargs="+", metavar="OBJECT", help="only these: ids, or PartNet folders")
    add("--count", type=int, help="successes of each object, or attempts if failures are kept (default: all)")
    add("--keep-failures", action="store_true", help="keep what is no longer solved, too")
    add("--compression", type=int, default=1, help="level of gzip, 0 to 9 (default: %(default)s)")
    add(
        "--set",
        nargs="+",
        action="extend",
        default=[],
        metavar="KEY=VALUE",
        help="cameras.* and render.* settings",
    )
    add("--workers", type=int, help="processes (default: one per core)")


def _add_export(commands: Any) -> None:
    summary = "training files as a Minari dataset or a LeRobotDataset"
    about = "Export training files for other libraries."
    parser = _add_parser(commands, "export", demos_run.run_export, summary, about, _EXPORT_EPILOG)
    add = parser.add_argument
    add("path", type=Path, help="a folder of training files")
    add("--format", required=True, choices=("minari", "lerobot"), metavar="FORMAT", help="minari or lerobot")
    add("--out", type=Path, required=True, metavar="HOME", help="the library's home of datasets")
    add("--name", help="of the dataset: its id, and where it is in HOME")


def _add_pictures(commands: Any) -> None:
    summary = "strips of the most different demonstrations of an object"
    about = "Draw the most different demonstrations of an object, a row each."
    parser = _add_parser(commands, "pictures", demos_run.run_pictures, summary, about, _PICTURES_EPILOG)
    add = parser.add_argument
    add("path", type=Path, help="a folder of demonstrations")
    add("--object", required=True, help="id, or a PartNet folder")
    add("--out", type=Path, required=True, metavar="FILE", help=".png or .jpg")
    add("--target", metavar="LINK", help="only demonstrations of this link")
    add("--count", type=int, default=5, help="demonstrations (default: %(default)s)")
    add("--moments", type=int, default=5, help="of each (default: %(default)s)")
    add("--view", default="world", help="world, sensor, cloud or all (default: %(default)s)")
    add("--width", type=int, default=320, help="of each picture, pixels (default: %(default)s)")
    add("--azimuth", type=float, metavar="DEG", help="where the camera stands, from +x on")
    add("--elevation", type=float, metavar="DEG", help="its height above the horizon")
    add("--distance", type=float, metavar="METRES", help="from its target")
