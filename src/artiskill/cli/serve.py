"""`artiskill serve`: a policy for evaluations in other processes or on other machines."""

import argparse
from typing import Any

from artiskill.cli.parser import add_command

_EPILOG = """examples:
  artiskill serve runs/drawer-dagger
  artiskill evaluate --policy ws://localhost:8000 --objects test        in another terminal

It speaks openpi's WebSocket protocol. Without --host, only this machine reaches it. If the environment variable
ARTISKILL_API_KEY is set, clients must give the same key. See docs/remote_policies.md."""


def add_commands(commands: Any) -> None:
    """Add the command."""
    summary = "serve a policy to `artiskill evaluate --policy ws://host:port`"
    parser = add_command(commands, "serve", _serve, summary, _EPILOG)
    add = parser.add_argument
    add("policy", help="a training run, an exported .npz, path/to/solution.py or pretrained")
    add(
        "--task", help="name of the task, or module:Task, where the policy does not say it; needed by `pretrained`"
    )
    add("--obs-mode", help="observation mode of a solution that declares none (default: state)")
    add("--control-mode", help="likewise its control mode (default: joint)")
    confined = (
        "how a solution file is confined, as of `artiskill evaluate`; none gives it a GPU (default: the best)"
    )
    add("--sandbox", metavar="NAME", help=confined)
    reach = "address to listen to; whoever reaches it can use the policy (default: this machine alone)"
    add("--host", default="127.0.0.1", help=reach)
    add("--port", type=int, default=8000, help="0 for any that is free (default: %(default)s)")


def _serve(arguments: argparse.Namespace) -> None:
    from artiskill.evaluation.serve import serve

    serve(
        arguments.policy,
        arguments.port,
        arguments.host,
        task=arguments.task,
        obs_mode=arguments.obs_mode,
        control_mode=arguments.control_mode,
        sandbox=arguments.sandbox,
        on_event=lambda text: print(text, flush=True),
    )
