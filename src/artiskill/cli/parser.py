"""An argument parser whose errors are one line and name what is nearest."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from artiskill.errors import ArtiSkillError, UnknownNameError


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
        return command.error(f"unexpected argument {unknown[0]!r}")

    def _get_value(self, action: argparse.Action, text: str) -> Any:
        """Argparse's conversion; no path is empty, which would be the working directory."""
        if action.type is Path and not text.strip():
            raise UsageError(f"{'/'.join(action.option_strings) or action.dest} needs a path, not {text!r}")
        return super()._get_value(action, text)

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
    import yaml

    overrides: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not key or not equals:
            raise UsageError(f"--set takes key=value, success.open_fraction=0.5 say, not {pair!r}")
        try:
            overrides[key] = yaml.safe_load(text)
        except yaml.YAMLError as error:
            raise UsageError(f"--set {pair}: the value is not valid YAML") from error
    return overrides
