"""`artiskill evaluate` and `demo`: a policy's success on many objects."""

import argparse
import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from artiskill.cli.parser import (
    Parser,
    UsageError,
    add_command,
    add_set,
    add_workers,
    overrides_of,
    workers_of,
)
from artiskill.cli.report import add_commands as add_report_commands

if TYPE_CHECKING:  # imports that `artiskill --help` must not wait for
    from artiskill.evaluation.plan import EvaluationPlan
    from artiskill.evaluation.report import Report
    from artiskill.evaluation.statistics import EpisodeResult
    from artiskill.jobs.ray_jobs import RayCluster

_EPILOG = """examples:
  artiskill evaluate --policy expert --objects test --out results/expert
  artiskill evaluate --policy my/solution.py --objects cabinet-0005 cabinet-0010 --episodes 50 --video look.gif
  artiskill evaluate --policy random --objects train --set episode_steps=100
  artiskill evaluate --policy runs/chairs --protocol artiskill-1/PushChair/test/joint/pointcloud
  artiskill evaluate --policy ws://localhost:8000 --objects test --workers 4
  artiskill evaluate --policy runs/chairs --ray auto --out results/chairs

docs/evaluation.md describes solution files and reports."""

_TASK, _EPISODES = "OpenCabinetDrawer", 10
# options of a policy behind a WebSocket
_OF_SERVER = ("points", "frame", "replan_steps")
# options that a protocol decides
_OF_PROTOCOL = ("task", "objects", "target", "episodes", "first_level", "obs_mode", "control_mode", "set")
_DEMO_TASKS = ("OpenCabinetDrawer", "OpenCabinetDoor")
_DEMO_OBJECTS = "test"  # the benchmark's own, which no policy of the package was trained on or chosen by
_DEMO_EPISODES, _DEMO_FILMS = 1, 6  # per object; on the page, seconds each
_DEMO_EPILOG = f"""The demo prints its commands. For each task they are these, --out with the task's name:
  artiskill evaluate --task TASK --policy pretrained --objects {_DEMO_OBJECTS} --episodes {_DEMO_EPISODES} \\
      --out results/demo/TASK
  artiskill report page results/demo/TASK --films {_DEMO_FILMS}"""


def add_commands(commands: Any) -> None:
    """Add the commands."""
    summary = "measure the package's policies on cabinets that they have never met; films and pages"
    parser = add_command(commands, "demo", _run_demo, summary, _DEMO_EPILOG)
    parser.add_argument("--task", help=f"only this task (default: {' and '.join(_DEMO_TASKS)})")
    folder = "folder to write (default: %(default)s)"
    parser.add_argument("--out", type=Path, default=Path("results/demo"), metavar="FOLDER", help=folder)
    add_workers(parser)
    _add_evaluate(commands)


def _add_evaluate(commands: Any) -> None:
    parser = add_command(commands, "evaluate", _run_evaluate, "measure a policy on many objects", _EPILOG)
    add = parser.add_argument
    task = f"name of the task, or module:Task (default: that of a trained policy, else {_TASK})"
    add("--task", help=task)
    policies = (
        "expert, demonstrator, random, still, pretrained, path/to/solution.py, a training run or the address"
    )
    add("--policy", default="expert", help=f"{policies} ws://host:port of a server (default: expert)")
    add(
        "--protocol",
        help="play this protocol, see `artiskill protocols`: it decides task, objects, levels, modes and values",
    )
    add("--objects", nargs="+", help="splits, ids or PartNet folders (default: test)")
    add("--target", help="target link, or 'all' to evaluate each one separately (default: drawn by each level)")
    add("--episodes", type=int, help=f"episodes per object (default: {_EPISODES})")
    add("--first-level", "--seed", type=int, help="level (seed) of each object's first episode (default: 0)")
    add("--fresh-levels", metavar="SALT", help="play levels that are hashes of this text, which nobody could know")
    add("--track", help="what the policy was made from, for the report; docs/evaluation.md lists them")
    add("--obs-mode", help="observation mode (default: the policy's, else state)")
    add("--control-mode", help="control mode (default: the policy's, else joint)")
    add_set(parser, "change values of the task's configuration")
    add_workers(parser)
    add("--ray", metavar="ADDRESS", help="work on a Ray cluster: HOST:PORT, auto or local")
    stepping = "time limit for each action (default: none; of a solution file or a server 60)"
    add("--step-timeout", type=float, metavar="SECONDS", help=stepping)
    _add_sandbox(parser)
    loading = "time limit for loading a solution file, or connecting to a server (default: 120)"
    add("--load-timeout", type=float, default=120.0, metavar="SECONDS", help=loading)
    server = parser.add_argument_group("a policy at ws://host:port; by default what its server says").add_argument
    server("--points", type=int, help="points of the clouds that it gets")
    server("--frame", help="of these points: world, robot or end_effector")
    server("--replan-steps", type=int, help="actions of an answer that are taken before it is asked again")
    add("--out", type=Path, metavar="FOLDER", help="write report.json, report.md and CSV files here")
    add("--video", type=Path, metavar="FILE", help="record episodes as .gif, .webp or .mp4")
    recorded = "number of objects to record, an episode each (default: 3)"
    add("--video-episodes", type=int, default=3, help=recorded)


