"""`artiskill demos`: demonstrations; one file per sub-command."""

from typing import Any

from artiskill.cli import demos_collect, demos_export, demos_pictures, demos_replay, demos_stats, demos_verify

SUBCOMMANDS = (demos_collect, demos_verify, demos_stats, demos_replay, demos_export, demos_pictures)


def add_command(commands: Any) -> None:
    """Describe the command and its sub-commands."""
    parser = commands.add_parser(
        "demos",
        help="collect, verify, count, replay, export and draw demonstrations",
        description="Collect, verify, count, replay, export and draw demonstrations.",
    )
    subcommands = parser.add_subparsers(metavar="SUBCOMMAND", required=True)
    for subcommand in SUBCOMMANDS:
        subcommand.add_command(subcommands)
    for child in subcommands.choices.values():
        child.set_defaults(parser=child)
        child.add_argument("--debug", action="store_true", help="show the traceback of an error")
