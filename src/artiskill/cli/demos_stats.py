"""`artiskill demos stats`: what demonstrations there are, in numbers."""

import argparse
import json
from pathlib import Path
from typing import Any

_EPILOG = """examples:
  artiskill demos stats demos/chairs
  artiskill demos stats demos --json demos/stats.json

docs/demonstrations.md says what the columns are."""


def add_command(commands: Any) -> None:
    """Describe the sub-command."""
    parser = commands.add_parser(
        "stats",
        help="count demonstrations: success rates, lengths, sizes, coverage",
        description="Count demonstrations.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("path", type=Path, help="a folder of demonstrations, or one with such folders")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers here")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Read, show, write."""
    from artiskill.cli.demos_table import note_unfinished, print_stats
    from artiskill.cli.progress import Progress
    from artiskill.demos.demos import find_folders
    from artiskill.demos.manifest import read_manifest
    from artiskill.demos.stats import folder_stats

    folders = find_folders(arguments.path)
    total = sum(len(read_manifest(folder).files) for folder in folders)
    with Progress("reading", max(total, 1), "files") as progress:
        found = [folder_stats(folder, progress.advance) for folder in folders]
    for folder, stats in zip(folders, found, strict=True):
        print_stats(stats)
        note_unfinished(folder)
    if arguments.json is not None:
        _write([stats.to_mapping() for stats in found], arguments.json)
        print(f"numbers: {arguments.json}")


def _write(content: Any, path: Path) -> None:
    from artiskill.errors import ConfigError
    from artiskill.files import atomic_write

    try:
        with atomic_write(path) as temporary:
            temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"cannot write {str(path)!r}: {error.strerror or error}") from error
