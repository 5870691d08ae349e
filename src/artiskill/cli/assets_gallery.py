"""`artiskill assets gallery`: a page to browse objects, and contact sheets."""

import argparse
from pathlib import Path
from typing import Any

_EPILOG = """examples:
  artiskill assets gallery
  artiskill assets gallery test ood --out results/unseen
  artiskill assets gallery cabinet-0001 generated:chair:0..9 --out results/some

Open index.html in the folder with a browser; it needs no server and no network."""


def add_command(commands: Any) -> None:
    """Describe the command."""
    parser = commands.add_parser(
        "gallery",
        help="make a page to browse objects",
        description="Make a page to browse objects, and contact sheets of them, closed and open.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "objects",
        nargs="*",
        default=["train", "test", "ood"],
        help="splits, ids, YAML lists, PartNet folders (default: train test ood)",
    )
    parser.add_argument("--out", type=Path, default=Path("gallery"), metavar="FOLDER", help="(default: gallery)")
    parser.add_argument("--workers", type=int, help="processes (default: one per core)")
    parser.add_argument("--force", action="store_true", help="write into a folder that holds other files")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Draw what is not drawn yet, and write the page."""
    from artiskill.assets.catalog import resolve_objects
    from artiskill.cli.progress import Progress
    from artiskill.gallery.gallery import make_gallery
    from artiskill.jobs.parallel import available_cores

    objects = resolve_objects(arguments.objects)
    workers = available_cores() if arguments.workers is None else arguments.workers
    with Progress("gallery", len(objects), "objects") as progress:
        page = make_gallery(objects, arguments.out, workers, progress.advance, arguments.force)
    print(f"gallery: {page}")