def _add_sandbox(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("confinement of a solution file")
    kinds = "bubblewrap, landlock, limits or none (default: the first of them that holds here)"
    group.add_argument("--sandbox", metavar="NAME", help=kinds)
    acting = "time limit for all its actions in an episode (default: 1800)"
    group.add_argument("--episode-timeout", type=float, default=1800.0, metavar="SECONDS", help=acting)
    group.add_argument("--memory", type=float, default=8.0, metavar="GB", help="that it may use (default: 8)")
    reading = "files and folders that it may read besides its own folder and its interpreter's"
    group.add_argument("--readable", nargs="+", default=[], metavar="PATH", help=reading)


def _run_demo(arguments: argparse.Namespace) -> None:
    from artiskill.evaluation.recording import prepare_films

    parser = Parser(prog="artiskill")
    commands = parser.add_subparsers()
    add_commands(commands)
    add_report_commands(commands)
    tasks = [arguments.task] if arguments.task else _DEMO_TASKS
    workers = [] if arguments.workers is None else ["--workers", str(arguments.workers)]
    prepare_films()
    for task in tasks:
        for command in _demo_commands(task, str(arguments.out / task)):
            print(f"artiskill {shlex.join(command + workers)}", flush=True)
            parsed = parser.parse_strictly(command + workers)
            parsed.run(parsed)
    print("open these pages in a browser:")
    for task in tasks:
        print(f"  {(arguments.out / task / 'page.html').absolute()}")


def _demo_commands(task: str, out: str) -> list[list[str]]:
    """Return what the demo does with a task: measure a policy, write a page with films."""
    evaluate = ["evaluate", "--task", task, "--policy", "pretrained", "--objects", _DEMO_OBJECTS]
    evaluate += ["--episodes", str(_DEMO_EPISODES), "--out", out]
    return [evaluate, ["report", "page", out, "--films", str(_DEMO_FILMS)]]


def _run_evaluate(arguments: argparse.Namespace) -> None:
    from artiskill.jobs.fork_server import fork_server

    if arguments.workers != 1 or arguments.policy.endswith(".py"):  # it imports while this process does
        fork_server().prepare(partial(import_module, "artiskill.evaluation.evaluate"))
    from artiskill.errors import ConfigError
    from artiskill.evaluation.cluster import remove_kept
    from artiskill.evaluation.evaluate import check_plan_workers
    from artiskill.evaluation.recording import check_video, prepare_films
    from artiskill.evaluation.report import check_report_folder, write_report
    from artiskill.files import lock_folder
    from artiskill.jobs.ray_jobs import RayCluster

    if arguments.video is not None:
        check_video(arguments.video, arguments.video_episodes)
    if arguments.out is not None:
        check_report_folder(arguments.out)
        if arguments.video is not None and arguments.video.resolve() == arguments.out.resolve():
            raise ConfigError(
                f"--out and --video are both {str(arguments.out)!r}, but one is a folder and one a file"
            )
    with _note_earlier_report(arguments.out):
        cluster = None if arguments.ray is None else RayCluster(arguments.ray, arguments.workers)
        if cluster is not None:
            cluster.check()
        plan = _plan(arguments)
        for note in plan.notes:
            print(f"note: {note}", file=sys.stderr)
        workers = workers_of(arguments)
        check_plan_workers(plan, workers, arguments.step_timeout)
        if arguments.video is not None:
            prepare_films()
    with nullcontext() if arguments.out is None else lock_folder(arguments.out):
        with _note_earlier_report(arguments.out):
            report = _play_episodes(arguments, plan, workers, cluster)
            if arguments.out is not None:
                write_report(report, arguments.out, is_locked=True)
                remove_kept(arguments.out)
                print(f"report: {arguments.out}/report.md (as a page: artiskill report page {arguments.out})")
        if arguments.video is not None:
            _record(arguments, plan, workers)


@contextmanager
def _note_earlier_report(folder: Path | None) -> Iterator[None]:
    """Print a note if an evaluation fails and its folder holds an earlier report, or finished rows of this one."""
    from artiskill.evaluation.cluster import KEPT, UNFINISHED

    try:
        yield
    except BaseException:  # Ctrl-C, too
        if folder is not None and (folder / UNFINISHED).is_dir():
            print(f"note: {KEPT}", file=sys.stderr)
        if folder is not None and (folder / "report.json").is_file():
            print(f"note: {folder}/report.json is from an earlier evaluation", file=sys.stderr)
        raise


def _plan(arguments: argparse.Namespace) -> "EvaluationPlan":
    from artiskill.errors import PolicyError
    from artiskill.evaluation.plan import plan_evaluation
    from artiskill.evaluation.policies import trained_task
    from artiskill.evaluation.protocols import standard_protocol
    from artiskill.evaluation.sandbox import SandboxConfig

    asked = {name: getattr(arguments, name) for name in _OF_PROTOCOL}
    given = {name: value for name, value in asked.items() if value not in (None, [])}
    if arguments.protocol is None:
        given = {"objects": "test", "episodes": _EPISODES, "config": overrides_of(given.pop("set", [])), **given}
        given["task"] = given.get("task") or trained_task(arguments.policy) or _TASK
    else:
        wanted = standard_protocol(arguments.protocol).arguments
        if given:
            options = ", ".join(f"--{name.replace('_', '-')}" for name in given)
            raise UsageError(f"--protocol decides {options}, too: give one or the other")
        given = wanted
    plan = plan_evaluation(
        policy=_policy(arguments),
        load_timeout_s=arguments.load_timeout,
        salt=arguments.fresh_levels,
        track=arguments.track,
        sandbox=SandboxConfig(
            arguments.sandbox,
            arguments.memory,
            episode_timeout_s=arguments.episode_timeout,
            readable=tuple(arguments.readable),
            hidden=() if arguments.out is None else (str(arguments.out),),
        ),
        **given,
    )
    if not plan.protocol.id.startswith(arguments.protocol or ""):
        wish = f"{arguments.policy} asks for other cameras or another picture quality"
        raise PolicyError(f"{wish} than {arguments.protocol} has; leave --protocol out to play it all the same")
    return plan


def _policy(arguments: argparse.Namespace) -> Any:
    """Return the policy that is meant, with what is asked of its server."""
    from artiskill.evaluation.remote import as_remote

    asked = {name: value for name in _OF_SERVER if (value := getattr(arguments, name)) is not None}
    remote = as_remote(arguments.policy)
    if remote is not None:
        return replace(remote, **asked)
    if asked:
        options = ", ".join(f"--{name.replace('_', '-')}" for name in asked)
        raise UsageError(f"{options}: only of a policy at ws://host:port; others say themselves what they need")
    return arguments.policy


def _play_episodes(
    arguments: argparse.Namespace, plan: "EvaluationPlan", workers: int, cluster: "RayCluster | None"
) -> "Report":
    from artiskill.cli.progress import ProgressBar
    from artiskill.cli.table import print_report
    from artiskill.evaluation.cluster import evaluate_on_cluster
    from artiskill.evaluation.evaluate import run_evaluation

    limit_s = arguments.step_timeout
    with ProgressBar(f"{plan.task.name}, {plan.policy_name}", plan.num_episodes, "episodes") as progress:

        def on_episode(result: "EpisodeResult") -> None:
            progress.advance(result.success)

        if cluster is None:
            report = run_evaluation(plan, workers, on_episode, limit_s)
        else:
            report = evaluate_on_cluster(plan, cluster, on_episode, limit_s, arguments.out)
    print_report(report)
    return report


def _record(arguments: argparse.Namespace, plan: "EvaluationPlan", workers: int) -> None:
    from artiskill.cli.progress import ProgressBar
    from artiskill.evaluation.recording import record_video

    count = min(arguments.video_episodes, len(plan.batches))
    with ProgressBar("recording", count, "episodes") as progress:
        record_video(
            plan,
            arguments.video,
            count,
            workers,
            lambda news: progress.advance() if news.done else None,
            arguments.step_timeout,
        )
    print(f"video: {arguments.video}")
