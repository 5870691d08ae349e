"""Tables for a terminal, or for a file or pipe."""

import shutil
import sys
from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from artiskill.evaluation.failures import Failures
    from artiskill.evaluation.groups import Group
    from artiskill.evaluation.report import Report
    from artiskill.evaluation.statistics import Comparison
    from artiskill.evaluation.stored_report import StoredReport

_MOST_OBJECTS = 3  # that are named


def make_console(piped_width: int = 120) -> "Console":
    """Return the console of standard output; a file or pipe has no width, where rich would assume 80 and cut."""
    from rich.console import Console

    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else piped_width
    return Console(width=width, highlight=False)


def make_table(texts: Sequence[str], numbers: Sequence[str], title: str | None = None) -> "Table":
    """Return a table without rows: columns of texts, which are never wrapped, then columns of numbers."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, title=title, title_justify="left")
    for name in texts:
        table.add_column(name, no_wrap=True)
    for name in numbers:
        table.add_column(name, justify="right")
    return table


def print_report(report: "Report") -> None:
    """Print an evaluation's table and a summary to standard output."""
    from rich.markup import escape

    from artiskill.evaluation.report import report_columns

    console, columns = make_console(), report_columns(report)
    table = make_table(columns[:2], columns[2:])
    for row in report.rows:
        table.add_row(*row.cells(".0%"))
    table.add_section()
    table.add_row("all", "", *report.total.cells(".0%"), style="bold")
    console.print(table)
    if report.total.faults:
        console.print(report.total.faults_text, soft_wrap=True)
    low, high = report.total.interval
    over = report.interval_over_objects
    spread = f", over objects {over[0]:.1%} to {over[1]:.1%}" if over else ""
    console.print(
        f"[bold]{report.task}[/bold], policy {escape(report.policy)}: "
        f"[bold]{report.success_rate:.1%}[/bold] solved "
        f"(95 % confidence interval {low:.1%} to {high:.1%}{spread}), "
        f"{report.total.episodes} episodes in {report.timing['seconds']:.1f} s",
        soft_wrap=True,
    )
    track = f", track {report.track}" if report.track else ""
    console.print(f"protocol {escape(report.protocol.id)}{track}", soft_wrap=True)
    if report.confinement is not None:
        console.print(report.confinement.text, soft_wrap=True)


def print_failures(found: "Failures") -> None:
    """Print how the failed episodes of a report failed to standard output, the commonest kind first."""
    from rich.markup import escape

    console = make_console()
    if found.episodes:
        table = make_table([], ["episodes", "share"])
        for name in ("got as far as", "ended in", "lacked at the end", "objects"):
            table.add_column(name)
        for kind, objects in found.by_kind():
            most = [escape(f"{name} {count}") for name, count in objects.most_common(_MOST_OBJECTS)]
            more = [f"{len(objects) - len(most)} more"] if len(objects) > len(most) else []
            count, lacked = objects.total(), kind.fault or "\n".join(kind.missing)
            share = f"{count / len(found.episodes):.0%}"
            table.add_row(str(count), share, kind.furthest, kind.final, lacked, "\n".join(most + more))
        console.print(table)
    console.print(f"{found.task}: {len(found.episodes)} of {found.played} episodes failed", soft_wrap=True)


def print_groups(groups: Sequence["Group"]) -> None:
    """Print the success of a report by traits of its objects to standard output, a section for each trait."""
    from rich.markup import escape

    table = make_table(["trait", "value"], ["objects", "solved", "rate", "95 % interval", "over objects"])
    for name, of_trait in groupby(groups, lambda one: one.trait.name):
        for place, one in enumerate(of_trait):
            over = one.interval_over_objects
            spread = f"{over[0]:.0%} to {over[1]:.0%}" if over else ""
            shown = "" if place else name
            table.add_row(shown, escape(one.trait.value), str(one.objects), *one.stats.cells(".0%")[:3], spread)
        table.add_section()
    make_console().print(table)


def print_comparison(first: "StoredReport", second: "StoredReport", found: "Comparison") -> None:
    """Print two reports of one protocol and their difference to standard output."""
    from rich.markup import escape

    console = make_console()
    table = make_table(["object"], ["first", "second", "difference"])
    both = (found.first.success_rate, found.second.success_rate)
    for name, (one, other) in found.by_object.items():
        table.add_row(escape(name), f"{one:.0%}", f"{other:.0%}", f"{other - one:+.0%}")
    table.add_section()
    table.add_row("all", f"{both[0]:.1%}", f"{both[1]:.1%}", f"{found.difference:+.1%}", style="bold")
    console.print(table)
    console.print(f"protocol {escape(first.protocol)}", soft_wrap=True)
    for title, report in (("first", first), ("second", second)):
        track = f", track {report.track}" if report.track else ""
        console.print(f"{title}: {escape(report.policy)}{track}", soft_wrap=True)
    spread = "no interval: all episodes differ alike"
    if found.interval is not None:
        low, high = found.interval
        drawn = "objects and levels" if len(found.by_object) > 1 else "levels"
        spread = f"95 % interval {low:+.1%} to {high:+.1%} by bootstrap over {drawn}"
    console.print(
        f"second minus first: [bold]{found.difference:+.1%}[/bold] ({spread}); "
        f"of {found.first.episodes} episodes, "
        f"{found.only_second} were solved by the second alone, {found.only_first} by the first alone",
        soft_wrap=True,
    )
