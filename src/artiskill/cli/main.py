"""`artiskill`: finds the command, runs it, and turns errors into one line and an exit status."""

import argparse
import os
import re
import sys
from collections.abc import Sequence
from importlib import import_module

from artiskill import __version__
from artiskill.cli.parser import Parser, add_debug
from artiskill.errors import ArtiSkillError
from artiskill.tasks.registry import load_task

# command -> the module of this package that adds it, in the order of --help
_MODULES = {
    **{"demo": "evaluate", "evaluate": "evaluate", "report": "report", "protocols": "info", "demos": "demos"},
    **{
        "training-set": "training_set",
        "train": "train",
        "export-policy": "export_policy",
        "serve": "serve",
        "render": "render",
    },
    **{"view": "view", "assets": "assets", "bench": "bench", "objects": "info", "tasks": "info"},
    **{"config": "info", "version": "info", "warm": "info"},
}
EXIT_OK, EXIT_ERROR, EXIT_INTERRUPTED, EXIT_BROKEN_PIPE = 0, 2, 130, 141


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command line.

    Args:
        argv: without the program's name; by default the process's own.

    Returns:
        0, or the command's own status, 1 where it found faults; 2 after an error that was explained in one line;
        130 after Ctrl-C; 141 if the reader of the output left.
    """
    argv = list(sys.argv[1:] if argv is None else argv)
    debug = "--debug" in argv
    try:
        arguments = make_parser(argv).parse_strictly(argv)
        _load_tasks(arguments)
        status = arguments.run(arguments)
        sys.stdout.flush()
    except ArtiSkillError as error:
        if debug:
            raise
        print(f"error: {_printable(str(error))}", file=sys.stderr)
        return EXIT_ERROR
    except KeyboardInterrupt as interrupt:
        if debug:
            raise
        if str(interrupt):
            print(interrupt, file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # `artiskill objects | head -1`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python complains while it ends
        return EXIT_BROKEN_PIPE
    return EXIT_OK if status is None else status


def _load_tasks(arguments: argparse.Namespace) -> None:
    """Put the task's name for each `module:Task` that was given; importing the module registers it."""
    given = getattr(arguments, "task", None)
    if isinstance(given, str):
        arguments.task = load_task(given)
    elif given is not None:
        arguments.task = [load_task(one) for one in given]


def _printable(text: str) -> str:
    """Return a text with control characters escaped: text from a user's code must not drive the terminal."""
    return re.sub(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", lambda found: repr(found[0])[1:-1], text)


def make_parser(argv: Sequence[str] = ()) -> Parser:
    """Return the parser of the command that is asked for, or of all commands if none of them is."""
    parser = Parser(
        prog="artiskill", description="Measure how well manipulation policies generalise to unseen objects."
    )
    parser.add_argument("--version", action="version", version=f"artiskill {__version__}")
    add_debug(parser)
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    asked = next((word for word in argv if not word.startswith("-")), "")
    modules = [_MODULES[asked]] if asked in _MODULES else dict.fromkeys(_MODULES.values())
    for module in modules:
        import_module(f"artiskill.cli.{module}").add_commands(commands)
    return parser
