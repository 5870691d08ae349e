"""`artiskill training-set`: the set that training reads, made explicitly."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from artiskill.cli.parser import add_command, add_stored_task, add_workers, workers_of
from artiskill.cli.progress import PhaseBars
from artiskill.cli.table import make_console, make_table

if TYPE_CHECKING:
    from artiskill.learning.training_set import TrainingSet

_EPILOG = """examples:
  artiskill training-set training/drawers --out sets/drawers
  artiskill training-set demos/drawers --out sets/drawers-512 --points 512 --frame robot
  artiskill training-set training/drawers --out sets/one-drawer --objects cabinet-0002 --count 30

After an interruption, the same command goes on, or starts again where that is quick; a set is whole or not there.
docs/training_files.md describes the files."""


def add_commands(commands: Any) -> None:
    """Add the command."""
    summary = "make the set that training reads, from training files or demonstrations"
    parser = add_command(commands, "training-set", _training_set, summary, _EPILOG)
    add = parser.add_argument
    add("source", type=Path, metavar="SOURCE", help="folder of training files (pointcloud), or of demonstrations")
    add("--out", type=Path, required=True, metavar="FOLDER", help="folder of the set")
    add("--points", type=int, help="number of points of a cloud (default: 256, or all where files have fewer)")
    add("--objects", nargs="+", metavar="OBJECT", help="ids of objects (default: all)")
    add("--count", type=int, help="number of successes per object, evenly of its targets (default: all)")
    replaying = "of demonstrations, which are replayed"
    add("--method", help=f"how points are chosen, {replaying}: maniskill, shares, uniform, voxel or fps")
    add("--frame", help=f"frame of the points, {replaying}: world, robot or end_effector")
    add("--control-mode", help=f"joint or operational_space, {replaying}")
    add_stored_task(parser)
    add_workers(parser)


def _training_set(arguments: argparse.Namespace) -> None:
    from artiskill.demos.hdf5 import load_h5py
    from artiskill.learning.building import build_training_set
    from artiskill.learning.set_sources import SetOptions

    load_h5py()  # it is needed in the end: better said now
    options = SetOptions(
        num_points=arguments.points,
        objects=None if arguments.objects is None else tuple(arguments.objects),
        count=arguments.count,
        method=arguments.method,
        frame=arguments.frame,
        control_mode=arguments.control_mode,
    )
    start = time.perf_counter()
    try:
        with PhaseBars() as bars:
            made = build_training_set(
                arguments.source, arguments.out, options, arguments.task, workers_of(arguments), bars.show
            )
    except KeyboardInterrupt as interrupt:
        raise KeyboardInterrupt("interrupted; what was replayed is kept, the same command goes on") from interrupt
    _print_set(made, time.perf_counter() - start)


def _print_set(made: "TrainingSet", seconds: float) -> None:
    held = made.manifest
    table = make_table(("object", "target"), ("trajectories", "steps", "disturbed"))
    group = made.group_of_trajectory
    disturbed = made.steps["disturbed"]
    of_step = group[made.steps["trajectory"]]
    for number, (obj, target) in enumerate(made.groups):
        steps = of_step == number
        counts = (group == number).sum(), steps.sum(), disturbed[steps].sum()
        table.add_row(obj, target, *(str(count) for count in counts))
    table.add_section()
    table.add_row("all", "", str(held.trajectories), str(held.steps), str(disturbed.sum()), style="bold")
    console = make_console()
    console.print(table)
    size = sum(file.bytes for file in held.files.values())
    points = f"{made.sizes.points} points ({held.sampling['method']}, {held.sampling['frame']} frame)"
    frames = f"{held.frames} frames of {points}, {size / 1e6:.1f} MB, {seconds:.1f} s"
    console.print(f"{held.task}, {held.control_mode}: {frames}", soft_wrap=True)
    print(f"training set: {made.folder}")
