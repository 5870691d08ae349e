"""`artiskill bench`: how fast environments step on this machine."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from artiskill.cli.parser import add_command
from artiskill.cli.table import make_console, make_table

if TYPE_CHECKING:
    from rich.table import Table

    from artiskill.bench.measure import Measurement
    from artiskill.bench.report import BenchReport

_BUSY = 0.5  # other processes per core, from which on figures deserve a warning

_EPILOG = """examples:
  artiskill bench
  artiskill bench --task OpenCabinetDrawer --num-envs 1 16 64 256 1024 --threads 1 2 --out results/bench
  artiskill bench --task PushChair --obs pointcloud --points 1200 --num-envs 16

Columns: steps/s counts the steps of all environments; engine/s is the bare physics engine on the same models, with
the same drive targets, timed in turn; share is the ratio of the two; + resets includes one reset per episode.
See docs/performance.md."""


def add_commands(commands: Any) -> None:
    """Add the command."""
    parser = add_command(commands, "bench", _bench, "measure how fast environments step on this machine", _EPILOG)
    add = parser.add_argument
    add("--task", nargs="+", default=["all"], help="names of tasks (default: all)")
    modes = "one or more of state, pointcloud and rgbd (default: state)"
    add("--obs", nargs="+", default=["state"], help=modes)
    counts = "numbers of environments (default: 1 16 64)"
    add("--num-envs", nargs="+", type=int, default=[1, 16, 64], metavar="N", help=counts)
    add("--threads", nargs="+", type=int, metavar="N", help="numbers of threads (default: one per core)")
    add("--objects", nargs="+", default=["train"], help="splits, ids or PartNet folders (default: train)")
    add("--points", type=int, metavar="N", help="down-sample point clouds to N points")
    add("--seconds", type=float, default=4.0, help="time to measure each row (default: 4)")
    add("--out", type=Path, metavar="FOLDER", help="write bench.json and bench.png here")
    add("--no-plot", action="store_true", help="do not write bench.png, which needs the extra 'bench'")


def _bench(arguments: argparse.Namespace) -> None:
    from artiskill.bench.cases import make_cases
    from artiskill.bench.measure import measure_alone
    from artiskill.bench.report import BenchReport, figure_class, machine_facts, write_bench
    from artiskill.cli.progress import ProgressBar
    from artiskill.files import check_output_folder

    cases = make_cases(
        arguments.task,
        arguments.obs,
        arguments.num_envs,
        arguments.threads,
        arguments.objects,
        arguments.points,
        arguments.seconds,
    )
    plot = arguments.out is not None and not arguments.no_plot
    if plot:
        figure_class()  # fails now, not after minutes of measuring, where matplotlib is missing
    if arguments.out is not None:
        check_output_folder(arguments.out)
    machine, measurements = machine_facts(), []
    with ProgressBar("bench", len(cases), "rows") as progress:
        for case in cases:
            measurements.append(measure_alone(case))
            progress.advance()
    report = BenchReport(machine, measurements)
    print_bench(report)
    if arguments.out is not None:
        for path in write_bench(report, arguments.out, plot):
            print(f"written: {path}")


def print_bench(report: "BenchReport") -> None:
    """Print the table and the machine to standard output."""
    console = make_console()
    console.print(bench_table(report.measurements))
    machine = report.machine
    console.print(
        f"{machine['processor'] or 'unknown processor'}, {machine['cores']} cores, "
        f"artiskill {machine['versions']['artiskill']}, mujoco {machine['versions']['mujoco-core']}",
        soft_wrap=True,
    )
    if machine["load"] is not None and machine["load"] > _BUSY * machine["cores"]:
        console.print(
            f"[bold yellow]the machine was busy (load {machine['load']:.1f}): with several threads, rates are "
            "too low and shares too high[/]",
            soft_wrap=True,
        )


def bench_table(measurements: "Sequence[Measurement]") -> "Table":
    """Return one row per case, a section per task."""
    table = make_table(("task", "mode"), ())
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
