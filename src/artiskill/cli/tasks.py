"""`artiskill tasks`: what can be asked of a robot."""

import argparse
from typing import Any


def add_command(commands: Any) -> None:
    """Describe the command."""
    parser = commands.add_parser("tasks", help="list the tasks and how many objects each split has for them")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Print a line per task."""
    from artiskill.assets.catalog import SPLITS, list_objects
    from artiskill.tasks.registry import task_names

    for name in task_names():
        counts = (f"{len(list_objects(split=split, task=name))} {split}" for split in SPLITS)
        print(f"{name}  {', '.join(counts)} objects")
