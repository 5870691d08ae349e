"""An argument parser whose errors are one line and name what is nearest."""

import argparse
from collections.abc import Sequence
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
        """`parse_args` that names the nearest option of the command for an unknown one.

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
        """Argparse's conversion; no path is empty, which would be the working directory, or impossible."""
        name = "/".join(action.option_strings) or action.dest
        if len(text) > _MOST_CHARACTERS:
            raise UsageError(f"{name} is too long: {len(text)} characters, of {_MOST_CHARACTERS} that are legal")
        if "\0" in text or any("\ud800" <= character <= "\udfff" for character in text):
            raise UsageError(f"{name} is no text: {shown(text)} holds NUL, or what is not valid UTF-8")
        if action.type is Path:
            if not text.strip():
                raise UsageError(f"{name} needs a path, not {shown(text)}")
            try:
                check_path(text)
            except OSError as error:
                raise UsageError(f"{name}: {shown(text)} is no path: {error.strerror}") from error
        try:
            return super()._get_value(action, text)
        except argparse.ArgumentError as error:
            if len(text) <= _MOST_SHOWN:
                raise
            raise UsageError(f"{name} takes no {shown(text)}") from error

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Argparse's check of `choices`, which argparse makes, with our message."""
        if action.choices is not None and value not in action.choices:
            kind = (
                "command" if isinstance(action, argparse._SubParsersAction) else str(action.metavar or action.dest)
            )
            raise UsageError(str(UnknownNameError(kind, value, action.choices)))


def overrides_of(pairs: Sequence[str]) -> dict[str, Any]:
    """`["success.open_fraction=0.5"]` as `{"success.open_fraction": 0.5}`; values are read as YAML.

    Raises:
        UsageError: a pair without `=`, or a value that is no YAML.
    """
    overrides: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not key or not equals:
            raise UsageError(f"--set takes key=value, success.open_fraction=0.5 say, not {shown(pair)}")
        try:
            overrides[key] = parse_yaml(text)
        except ValueError as error:
            raise UsageError(f"--set {shown(pair)}: the value is not valid YAML: {error}") from error
    return overrides
