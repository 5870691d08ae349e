"""`artiskill assets solve`: can objects be solved from the dense reward alone?"""

import argparse
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from artiskill.experts.mpc import SolveResult

EXIT_UNSOLVED = 1

_EPILOG = """examples:
  artiskill assets solve cabinet-0003 --task OpenCabinetDrawer
  artiskill assets solve ./partnet/179 --task PushChair --levels 0 1 2
  artiskill assets solve chair-0004 --task PushChair --set samples=128 horizon_steps=16

A level takes minutes: the planner simulates thousands of steps for each one. The exit status is 1 if a level is
not solved. docs/checks.md says how it plans."""


def add_command(commands: Any) -> None:
    """Describe the sub-command."""
    parser = commands.add_parser(
        "solve",
        help="solve levels by planning on the dense reward alone",
        description="Solve levels by model predictive control (cross-entropy method) on the dense reward alone. "
        "It shows that reward and object fit together, without an expert.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("objects", nargs="+", help="ids, splits, PartNet folders")
    parser.add_argument("--task", required=True)
    parser.add_argument("--target", help="target link (default: the level draws one)")
    parser.add_argument("--levels", nargs="+", type=int, default=[0], help="(default: 0)")
    parser.add_argument("--threads", type=int, help="threads that simulate (default: one per core)")
    parser.add_argument(
        "--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="planner values"
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Solve, show; the exit status."""
    from artiskill.assets.catalog import resolve_objects
    from artiskill.cli.parser import UsageError, overrides_of
    from artiskill.cli.progress import Progress
    from artiskill.envs.manipulation import ManipulationEnv
    from artiskill.experts.mpc import load_mpc_config, solve_level
    from artiskill.jobs.parallel import available_cores

    config = load_mpc_config(overrides_of(arguments.set))
    threads = available_cores() if arguments.threads is None else arguments.threads
    if threads < 1:
        raise UsageError(f"--threads must be at least 1, not {threads}")
    items = resolve_objects(arguments.objects, task=arguments.task)
    attempts = []
    with Progress("planning", len(items) * len(arguments.levels), "levels") as progress:
        for item in items:
            env = ManipulationEnv(arguments.task, objects=[item], target=arguments.target)
            for level in arguments.levels:
                attempts.append(solve_level(env, level, config, threads))
                progress.say(_line(attempts[-1]))
                progress.advance()
    _print(attempts)
    return 0 if all(attempt.solved for attempt in attempts) else EXIT_UNSOLVED


def _line(a: "SolveResult") -> str:
    outcome = "solved in" if a.solved else "not solved after"
    return f"{a.object}, {a.target}, level {a.level}: {outcome} {a.steps} steps, {a.seconds:.0f} s"


def _print(attempts: "list[SolveResult]") -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("object", "target"):
        table.add_column(name, no_wrap=True)
    for name in ("level", "solved", "steps", "reward", "seconds"):
        table.add_column(name, justify="right")
    for a in attempts:
        numbers = f"{a.level}", "yes" if a.solved else "no", f"{a.steps}", f"{a.reward:.0f}", f"{a.seconds:.0f}"
        table.add_row(a.object, a.target, *numbers)
    Console(highlight=False).print(table)
