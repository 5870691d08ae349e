"""Commands that show what there is: `objects`, `tasks`, `protocols`, `config`, `version`; `warm` compiles it."""

import argparse
from functools import partial
from typing import Any

from artiskill.cli.parser import add_command, add_set, overrides_of


def add_commands(commands: Any) -> None:
    """Add the commands."""
    parser = add_command(commands, "objects", _objects, "list objects: id, split, family, target links")
    parser.add_argument("--task", help="list only objects that this task can use")
    parser.add_argument("--category", help="cabinet, chair or bucket")
    parser.add_argument("--split", help="train, test, ood, or all for train and test (default: all)")
    add_command(commands, "tasks", _tasks, "list the tasks and how many objects each split has for them")
    summary = "list the protocols of `evaluate --protocol`, and digests of what they fix"
    add_command(commands, "protocols", _protocols, summary)
    parser = add_command(commands, "config", _config, "show a task's configuration with every value resolved")
    parser.add_argument("action", choices=("show",), metavar="show")
    parser.add_argument("task", help="name of the task, or module:Task of your own package")
    add_set(parser, "change values")
    add_command(commands, "version", _version, "show the versions that results depend on")
    add_command(commands, "warm", _warm, "compile all kernels now instead of on first use")


def _objects(arguments: argparse.Namespace) -> None:
    from artiskill.assets.catalog import list_objects, read_catalog
    from artiskill.assets.needs import task_needs
    from artiskill.errors import UnknownNameError
    from artiskill.tasks.registry import task_names

    # the catalogue serves tasks that are yet to come; what is offered here must also run
    if arguments.task is not None and arguments.task not in task_names():
        raise UnknownNameError("task", arguments.task, task_names())
    motion = None if arguments.task is None else task_needs(arguments.task).motion
    entries = [
        read_catalog()[object_id][1]
        for object_id in list_objects(arguments.category, arguments.split, arguments.task)
    ]
    width = max((len(entry.family) for entry in entries), default=0)
    for entry in entries:
        links = {"prismatic": ("drawers", entry.drawers), "revolute": ("doors", entry.doors)}
        shown = [f"{name} {' '.join(k)}" for kind, (name, k) in links.items() if k and motion in (None, kind)]
        print(f"{entry.id:<12}  {entry.split:<5}  {entry.family:<{width}}  {', '.join(shown)}".rstrip())


def _tasks(arguments: argparse.Namespace) -> None:
    from artiskill.assets.catalog import SPLITS, list_objects
    from artiskill.tasks.registry import task_names

    for name in task_names():
        counts = (f"{len(list_objects(split=split, task=name))} {split}" for split in SPLITS)
        print(f"{name}  {', '.join(counts)} objects")


def _protocols(arguments: argparse.Namespace) -> None:
    from artiskill.evaluation.protocols import standard_protocols

    protocols = standard_protocols()
    width = max(map(len, protocols))
    for name, protocol in protocols.items():
        episodes = f"{len(protocol.rows)} objects x {protocol.arguments['episodes']} levels"
        print(f"{name:<{width}}  {protocol.digest}  {episodes}")


def _config(arguments: argparse.Namespace) -> None:
    from artiskill.config import dump_yaml
    from artiskill.tasks.registry import make_task

    print(dump_yaml(make_task(arguments.task, overrides_of(arguments.set)).config), end="")


def _version(arguments: argparse.Namespace) -> None:
    from artiskill.versions import versions

    for name, number in versions().items():
        print(f"{name} {number}")


def _act_once(name: str) -> None:
    """Have an expert, or the package's policy, act with one arm and with two: they have kernels of their own."""
    from artiskill.assets.catalog import list_objects
    from artiskill.evaluation.pictures import EpisodeChoice
    from artiskill.evaluation.policies import load_policy, policy_of_task

    for task in ("OpenCabinetDrawer", "MoveBucket"):
        actor = load_policy(policy_of_task(name, task))
        env = EpisodeChoice(task, list_objects(task=task)[0]).make_env(actor)
        observation, info = env.reset(seed=0)
        actor.reset(env, observation, info)
        actor.act(env, observation)
        env.close()


def _warm(arguments: argparse.Namespace) -> None:
    import time

    from artiskill.cli.progress import ProgressBar
    from artiskill.envs.warm import first_uses
    from artiskill.geometry.kernel_cache import do_not_announce, kernel_folder

    do_not_announce()
    start = time.process_time()
    uses = first_uses()
    uses += [partial(_act_once, name) for name in ("expert", "pretrained")]
    with ProgressBar("compiling", len(uses), "steps") as progress:
        for use in uses:
            use()
            progress.advance()
    folder = kernel_folder()
    where = f"kept in {folder}" if folder else "not kept: no folder can be written to"
    print(f"kernels are compiled ({time.process_time() - start:.0f} s of processor time), {where}")
