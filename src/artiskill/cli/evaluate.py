"""`artiskill evaluate`: a policy's success on many objects, shown, written down and filmed."""

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # at run time these take half a second, which `artiskill --help` does not have
    from artiskill.evaluation.plan import EvaluationPlan
    from artiskill.evaluation.report import Report

_EPILOG = """examples:
  artiskill evaluate --policy expert --objects test --out results/expert
  artiskill evaluate --policy my/solution.py --objects cabinet-0005 cabinet-0010 --episodes 50 --video look.gif
  artiskill evaluate --policy random --objects train --set episode_steps=100

docs/evaluation.md says how a solution file is written and how the numbers are made."""


def add_command(commands: Any) -> None:
    """Describe the command."""
    parser = commands.add_parser(
        "evaluate",
        help="measure a policy on many objects",
        description="Measure a policy on many objects.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--task", default="OpenCabinetDrawer", help="name of the task (default: %(default)s)")
    parser.add_argument(
        "--policy",
        default="expert",
        help="expert, demonstrator, random, still or path/to/solution.py (default: expert)",
    )
    parser.add_argument(
        "--objects", nargs="+", default=["test"], help="splits, ids, PartNet folders (default: test)"
    )
    parser.add_argument(
        "--target", help="a target link, or 'all' for one row each (default: each level draws one)"
    )
    parser.add_argument("--episodes", type=int, default=10, help="per object (default: %(default)s)")
    parser.add_argument("--first-level", "--seed", type=int, default=0, help="of each object (default: 0)")
    parser.add_argument("--obs-mode", help="what the policy sees (default: what it asks for, else state)")
    parser.add_argument("--control-mode", help="what its actions are (default: what it says, else joint)")
    parser.add_argument("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="task settings")
    parser.add_argument("--workers", type=int, help="processes (default: one per core)")
    parser.add_argument(
        "--step-timeout", type=float, metavar="SECONDS", help="time limit for each action (default: none)"
    )
    parser.add_argument(
        "--load-timeout", type=float, default=120.0, metavar="SECONDS", help="to load a solution (default: 120)"
    )
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="write report.json, .csv, .md and more here")
    parser.add_argument("--video", type=Path, metavar="FILE", help="film episodes: .gif, .webp or .mp4")
    parser.add_argument("--video-episodes", type=int, default=3, help="how many objects to film (default: 3)")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Check everything, evaluate, write, film, and show the table."""
    from artiskill.jobs.fork_server import fork_server

    if arguments.workers != 1 or arguments.policy.endswith(".py"):  # it imports while this process does
        fork_server().prepare(partial(import_module, "artiskill.evaluation.evaluate"))
    from artiskill.errors import ConfigError
    from artiskill.evaluation.evaluate import check_workers
    from artiskill.evaluation.recording import check_video
    from artiskill.evaluation.report import check_report_folder, write_report
    from artiskill.files import lock_folder
    from artiskill.jobs.parallel import available_cores

    if arguments.video is not None:
        check_video(arguments.video, arguments.video_episodes)
    if arguments.out is not None:
        check_report_folder(arguments.out)
        if arguments.video is not None and arguments.video.resolve() == arguments.out.resolve():
            raise ConfigError(f"--out and --video both name {str(arguments.out)!r}: one is a folder, one a file")
    with _earlier_report_told(arguments.out):
        plan = _plan(arguments)
        workers = available_cores() if arguments.workers is None else arguments.workers
        check_workers(plan, workers, arguments.step_timeout)
    with nullcontext() if arguments.out is None else lock_folder(arguments.out):
        with _earlier_report_told(arguments.out):
            report = _evaluate(arguments, plan, workers)
            if arguments.out is not None:
                write_report(report, arguments.out, is_locked=True)
                print(f"report: {arguments.out}/report.md")
        if arguments.video is not None:
            _film(arguments, plan, workers)


@contextmanager
def _earlier_report_told(folder: Path | None) -> Iterator[None]:
    """Where an evaluation fails, say whether the report in its folder is another one's."""
    try:
        yield
    except BaseException:  # Ctrl-C, too
        if folder is not None and (folder / "report.json").is_file():
            print(f"note: {folder}/report.json is of an earlier evaluation", file=sys.stderr)
        raise


def _plan(arguments: argparse.Namespace) -> "EvaluationPlan":
    from artiskill.cli.parser import overrides_of
    from artiskill.evaluation.plan import plan_evaluation

    return plan_evaluation(
        task=arguments.task,
        policy=arguments.policy,
        objects=arguments.objects,
        episodes=arguments.episodes,
        first_level=arguments.first_level,
        target=arguments.target,
        obs_mode=arguments.obs_mode,
        control_mode=arguments.control_mode,
        config=overrides_of(arguments.set),
        load_timeout_s=arguments.load_timeout,
    )


def _evaluate(arguments: argparse.Namespace, plan: "EvaluationPlan", workers: int) -> "Report":
    from artiskill.cli.progress import Progress
    from artiskill.cli.table import print_report
    from artiskill.evaluation.evaluate import run_evaluation

    with Progress(f"{plan.task.name}, {plan.policy_name}", plan.num_episodes, "episodes") as progress:
        report = run_evaluation(
            plan, workers, lambda result: progress.advance(result.success), arguments.step_timeout
        )
    print_report(report)
    return report


def _film(arguments: argparse.Namespace, plan: "EvaluationPlan", workers: int) -> None:
    from artiskill.cli.progress import Progress
    from artiskill.evaluation.recording import record_video

    count = min(arguments.video_episodes, len(plan.batches))
    with Progress("filming", count, "episodes") as progress:
        record_video(
            plan,
            arguments.video,
            count,
            workers,
            lambda news: progress.advance() if news.done else None,
            arguments.step_timeout,
        )
    print(f"video: {arguments.video}")
