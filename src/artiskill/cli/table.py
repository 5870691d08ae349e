"""A report as a table for a terminal."""

import shutil
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

    from artiskill.evaluation.report import Report, Tally

_PIPED_WIDTH = 120  # a file or pipe has no width of its own; rich would assume 80 and cut


def print_report(report: "Report") -> None:
    """Print the table and a summary to standard output."""
    from rich.console import Console
    from rich.markup import escape

    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else _PIPED_WIDTH
    console = Console(width=width, highlight=False)
    console.print(report_table(report))
    if report.total.faults:
        console.print(report.total.faults_text, soft_wrap=True)
    low, high = report.total.interval
    console.print(
        f"[bold]{report.task}[/bold], policy {escape(report.policy)}: "
        f"[bold]{report.success_rate:.1%}[/bold] solved ({low:.1%} to {high:.1%} with 95 % confidence), "
        f"{report.total.episodes} episodes in {report.timing['seconds']:.1f} s",
        soft_wrap=True,
    )


def report_table(report: "Report") -> "Table":
    """One row per object, and one for all."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("object", "target"):
        table.add_column(name, no_wrap=True)
    for name in ("solved", "rate", "95 % interval", *report.total.flags, "mean steps"):
        table.add_column(name, justify="right")
    for row in report.rows:
        table.add_row(row.object, row.target, *_cells(row.tally))
    table.add_section()
    table.add_row("all", "", *_cells(report.total), style="bold")
    return table


def _cells(tally: "Tally") -> list[str]:
    low, high = tally.interval
    flags = [f"{rate:.0%}" for rate in tally.flags.values()]
    head = [f"{tally.successes}/{tally.episodes}", f"{tally.success_rate:.0%}", f"{low:.0%} .. {high:.0%}"]
    return [*head, *flags, f"{tally.mean_length:.1f}"]
