"""`artiskill config show`: a task's configuration as it is when every value has been resolved."""

import argparse
from typing import Any


def add_command(commands: Any) -> None:
    """Describe the command."""
    parser = commands.add_parser("config", help="show a task's configuration")
    parser.add_argument("action", choices=("show",), metavar="show")
    parser.add_argument("task", help="name of the task")
    parser.add_argument("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="change values")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Print YAML."""
    from artiskill.cli.parser import overrides_of
    from artiskill.config import dump_yaml
    from artiskill.tasks.registry import make_task

    print(dump_yaml(make_task(arguments.task, overrides_of(arguments.set)).config), end="")
