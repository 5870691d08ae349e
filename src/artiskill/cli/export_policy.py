"""`artiskill export-policy`: a trained policy in one file that acts without torch."""

import argparse
from pathlib import Path
from typing import Any

from artiskill.cli.parser import add_command

_EPILOG = """examples:
  artiskill export-policy runs/drawer-bc drawer.npz
  artiskill evaluate --task OpenCabinetDrawer --policy drawer.npz

A solution file loads it, without torch: artiskill.learning.array_policy.ArrayPolicy("drawer.npz")"""


def add_commands(commands: Any) -> None:
    """Add the command."""
    summary = "write a training run's policy to one file that acts without torch"
    parser = add_command(commands, "export-policy", _export_policy, summary, _EPILOG)
    parser.add_argument("folder", type=Path, metavar="RUN", help="folder of the run, or one of its checkpoints")
    parser.add_argument("file", type=Path, metavar="FILE", help="file to write, .npz")
    recovery = "give a command of another kind where it stands still; of dagger and command_bc"
    parser.add_argument("--recovery", action="store_true", help=recovery)


def _export_policy(arguments: argparse.Namespace) -> None:
    from artiskill.learning.run import check_torch

    check_torch("exporting a policy")
    from artiskill.learning.policy import export_policy, weights_step

    header = export_policy(arguments.folder, arguments.file, arguments.recovery)
    size = arguments.file.stat().st_size / 1e6
    step, steps = weights_step(arguments.folder)
    saved = f"as it was after step {step} of {steps}"
    print(f"exported: {arguments.file} ({size:.1f} MB), {header.algorithm} of {arguments.folder}, {saved}")
    print(f"measure it: artiskill evaluate --task {header.task} --policy {arguments.file}")
