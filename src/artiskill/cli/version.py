"""`artiskill version`: what a bug report should name."""

import argparse
from typing import Any


def add_command(commands: Any) -> None:
    """Describe the command."""
    parser = commands.add_parser("version", help="show the versions on which numbers depend")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Print a line per distribution."""
    from artiskill.evaluation.report import versions

    for name, number in versions().items():
        print(f"{name} {number}")
