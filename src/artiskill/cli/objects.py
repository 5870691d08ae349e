"""`artiskill objects`: the catalogue."""

import argparse
from typing import Any


def add_command(commands: Any) -> None:
    """Describe the command."""
    parser = commands.add_parser("objects", help="list the catalogue: id, split and target links of every object")
    parser.add_argument("--task", help="only objects with a target for this task")
    parser.add_argument("--split", help="train, test or all (default: all)")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Print a line per object."""
    from artiskill.assets.catalog import TASK_MOTIONS, list_objects, read_catalog, task_motion
    from artiskill.errors import UnknownNameError
    from artiskill.tasks.registry import task_names

    # the catalogue knows the targets of tasks that are yet to come; what is offered here must also run
    if arguments.task is not None and arguments.task not in task_names():
        raise UnknownNameError("task", arguments.task, task_names())
    motions = list(TASK_MOTIONS.values()) if arguments.task is None else [task_motion(arguments.task)]
    names = {"prismatic": "drawers", "revolute": "doors"}
    for object_id in list_objects(split=arguments.split, task=arguments.task):
        entry = read_catalog()[object_id][1]
        links = [f"{names[m]} {' '.join(entry.targets(m))}" for m in motions if entry.targets(m)]
        print(f"{object_id}  {entry.split:<5}  {', '.join(links)}")
