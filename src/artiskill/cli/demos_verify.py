"""`artiskill demos verify`: simulate demonstrations again and compare every bit."""

import argparse
from pathlib import Path
from typing import Any

EXIT_FAULTS = 1

_EPILOG = """examples:
  artiskill demos verify demos/chairs
  artiskill demos verify demos               every folder of demonstrations in it

The exit status is 1 if anything is not as it was recorded. docs/demonstrations.md says what is compared."""


def add_command(commands: Any) -> None:
    """Describe the sub-command."""
    parser = commands.add_parser(
        "verify",
        help="simulate demonstrations again and compare every bit",
        description="Simulate demonstrations again, from level and actions, and compare every bit.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("path", type=Path, help="a folder of demonstrations, or one with such folders")
    parser.add_argument(
        "--objects", nargs="+", metavar="FOLDER", default=[], help="imported objects that no name leads to"
    )
    parser.add_argument("--workers", type=int, help="processes (default: one per core)")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Simulate, compare, show; the exit status."""
    from artiskill.assets.catalog import load_object
    from artiskill.cli.demos_table import note_unfinished, note_versions, print_verdicts
    from artiskill.cli.progress import Progress
    from artiskill.demos.demos import find_folders
    from artiskill.demos.manifest import read_manifest
    from artiskill.demos.verify import verify
    from artiskill.jobs.parallel import available_cores

    workers = available_cores() if arguments.workers is None else arguments.workers
    folders = find_folders(arguments.path)
    objects = [load_object(name) for name in arguments.objects]
    total = sum(entry.trajectories for folder in folders for entry in read_manifest(folder).files.values())
    verdicts = []
    with Progress("verifying", max(total, 1), "trajectories") as progress:
        for folder in folders:
            verdicts += verify(folder, workers, lambda exact: progress.advance(), objects)
    print_verdicts(verdicts)
    for folder in folders:
        note_unfinished(folder)
        note_versions(folder, read_manifest(folder).settings)
    return EXIT_FAULTS if any(verdict.faults for verdict in verdicts) else 0
