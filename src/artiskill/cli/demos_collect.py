"""`artiskill demos collect`: the experts' successful trajectories, one file per object."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from artiskill.demos.manifest import Manifest
    from artiskill.demos.plan import Plan
    from artiskill.jobs.ray_jobs import RayCluster

EXIT_SHORT = 1

_EPILOG = """examples:
  artiskill demos collect --task PushChair --out demos/chairs
  artiskill demos collect --task OpenCabinetDoor --objects cabinet-0006 --targets link_1 --out demos/doors
  artiskill demos collect --task MoveBucket --control-mode operational_space --out demos/buckets-os
  artiskill demos collect --task PushChair --out demos/chairs --ray auto

Stopped at any moment, the same command goes on from there. The exit status is 1 if an expert could not solve an
object often enough. docs/demonstrations.md describes the files."""


def add_command(commands: Any) -> None:
    """Describe the sub-command."""
    parser = commands.add_parser(
        "collect",
        help="have experts demonstrate a task",
        description="Have experts demonstrate a task, and store what they do.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--task", required=True, help="name of the task")
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="of this task's demonstrations")
    parser.add_argument(
        "--objects", nargs="+", default=["train"], help="splits, ids, PartNet folders (default: train)"
    )
    parser.add_argument(
        "--per-object", type=int, help="successful trajectories, which its targets share (default: 300)"
    )
    parser.add_argument("--per-target", type=int, help="successful trajectories of each target link instead")
    parser.add_argument("--targets", nargs="+", metavar="LINK", help="only these links (default: all)")
    parser.add_argument(
        "--control-mode", default="joint", help="joint or operational_space (default: %(default)s)"
    )
    parser.add_argument("--first-level", "--seed", type=int, default=0, help="of each object (default: 0)")
    parser.add_argument("--keep-failures", action="store_true", help="store failed attempts, too")
    parser.add_argument(
        "--plain", action="store_true", help="experts always in their usual manner, and never disturbed"
    )
    parser.add_argument("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="task settings")
    parser.add_argument("--workers", type=int, help="processes (default: one per core, of a cluster: per CPU)")
    parser.add_argument("--ray", metavar="ADDRESS", help="play on a Ray cluster: HOST:PORT, auto or local")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Check everything, collect, show what came of it; the exit status."""
    from artiskill.cli.demos_table import print_collection
    from artiskill.cli.parser import overrides_of
    from artiskill.demos.hdf5 import load_h5py
    from artiskill.demos.plan import make_plan
    from artiskill.jobs.ray_jobs import RayCluster

    load_h5py()  # it is needed in the end: better said now
    cluster = None if arguments.ray is None else RayCluster(arguments.ray, arguments.workers)
    if cluster is not None:
        cluster.check()
    plan = make_plan(
        task=arguments.task,
        objects=arguments.objects,
        per_object=arguments.per_object,
        per_target=arguments.per_target,
        targets=arguments.targets,
        control_mode=arguments.control_mode,
        first_level=arguments.first_level,
        keep_failures=arguments.keep_failures,
        variety=not arguments.plain,
        config=overrides_of(arguments.set),
    )
    manifest = _collect(plan, arguments.out, arguments.workers, cluster)
    return EXIT_SHORT if print_collection(plan, manifest, arguments.out) else 0


def _collect(plan: "Plan", folder: Path, workers: int | None, cluster: "RayCluster | None") -> "Manifest":
    from artiskill.cli.progress import Progress
    from artiskill.demos.attempts import Attempt
    from artiskill.demos.collect import Collection, collect
    from artiskill.demos.unfinished import KEPT
    from artiskill.jobs.parallel import available_cores

    workers = available_cores() if workers is None else workers
    total = sum(plan.wanted(one) for one in plan.objects)
    with Progress(f"{plan.settings.task}, {plan.settings.control_mode}", total, "trajectories") as progress:

        def on_start(collection: Collection) -> None:
            progress.skip(total - collection.missing)

        def on_attempt(attempt: Attempt) -> None:
            progress.attempt(attempt.success)

        try:
            return collect(plan, folder, workers, on_attempt, on_start, cluster)
        except KeyboardInterrupt as interrupt:
            raise KeyboardInterrupt(f"interrupted; {KEPT}") from interrupt
