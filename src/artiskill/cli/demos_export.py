"""`artiskill demos export`: training files in the formats of other libraries."""

import argparse
from pathlib import Path
from typing import Any

_EPILOG = """examples:
  artiskill demos export training/chairs --format minari --out ~/.minari/datasets
  artiskill demos export training/chairs --format lerobot --out exported/lerobot --name artiskill/chairs

PATH is a folder that `artiskill demos replay` has made. docs/demonstrations.md says what is where."""


def add_command(commands: Any) -> None:
    """Describe the sub-command."""
    parser = commands.add_parser(
        "export",
        help="training files as a Minari dataset or a LeRobotDataset",
        description="Export training files for other libraries.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("path", type=Path, help="a folder of training files")
    parser.add_argument(
        "--format", required=True, choices=("minari", "lerobot"), metavar="FORMAT", help="minari or lerobot"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="HOME", help="the library's home of datasets")
    parser.add_argument("--name", help="of the dataset: its id, and where it is in HOME")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Check, write, say where it is."""
    from artiskill.cli.demos_table import note_unfinished
    from artiskill.cli.progress import Progress
    from artiskill.demos.export.lerobot import export_lerobot
    from artiskill.demos.export.minari import export_minari
    from artiskill.demos.replay.training_file import TrainingFiles

    training = TrainingFiles(arguments.path)
    export = {"minari": export_minari, "lerobot": export_lerobot}[arguments.format]
    with Progress(f"writing {arguments.format}", max(len(training), 1), "trajectories") as progress:
        path = export(training, arguments.out, arguments.name, progress.advance)
    print(f"{len(training)} trajectories: {path}")
    note_unfinished(arguments.path, "replayed")
