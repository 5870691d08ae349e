"""`artiskill assets check`: are objects fit for the benchmark? A table, the faults, and a JSON file."""

import argparse
from pathlib import Path
from typing import Any

EXIT_FAULTS = 1

_EPILOG = """examples:
  artiskill assets check                         the whole catalogue
  artiskill assets check cabinet-0005 generated:cabinet:7
  artiskill assets check ./partnet/40147 --json faults.json
  artiskill assets check test --set settle.drift_m=0.001

The exit status is 1 if anything is wrong. docs/checks.md says what is checked and how."""


def add_command(commands: Any) -> None:
    """Describe the sub-command."""
    parser = commands.add_parser(
        "check",
        help="verify objects: geometry, joints, masses, handles, likeness",
        description="Verify objects one by one, and compare each with the others.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("objects", nargs="*", default=["all"], help="splits, ids, PartNet folders (default: all)")
    parser.add_argument("--workers", type=int, help="processes (default: one per core)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every result here")
    parser.add_argument("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="change limits")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Check, write, show; the exit status."""
    from artiskill.assets.catalog import resolve_objects
    from artiskill.checks.config import load_checks_config
    from artiskill.checks.runner import check_objects, write_json
    from artiskill.cli.check_table import print_checks
    from artiskill.cli.parser import overrides_of
    from artiskill.cli.progress import Progress
    from artiskill.files import check_output_folder, output_path
    from artiskill.jobs.parallel import available_cores

    if arguments.json is not None:
        check_output_folder(output_path(arguments.json).absolute().parent)
    config = load_checks_config(overrides_of(arguments.set))
    items = resolve_objects(arguments.objects)
    workers = available_cores() if arguments.workers is None else arguments.workers
    with Progress("checking", len(items), "objects") as progress:
        reports = check_objects(items, config, workers, lambda report: progress.advance())
    print_checks(reports)
    if arguments.json is not None:
        write_json(reports, config, arguments.json)
        print(f"results: {arguments.json}")
    return 0 if all(report.passed for report in reports) else EXIT_FAULTS
