"""`artiskill warm`: compile all kernels now, so that no first use has to wait."""

import argparse
from typing import Any


def add_command(commands: Any) -> None:
    """Describe the command."""
    parser = commands.add_parser(
        "warm",
        help="compile all kernels ahead of their first use",
        description="Compile all kernels ahead of their first use, which otherwise waits for those that it needs.",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Compile, with a bar or lines on the way, and print where the code is kept."""
    import time

    from artiskill.cli.progress import Progress
    from artiskill.envs.warm import first_uses
    from artiskill.geometry.kernel_cache import do_not_announce, kernel_folder

    do_not_announce()
    start = time.process_time()
    uses = first_uses()
    with Progress("compiling", len(uses), "uses") as progress:
        for use in uses:
            use()
            progress.advance()
    folder = kernel_folder()
    where = f"kept in {folder}" if folder else "not kept: no folder can be written to"
    print(f"kernels are compiled ({time.process_time() - start:.0f} s of processor time), {where}")
