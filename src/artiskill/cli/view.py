"""`artiskill view`: episodes, demonstrations and objects in a browser, or one episode as a file."""

import argparse
from pathlib import Path
from typing import Any

from artiskill.cli.parser import UsageError, add_command, add_set, overrides_of

_EPILOG = """examples:
  artiskill view                                    watch the expert; choose another episode on the page
  artiskill view --task PushChair --level 3 --policy my/solution.py
  artiskill view demos/drawer --demonstration 12    scrub through a demonstration
  artiskill view cabinet-0005 chair-0001 ./my/folder
  artiskill view --task OpenCabinetDrawer --export episode.html

Without --host, only this machine can open the page. See docs/viewer.md."""

_TASK = "OpenCabinetDrawer"
_OF_EPISODES = ("object", "target", "level", "policy", "set", "task")


def add_commands(commands: Any) -> None:
    """Add the command."""
    summary = "show episodes, demonstrations or objects in a browser"
    parser = add_command(commands, "view", _view, summary, _EPILOG)
    add = parser.add_argument
    add("what", nargs="*", help="a folder or file of demonstrations, or objects; without it, an episode is played")
    episode = parser.add_argument_group("an episode").add_argument
    episode("--task", help=f"name of the task, or module:Task (default: that of a trained policy, else {_TASK})")
    episode("--object", help="id, generated:<category>:<seed>, partnet:<id> or path (default: a training object)")
    episode("--target", help="target link (default: drawn by the level)")
    episode("--level", "--seed", type=int, help="level (seed) of the episode (default: 0)")
    policies = "expert, demonstrator, random, still, path/to/solution.py or a training run (default: expert)"
    episode("--policy", help=policies)
    add_set(parser, "change values of the task's configuration")
    demos = parser.add_argument_group("demonstrations").add_argument
    demos("--demonstration", type=int, metavar="N", help="which one of the first object (default: 0)")
    add("--export", type=Path, metavar="FILE", help="write the episode as one .html that needs no server, and end")
    add("--paused", action="store_true", help="do not play at once")
    reach = "address to listen to; whoever reaches it can see and steer the page (default: this machine alone)"
    add("--host", help=reach)
    add("--port", type=int, help="0 for any that is free (default: 8080)")


def _view(arguments: argparse.Namespace) -> None:
    from artiskill.viewer import import_viser

    import_viser()
    demos = _demos_of(arguments.what)
    _check_options(arguments, is_objects=bool(arguments.what) and demos is None, is_demos=demos is not None)
    if arguments.what and demos is None:
        _view_objects(arguments)
        return
    picker = _demo_picker(arguments, demos) if demos is not None else _live_picker(arguments)
    if arguments.export is not None:
        _export(picker, arguments.export)
        return
    from artiskill.viewer.episode_page import EpisodePage

    with _serving(arguments) as server:
        page = EpisodePage(server, picker, plays=not arguments.paused)
        _say_where(arguments, server)
        page.run()


def _demos_of(what: list[str]) -> Path | None:
    """Return the folder or file of demonstrations that is meant; None where objects are, or nothing is."""
    if len(what) != 1:
        return None
    path = Path(what[0])
    return path if path.suffix == ".h5" or (path / "manifest.json").is_file() else None


def _check_options(arguments: argparse.Namespace, is_objects: bool, is_demos: bool) -> None:
    for name in (*_OF_EPISODES, "demonstration", "export"):
        given = getattr(arguments, name) not in (None, [])
        wrong = (is_objects, is_objects or is_demos, not is_demos)[
            0 if name == "export" else 2 if name == "demonstration" else 1
        ]
        if given and wrong:
            kind = "objects" if is_objects else "demonstrations" if is_demos else "an episode that is played"
            raise UsageError(f"--{name} does not go with {kind} (see artiskill view --help)")


def _live_picker(arguments: argparse.Namespace) -> Any:
    from artiskill.assets.catalog import list_objects
    from artiskill.evaluation.pictures import EpisodeChoice
    from artiskill.evaluation.policies import trained_task
    from artiskill.tasks.registry import task_spec
    from artiskill.viewer.pickers import LivePicker

    policy = arguments.policy or "expert"
    task = arguments.task or trained_task(policy) or _TASK
    task_spec(task)
    choice = EpisodeChoice(
        task=task,
        object=arguments.object or list_objects(split="train", task=task)[0],
        target=arguments.target,
        level=arguments.level or 0,
        policy=policy,
        config=overrides_of(arguments.set),
    )
    return LivePicker(choice)


def _demo_picker(arguments: argparse.Namespace, path: Path) -> Any:
    from artiskill.viewer.pickers import DemoPicker

    return DemoPicker(path, arguments.demonstration or 0)


def _export(picker: Any, path: Path) -> None:
    from artiskill.viewer.episode_page import export_episode

    written = export_episode(picker.load(), path)
    print(f"replay: {written} ({written.stat().st_size / 1e6:.1f} MB)")


def _view_objects(arguments: argparse.Namespace) -> None:
    import threading

    from artiskill.assets.catalog import resolve_objects
    from artiskill.viewer.object_page import ObjectPage

    items = resolve_objects(arguments.what)
    with _serving(arguments) as server:
        ObjectPage(server, items)
        _say_where(arguments, server)
        threading.Event().wait()


def _serving(arguments: argparse.Namespace) -> Any:
    from artiskill.viewer import LOOPBACK, PORT, serving

    port = PORT if arguments.port is None else arguments.port
    return serving(arguments.host or LOOPBACK, port)


def _say_where(arguments: argparse.Namespace, server: Any) -> None:
    host = arguments.host or "127.0.0.1"
    host = "localhost" if host in ("0.0.0.0", "::") else host
    print(f"open http://{host}:{server.get_port()} in a browser; Ctrl-C ends", flush=True)
