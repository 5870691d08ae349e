"""An argument parser whose errors are one line and name what is nearest, and options that commands share."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from artiskill.errors import ArtiSkillError, UnknownNameError, shown
from artiskill.files import check_path, parse_yaml

_MOST_CHARACTERS, _MOST_SHOWN = 10_000, 100  # of an argument, and of one that argparse may quote


class UsageError(ArtiSkillError, ValueError):
    """A command line that does not follow the help."""


class Parser(argparse.ArgumentParser):
    """`argparse.ArgumentParser` that raises `UsageError`; subcommands inherit it."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**{"allow_abbrev": False, **kwargs})

    def error(self, message: str) -> NoReturn:
        """Raise instead of printing the usage and leaving.

        Raises:
            UsageError: always.
        """
        raise UsageError(f"{message} (see {self.prog} --help)")

    def parse_strictly(self, argv: Sequence[str] | None) -> argparse.Namespace:
        """Parse arguments; an error about an unknown option names the command's nearest one.

        Raises:
            UsageError: the command line does not follow the help.
        """
        arguments, unknown = self.parse_known_args(argv)
        if not unknown:
            return arguments
        command: Parser = getattr(arguments, "parser", self)
        if unknown[0].startswith("-"):
            legal = [option for option in command._option_string_actions if option.startswith("--")]
            raise UsageError(
                f"{UnknownNameError('option', unknown[0].split('=')[0], legal)} (see {command.prog} -h)"
            )
        return command.error(f"unexpected argument {shown(unknown[0])}")

    def _get_value(self, action: argparse.Action, text: str) -> Any:
        """Convert as argparse does; refuse an impossible path, and an empty one (the working directory)."""
        name = "/".join(action.option_strings) or action.dest
        if len(text) > _MOST_CHARACTERS:
            raise UsageError(f"{name} is too long: {len(text)} characters, at most {_MOST_CHARACTERS} are allowed")
        if "\0" in text or any("\ud800" <= character <= "\udfff" for character in text):
            raise UsageError(f"{name} is not text: {shown(text)} contains NUL or is not valid UTF-8")
        if action.type is Path:
            if not text.strip():
                raise UsageError(f"{name} needs a path, not {shown(text)}")
            try:
                check_path(text)
            except OSError as error:
                raise UsageError(f"{name}: {shown(text)} is not a path: {error.strerror}") from error
        try:
            return super()._get_value(action, text)
        except argparse.ArgumentError as error:
            if len(text) <= _MOST_SHOWN:
                raise
            raise UsageError(f"{name} takes no {shown(text)}") from error

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Check `choices` as argparse does, with our message."""
        if action.choices is not None and value not in action.choices:
            kind = (
                "command" if isinstance(action, argparse._SubParsersAction) else str(action.metavar or action.dest)
            )
            raise UsageError(str(UnknownNameError(kind, value, action.choices)))


def add_command(
    commands: Any, name: str, run: Callable[[argparse.Namespace], int | None], summary: str, epilog: str = ""
) -> Parser:
    """Add a command.

    Args:
        commands: what `add_subparsers` returned.
        name: of the command.
        run: takes the parsed arguments and returns the exit status; None for 0.
        summary: one line for the list of commands and the head of the command's own help.
        epilog: examples, printed as they are.
    """
    parser: Parser = commands.add_parser(
        name,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.",
        epilog=epilog or None,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_debug(parser)
    parser.set_defaults(run=run, parser=parser)
    return parser


def add_group(commands: Any, name: str, summary: str) -> Any:
    """Add a command that has sub-commands; return what they are added to."""
    parser = commands.add_parser(name, help=summary, description=f"{summary[0].upper()}{summary[1:]}.")
    add_debug(parser)
    return parser.add_subparsers(metavar="SUBCOMMAND", required=True)


def add_debug(parser: argparse.ArgumentParser) -> None:
    """Add `--debug`."""
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")


def add_set(parser: argparse.ArgumentParser, what: str, option: str = "--set") -> None:
    """Add `--set KEY=VALUE ...`, which `overrides_of` reads."""
    parser.add_argument(option, nargs="+", action="extend", default=[], metavar="KEY=VALUE", help=what)


def add_workers(parser: argparse.ArgumentParser, note: str = "") -> None:
    """Add `--workers`, which `workers_of` reads; a note follows its help."""
    parser.add_argument("--workers", type=int, help=f"number of processes (default: one per core{note})")


def add_stored_task(parser: argparse.ArgumentParser) -> None:
    """Add `--task` to a command that reads the task's name from files."""
    parser.add_argument("--task", help="module:Task, if files are of a task whose package is not installed")


def workers_of(arguments: argparse.Namespace) -> int:
    """Return the number of processes that was asked for, else that of the cores.

    Raises:
        ConfigError: an illegal number.
    """
    from artiskill.jobs.parallel import available_cores, check_workers

    if arguments.workers is None:
        return available_cores()
    check_workers(arguments.workers)
    return int(arguments.workers)


def overrides_of(pairs: Sequence[str]) -> dict[str, Any]:
    """Return `["success.open_fraction=0.5"]` as `{"success.open_fraction": 0.5}`; values are YAML.

    Raises:
        UsageError: a pair without `=`, or a value that is no YAML.
    """
    overrides: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not key or not equals:
            raise UsageError(f"--set needs KEY=VALUE, for example success.open_fraction=0.5, not {shown(pair)}")
        try:
            overrides[key] = parse_yaml(text)
        except ValueError as error:
            raise UsageError(f"--set {shown(pair)}: the value is not valid YAML: {error}") from error
    return overrides
