"""`artiskill assets`: objects themselves: `check`, `solve`, `export` and `gallery`."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from artiskill.cli import assets_check
from artiskill.cli.parser import UsageError, add_command, add_group, add_set, add_workers, overrides_of, workers_of

if TYPE_CHECKING:
    from artiskill.experts.mpc import SolveResult

EXIT_UNSOLVED = 1

_SOLVE_EPILOG = """examples:
  artiskill assets solve cabinet-0003 --task OpenCabinetDrawer
  artiskill assets solve ./partnet/179 --task PushChair --levels 0 1 2
  artiskill assets solve chair-0004 --task PushChair --set samples=128 horizon_steps=16

The planner is model predictive control (cross-entropy method) on the dense reward alone, without an expert.
It shows that reward and object fit together. A level takes minutes.
The exit status is 1 if a level is not solved. See docs/checks.md."""

_EXPORT_EPILOG = """examples:
  artiskill assets export cabinet-0001 --format mjcf --out exported/cabinet-0001
  artiskill assets export generated:chair:7 --format urdf --out exported/chair
  artiskill assets export partnet:40147 --format gltf --out exported/40147
  artiskill assets export cabinet-0001 chair-0003 --format urdf --out exported     a folder each

Each folder is complete: it needs no file outside it. docs/own_objects.md describes the formats."""

_HOW_TO_READ = {
    "mjcf": "mujoco.MjModel.from_xml_path({path!r}); scene.xml beside it has a floor",
    "urdf": "artiskill.load_object(Path({folder!r})), or any program that reads URDF",
    "glb": "any program that reads glTF",
}

_GALLERY_EPILOG = """examples:
  artiskill assets gallery
  artiskill assets gallery test ood --out results/unseen
  artiskill assets gallery cabinet-0001 generated:chair:0..9 --out results/some

Open index.html in the folder with a browser; it needs no server and no network."""


def add_commands(commands: Any) -> None:
    """Add the command and its sub-commands."""
    subcommands = add_group(commands, "assets", "check, solve, export and browse objects")
    assets_check.add_commands(subcommands)
    _add_solve(subcommands)
    _add_export(subcommands)
    _add_gallery(subcommands)


def _add_solve(commands: Any) -> None:
    summary = "solve levels by planning on the dense reward alone"
    parser = add_command(commands, "solve", _solve, summary, _SOLVE_EPILOG)
    parser.add_argument("objects", nargs="+", help="ids, splits or PartNet folders")
    parser.add_argument("--task", required=True, help="name of the task, or module:Task of your own package")
    parser.add_argument("--target", help="target link (default: drawn by the level)")
    parser.add_argument("--levels", nargs="+", type=int, default=[0], help="levels (seeds) to solve (default: 0)")
    parser.add_argument("--threads", type=int, help="number of simulation threads (default: one per core)")
    add_set(parser, "change values of the planner")


def _solve(arguments: argparse.Namespace) -> int:
    from artiskill.assets.catalog import resolve_objects
    from artiskill.cli.progress import ProgressBar
    from artiskill.envs.manipulation import ManipulationEnv
    from artiskill.experts.mpc import load_mpc_config, solve_level
    from artiskill.jobs.parallel import available_cores

    config = load_mpc_config(overrides_of(arguments.set))
    threads = available_cores() if arguments.threads is None else arguments.threads
    if threads < 1:
        raise UsageError(f"--threads must be at least 1, not {threads}")
    items = resolve_objects(arguments.objects, task=arguments.task)
    attempts = []
    with ProgressBar("planning", len(items) * len(arguments.levels), "levels") as progress:
        for item in items:
            env = ManipulationEnv(arguments.task, objects=[item], target=arguments.target)
            for level in arguments.levels:
                attempts.append(solve_level(env, level, config, threads))
                progress.print(_line(attempts[-1]))
                progress.advance()
    _print_attempts(attempts)
    return 0 if all(attempt.solved for attempt in attempts) else EXIT_UNSOLVED


def _line(a: "SolveResult") -> str:
    outcome = "solved in" if a.solved else "not solved after"
    return f"{a.object}, {a.target}, level {a.level}: {outcome} {a.steps} steps, {a.seconds:.0f} s"


def _print_attempts(attempts: "list[SolveResult]") -> None:
    from artiskill.cli.table import make_console, make_table

    table = make_table(("object", "target"), ("level", "solved", "steps", "reward", "seconds"))
    for a in attempts:
        numbers = f"{a.level}", "yes" if a.solved else "no", f"{a.steps}", f"{a.reward:.0f}", f"{a.seconds:.0f}"
        table.add_row(a.object, a.target, *numbers)
    make_console().print(table)


def _add_export(commands: Any) -> None:
    parser = add_command(commands, "export", _export, "write objects as MJCF, URDF or glTF", _EXPORT_EPILOG)
    parser.add_argument(
        "objects", nargs="+", help="ids, generated:<category>:<seed>, partnet:<id>, paths, or splits"
    )
    parser.add_argument("--format", required=True, help="mjcf, urdf or glb (also called gltf)")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FOLDER",
        help="folder to write one object (default: exported/<id>-<format>), or several, a folder each (default: "
        "exported/<format>)",
    )
    parser.add_argument(
        "--force", action="store_true", help="replace a folder that holds something other than this export"
    )


def _export(arguments: argparse.Namespace) -> None:
    from artiskill.assets.catalog import load_object, object_id_of, resolve_objects
    from artiskill.exports.export import export_object, export_objects, format_named

    name = format_named(arguments.format)  # checked before an import that takes a while
    items = resolve_objects(arguments.objects)
    if len(items) > 1:
        path = Path()
        for obj, path in export_objects(items, name, arguments.out or Path("exported") / name, arguments.force):
            print(f"{obj.id}: {path}", flush=True)
    else:
        obj = load_object(items[0]) if isinstance(items[0], str) else items[0]
        folder = arguments.out or Path("exported") / f"{object_id_of(obj)}-{name}"
        path = export_object(obj, name, folder, arguments.force)
        print(f"{obj.id}: {path}")
    which = "it" if len(items) == 1 else "one"
    print(f"read {which} with {_HOW_TO_READ[name].format(path=str(path), folder=str(path.parent))}")


def _add_gallery(commands: Any) -> None:
    summary = "make a page to browse objects, and contact sheets of them"
    parser = add_command(commands, "gallery", _gallery, summary, _GALLERY_EPILOG)
    parser.add_argument(
        "objects",
        nargs="*",
        default=["train", "test", "ood"],
        help="splits, ids, YAML lists or PartNet folders (default: train test ood)",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("gallery"), metavar="FOLDER", help="folder to write (default: gallery)"
    )
    add_workers(parser)
    parser.add_argument("--force", action="store_true", help="write into a folder that holds other files")


def _gallery(arguments: argparse.Namespace) -> None:
    from artiskill.assets.catalog import resolve_objects
    from artiskill.cli.progress import ProgressBar
    from artiskill.gallery.gallery import make_gallery

    objects = resolve_objects(arguments.objects)
    with ProgressBar("gallery", len(objects), "objects") as progress:
        page = make_gallery(objects, arguments.out, workers_of(arguments), progress.advance, arguments.force)
    print(f"gallery: {page}")
