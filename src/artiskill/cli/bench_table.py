"""Measurements as a table for a terminal."""

import shutil
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from artiskill.bench.measure import Measurement
    from artiskill.bench.report import BenchReport

_PIPED_WIDTH = 120  # a file or pipe has no width of its own
_BUSY = 0.5  # other processes per core, from which on figures deserve a warning


def print_bench(report: "BenchReport") -> None:
    """Print the table and the machine to standard output."""
    from rich.console import Console

    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else _PIPED_WIDTH
    console = Console(width=width, highlight=False)
    console.print(bench_table(report.measurements))
    machine = report.machine
    console.print(
        f"{machine['processor'] or 'unknown processor'}, {machine['cores']} cores, "
        f"artiskill {machine['versions']['artiskill']}, mujoco {machine['versions']['mujoco-core']}",
        soft_wrap=True,
    )
    if machine["load"] is not None and machine["load"] > _BUSY * machine["cores"]:
        console.print(
            f"[bold yellow]the machine had other work (load {machine['load']:.1f}): with several threads, rates "
            "are too low and shares too high[/]",
            soft_wrap=True,
        )


def bench_table(measurements: "Sequence[Measurement]") -> "Table":
    """One row per case, a section per task."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("task", "mode"):
        table.add_column(name, no_wrap=True)
    for name in ("envs", "threads", "steps/s", "engine/s", "share", "+ resets", "reset ms", "MB"):
        table.add_column(name, justify="right", no_wrap=True)
    task = ""
    for one in measurements:
        if task and one.case.task != task:
            table.add_section()
        table.add_row(one.case.task if one.case.task != task else "", *_cells(one))
        task = one.case.task
    return table


def _cells(one: "Measurement") -> list[str]:
    return [
        one.case.mode,
        f"{one.case.num_envs:,}",
        str(one.case.num_threads),
        f"{one.steps_per_s:,.0f}",
        f"{one.engine_steps_per_s:,.0f}",
        f"{one.ratio:.2f}",
        f"{one.steps_with_resets_per_s:,.0f}",
        f"{one.reset_ms:.2f}",
        "-" if one.memory_mb is None else f"{one.memory_mb:,.0f}",
    ]
