"""`artiskill assets`: what can be done with objects themselves; one file per sub-command."""

from typing import Any

from artiskill.cli import assets_check, assets_export, assets_gallery, assets_solve

SUBCOMMANDS = (assets_check, assets_export, assets_gallery, assets_solve)


def add_command(commands: Any) -> None:
    """Describe the command and its sub-commands."""
    parser = commands.add_parser(
        "assets",
        help="verify, solve, export and browse objects",
        description="Verify, solve, export and browse objects.",
    )
    subcommands = parser.add_subparsers(metavar="SUBCOMMAND", required=True)
    for subcommand in SUBCOMMANDS:
        subcommand.add_command(subcommands)
    for child in subcommands.choices.values():
        child.set_defaults(parser=child)
        child.add_argument("--debug", action="store_true", help="show the traceback of an error")
