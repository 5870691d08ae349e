"""`artiskill objects`: the catalogue."""

import argparse
from typing import Any


def add_command(commands: Any) -> None:
    """Describe the command."""
    parser = commands.add_parser("objects", help="list the catalogue: id, split, family, target links")
    parser.add_argument("--task", help="only objects that this task can be done with")
    parser.add_argument("--category", help="cabinet, chair or bucket")
    parser.add_argument("--split", help="train, test, ood, or all for the first two (default: all)")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Print a line per object."""
    from artiskill.assets.catalog import list_objects, read_catalog
    from artiskill.assets.needs import task_needs
    from artiskill.errors import UnknownNameError
    from artiskill.tasks.registry import task_names

    # the catalogue serves tasks that are yet to come; what is offered here must also run
    if arguments.task is not None and arguments.task not in task_names():
        raise UnknownNameError("task", arguments.task, task_names())
    motion = None if arguments.task is None else task_needs(arguments.task).motion
    entries = [
        read_catalog()[object_id][1]
        for object_id in list_objects(arguments.category, arguments.split, arguments.task)
    ]
    width = max((len(entry.family) for entry in entries), default=0)
    for entry in entries:
        links = {"prismatic": ("drawers", entry.drawers), "revolute": ("doors", entry.doors)}
        shown = [f"{name} {' '.join(k)}" for kind, (name, k) in links.items() if k and motion in (None, kind)]
        print(f"{entry.id:<12}  {entry.split:<5}  {entry.family:<{width}}  {', '.join(shown)}".rstrip())
