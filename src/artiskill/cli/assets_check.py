"""`artiskill assets check`: are objects fit for the benchmark? A table per category, and the faults."""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from artiskill.cli.parser import add_command, add_set, add_workers, overrides_of, workers_of
from artiskill.cli.table import make_console, make_table

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from artiskill.checks.context import CheckResult
    from artiskill.checks.runner import ObjectReport

EXIT_FAULTS = 1
_PIPED_WIDTH = 150
_MOST_ROWS = 3  # of one check of one object among the faults

_EPILOG = """examples:
  artiskill assets check                         the whole catalogue
  artiskill assets check cabinet-0005 generated:cabinet:7
  artiskill assets check ./partnet/40147 --json faults.json
  artiskill assets check test --set settle.drift_m=0.001

Each object is checked, then compared with all others.
The exit status is 1 if a check fails. See docs/checks.md."""


def add_commands(commands: Any) -> None:
    """Add the sub-command."""
    summary = "check objects: geometry, joints, masses, handles, duplicates"
    parser = add_command(commands, "check", _check, summary, _EPILOG)
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
