"""`artiskill bench`: how fast environments step on this machine."""

import argparse
from pathlib import Path
from typing import Any

_EPILOG = """examples:
  artiskill bench
  artiskill bench --task OpenCabinetDrawer --num-envs 1 16 64 256 1024 --threads 1 2 --out results/bench
  artiskill bench --task PushChair --obs pointcloud --points 1200 --num-envs 16

Every figure stands beside that of the bare engine, on the same models, with the same drive targets, timed in turn.
docs/performance.md says what bounds them."""


def add_command(commands: Any) -> None:
    """Describe the command."""
    parser = commands.add_parser(
        "bench",
        help="measure how fast environments step here",
        description="Measure how fast environments step on this machine.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--task", nargs="+", default=["all"], help="names of tasks (default: all)")
    parser.add_argument(
        "--obs", nargs="+", default=["state"], help="state, pointcloud and rgbd, one or more (default: state)"
    )
    parser.add_argument(
        "--num-envs", nargs="+", type=int, default=[1, 16, 64], metavar="N", help="(default: 1 16 64)"
    )
    parser.add_argument("--threads", nargs="+", type=int, metavar="N", help="(default: one per core)")
    parser.add_argument(
        "--objects", nargs="+", default=["train"], help="splits, ids, PartNet folders (default: train)"
    )
    parser.add_argument("--points", type=int, metavar="N", help="down-sample point clouds to so many points")
    parser.add_argument("--seconds", type=float, default=4.0, help="of timed steps per figure (default: 4)")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="write bench.json and bench.png here")
    parser.add_argument("--no-plot", action="store_true", help="write no bench.png, which needs the extra 'bench'")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Check everything, measure, show, write."""
    from artiskill.bench.cases import make_cases
    from artiskill.bench.machine import machine_facts
    from artiskill.bench.plot import figure_class
    from artiskill.bench.report import BenchReport, write_bench
    from artiskill.bench.run import measure_alone
    from artiskill.cli.bench_table import print_bench
    from artiskill.cli.progress import Progress
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
        figure_class()  # minutes later would be late to say that it is missing
    if arguments.out is not None:
        check_output_folder(arguments.out)  # before minutes of measuring
    machine, measurements = machine_facts(), []
    with Progress("bench", len(cases), "figures") as progress:
        for case in cases:
            measurements.append(measure_alone(case))
            progress.advance()
    report = BenchReport(machine, measurements)
    print_bench(report)
    if arguments.out is not None:
        for path in write_bench(report, arguments.out, plot):
            print(f"written: {path}")
