"""`artiskill assets`: objects themselves: `check`, `solve`, `export` and `gallery`."""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from artiskill.cli.parser import UsageError, add_command, add_group, add_set, add_workers, overrides_of, workers_of
from artiskill.cli.table import make_console, make_table

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from artiskill.checks.context import CheckResult
    from artiskill.checks.runner import ObjectReport
    from artiskill.experts.mpc import SolveResult


EXIT_FAULTS = EXIT_UNSOLVED = 1
_PIPED_WIDTH = 150
_MOST_ROWS = 3  # of one check of one object among the faults

_CHECK_EPILOG = """examples:
  artiskill assets check                         the whole catalogue
  artiskill assets check cabinet-0005 generated:cabinet:7
  artiskill assets check ./partnet/40147 --json faults.json
  artiskill assets check test --set settle.drift_m=0.001

Each object is checked, then compared with all others.
The exit status is 1 if a check fails. See docs/checks.md."""

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
    _add_check(subcommands)
    _add_solve(subcommands)
    _add_export(subcommands)
    _add_gallery(subcommands)


def _add_check(commands: Any) -> None:
    summary = "check objects: geometry, joints, masses, handles, duplicates"
    parser = add_command(commands, "check", _check, summary, _CHECK_EPILOG)
    parser.add_argument(
        "objects", nargs="*", default=["all"], help="splits, ids or PartNet folders (default: all)"
    )
    add_workers(parser)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every result to this file")
    add_set(parser, "change limits of checks")


def _check(arguments: argparse.Namespace) -> int:
    from artiskill.assets.catalog import resolve_objects
    from artiskill.checks.config import load_checks_config
    from artiskill.checks.runner import check_objects, write_json
    from artiskill.cli.progress import ProgressBar
    from artiskill.files import check_output_folder, output_path

    if arguments.json is not None:
        check_output_folder(output_path(arguments.json).absolute().parent)
    config = load_checks_config(overrides_of(arguments.set))
    items = resolve_objects(arguments.objects)
    with ProgressBar("checking", len(items), "objects") as progress:
        reports = check_objects(items, config, workers_of(arguments), lambda report: progress.advance())
    print_checks(reports)
    if arguments.json is not None:
        write_json(reports, config, arguments.json)
        print(f"results: {arguments.json}")
    return 0 if all(report.passed for report in reports) else EXIT_FAULTS


def print_checks(reports: Sequence["ObjectReport"]) -> None:
    """Print tables, faults and a summary to standard output."""
    print_to(make_console(_PIPED_WIDTH), reports)


def print_to(console: "Console", reports: Sequence["ObjectReport"]) -> None:
    """Print tables, faults and a summary to a given console."""
    for category in dict.fromkeys(report.category for report in reports if report.category):
        console.print(category_table(category, [report for report in reports if report.category == category]))
    faulty = [report for report in reports if not report.passed]
    if faulty:
        console.print(fault_table(faulty))
    for report in reports:
        for remark in report.remarks:
            console.print(f"{report.id}: {remark}", markup=False, soft_wrap=True)
    checked = sum(len(report.results) for report in reports)
    faults = sum(len(report.failures()) for report in reports)
    verdict = f"[bold red]{len(faulty)} of {len(reports)} objects fail[/]" if faulty else "[bold]all pass[/]"
    seconds = sum(report.seconds for report in reports)
    console.print(
        f"{len(reports)} objects, {checked} results, {faults} faults, {seconds:.0f} s of work: {verdict}",
        soft_wrap=True,
    )


def category_table(category: str, reports: Sequence["ObjectReport"]) -> "Table":
    """Return one row per object: of each check the value nearest to its limit, or beyond it.

    Checks that passed everywhere and have no values get no column.
    """
    everything = [result for report in reports for result in report.results]
    worth = {result.check for result in everything if result.value is not None or not result.passed}
    checks = [check for check in dict.fromkeys(result.check for result in everything) if check in worth]
    units = {check: next((r.unit for r in everything if r.check == check and r.unit), "") for check in checks}
    table = make_table(("object",), [f"{check}\n{units[check]}" for check in checks], title=f"{category}s")
    for report in reports:
        cells = [_cell([r for r in report.results if r.check == check], units[check]) for check in checks]
        table.add_row(_text(report.id, report.passed), *cells)
    return table


def fault_table(reports: Sequence["ObjectReport"]) -> "Table":
    """Return one row per result that is not legal."""
    from rich.text import Text

    table = make_table(("object", "check", "what"), (), title="faults")
    for name in ("measured", "legal"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("", overflow="fold")
    for report in reports:
        rows = list(_shown(report))
        for number, cells in enumerate(rows):
            first = report.id if number == 0 else ""
            table.add_row(Text(first), *map(Text, cells), end_section=number == len(rows) - 1)
    return table


def _shown(report: "ObjectReport") -> Iterator[tuple[str, ...]]:
    """Yield cells of an object's faults, the gravest of each check first; of many similar ones only some."""
    for check in dict.fromkeys(fault.check for fault in report.failures()):
        faults = sorted((f for f in report.failures() if f.check == check), key=_strain, reverse=True)
        shown = faults if len(faults) <= _MOST_ROWS + 1 else faults[:_MOST_ROWS]
        for fault in shown:
            yield fault.check, fault.subject, fault.measured, fault.legal, fault.note
        if len(faults) > len(shown):
            yield check, "", "", "", f"... and {len(faults) - len(shown)} more of these (--json has all)"


def _cell(results: Sequence["CheckResult"], unit: str) -> "Text":
    """Return the gravest result; of those that passed, only those with the column's unit count."""
    faults = [result for result in results if not result.passed]
    shown = faults or [result for result in results if result.value is not None and result.unit == unit]
    if not shown:
        return _text("ok" if results else "-", True)
    worst = max(shown, key=_strain)
    if worst.value is None:
        return _text("fails !", False)
    value = worst.measured.split(" ")[0] if worst.unit == unit else worst.measured
    return _text(value if worst.passed else f"{value} !", worst.passed)


def _strain(result: "CheckResult") -> tuple[bool, float]:
    """Return how near a result is to its limit, a failed one before all others."""
    low, high = result.limit
    if result.value is None:
        return not result.passed, 0.0
    parts = [result.value / high] if high else []
    parts += [low / result.value] if low and result.value > 0 else []
    return not result.passed, max(parts, default=0.0)


def _text(text: str, passed: bool) -> "Text":
    from rich.text import Text

    return Text(text, style="" if passed else "bold red")


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
