"""Reports of checks as tables for a terminal: one per category, and the faults in full."""

import shutil
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from artiskill.checks.context import CheckResult
    from artiskill.checks.runner import ObjectReport

_PIPED_WIDTH = 150  # a file or pipe has no width of its own
_MOST_ROWS = 3  # of one check of one object among the faults


def print_checks(reports: Sequence["ObjectReport"]) -> None:
    """Print tables, faults and a summary to standard output."""
    from rich.console import Console

    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else _PIPED_WIDTH
    print_to(Console(width=width, highlight=False), reports)


def print_to(console: "Console", reports: Sequence["ObjectReport"]) -> None:
    """`print_checks` on a given console."""
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
    """One row per object: of each check the value nearest to its limit, or beyond it.

    Checks that passed everywhere and have no values get no column.
    """
    from rich import box
    from rich.table import Table

    everything = [result for report in reports for result in report.results]
    worth = {result.check for result in everything if result.value is not None or not result.passed}
    checks = [check for check in dict.fromkeys(result.check for result in everything) if check in worth]
    units = {check: next((r.unit for r in everything if r.check == check and r.unit), "") for check in checks}
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, title=f"{category}s", title_justify="left")
    table.add_column("object", no_wrap=True)
    for check in checks:
        table.add_column(f"{check}\n{units[check]}", justify="right")
    for report in reports:
        cells = [_cell([r for r in report.results if r.check == check], units[check]) for check in checks]
        table.add_row(_text(report.id, report.passed), *cells)
    return table


def fault_table(reports: Sequence["ObjectReport"]) -> "Table":
    """One row per result that is not legal."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, title="faults", title_justify="left")
    for name in ("object", "check", "what"):
        table.add_column(name, no_wrap=True)
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
    """Cells of an object's faults, the gravest of each check first; of many alike only some."""
    for check in dict.fromkeys(fault.check for fault in report.failures()):
        faults = sorted((f for f in report.failures() if f.check == check), key=_strain, reverse=True)
        shown = faults if len(faults) <= _MOST_ROWS + 1 else faults[:_MOST_ROWS]
        for fault in shown:
            yield fault.check, fault.subject, fault.measured, fault.legal, fault.note
        if len(faults) > len(shown):
            yield check, "", "", "", f"... and {len(faults) - len(shown)} more of these (--json has all)"


def _cell(results: Sequence["CheckResult"], unit: str) -> "Text":
    """The gravest result; of those that passed, only such with the column's unit are shown."""
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
    """How near a result is to its limit, a failed one before all others."""
    low, high = result.limit
    if result.value is None:
        return not result.passed, 0.0
    parts = [result.value / high] if high else []
    parts += [low / result.value] if low and result.value > 0 else []
    return not result.passed, max(parts, default=0.0)


def _text(text: str, passed: bool) -> "Text":
    from rich.text import Text

    return Text(text, style="" if passed else "bold red")
