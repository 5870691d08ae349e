"""`artiskill view`: episodes, demonstrations, reports and objects in a browser, or one episode as a file."""

import argparse
import signal
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from artiskill.cli.parser import UsageError, add_command, add_set, overrides_of

_EPILOG = """examples:
  artiskill view                                    watch the expert; choose another episode on the page
  artiskill view --task PushChair --level 3 --policy my/solution.py
  artiskill view demos/drawer --demonstration 12    scrub through a demonstration
  artiskill view results/mine --episode 12          the same of an evaluated episode
  artiskill view --record demos/mine                drive by hand, and keep what you solve
  artiskill view cabinet-0005 chair-0001 ./my/folder
  artiskill view --task OpenCabinetDrawer --export episode.html

Without --host, only this machine can open the page. See docs/viewer.md."""

_TASK = "OpenCabinetDrawer"
_OBJECTS, _DEMOS, _REPORT, _EPISODE = "objects", "demonstrations", "a report", "an episode that is played"
_OF_EPISODES = ("object", "target", "level", "policy", "record", "set", "task")


def add_commands(commands: Any) -> None:
    """Add the command."""
    summary = "show episodes, demonstrations, reports or objects in a browser"
    parser = add_command(commands, "view", _view, summary, _EPILOG)
    add = parser.add_argument
    what = "a folder or file of demonstrations, a report's folder, or objects; without it, an episode is played"
    add("what", nargs="*", help=what)
    episode = parser.add_argument_group("an episode").add_argument
    episode("--task", help=f"name of the task, or module:Task (default: that of a trained policy, else {_TASK})")
    episode("--object", help="id, generated:<category>:<seed>, partnet:<id> or path (default: a training object)")
    episode("--target", help="target link (default: drawn by the level)")
    episode("--level", "--seed", type=int, help="level (seed) of the episode (default: 0)")
    policies = "expert, demonstrator, pretrained, random, still, solution.py or a training run (default: expert)"
    episode("--policy", help=policies)
    stored = "add every episode that you solve by hand to this folder of demonstrations"
    episode("--record", type=Path, metavar="FOLDER", help=stored)
    add_set(parser, "change values of the task's configuration")
    demos = parser.add_argument_group("demonstrations").add_argument
    demos("--demonstration", type=int, metavar="N", help="which one of the first object (default: 0)")
    reports = parser.add_argument_group("reports").add_argument
    reports("--episode", type=int, metavar="N", help="which line of episodes.csv, from 0 (default: 0)")
    add("--export", type=Path, metavar="FILE", help="write the episode as one .html that needs no server, and end")
    add("--paused", action="store_true", help="do not play at once")
    reach = "address to listen to; whoever reaches it can see and steer the page (default: this machine alone)"
    add("--host", help=reach)
    add("--port", type=int, help="0 for any that is free (default: 8080)")


def _view(arguments: argparse.Namespace) -> None:
    from artiskill.viewer import import_viser

    import_viser()
    kind = _kind_of(arguments.what)
    _check_options(arguments, kind)
    if arguments.export is not None:
        _export(_picker(arguments, kind), arguments.export)
        return
    with _serving(arguments) as server:
        _say_where(arguments, server)  # browsers load the page while the episode is loaded here
        note = server.gui.add_markdown("loading ...")
        _import_page(kind)
        run = _object_page(arguments, server) if kind == _OBJECTS else _episode_page(arguments, kind, server)
        note.remove()
        run()


def _import_page(kind: str) -> None:
    """Import what a page needs, 0.9 s; Ctrl-C is obeyed afterwards, for some packages fail by it or swallow it."""
    interrupts: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: interrupts.append(number))
    try:
        from artiskill.exports.glb import import_trimesh

        import_trimesh()
        import_module("artiskill.viewer.object_page" if kind == _OBJECTS else "artiskill.viewer.pickers")
    finally:
        signal.signal(signal.SIGINT, before)
    if interrupts:
        raise KeyboardInterrupt


def _episode_page(arguments: argparse.Namespace, kind: str, server: Any) -> Callable[[], None]:
    """Add the page of an episode; returns what keeps it going."""
    picker = _picker(arguments, kind)
    from artiskill.viewer.episode_page import EpisodePage

    return EpisodePage(server, picker, plays=not arguments.paused, record=arguments.record).run


def _object_page(arguments: argparse.Namespace, server: Any) -> Callable[[], Any]:
    """Add the page of objects; returns what waits until the process is interrupted."""
    from threading import Event

    from artiskill.assets.catalog import resolve_objects
    from artiskill.viewer.object_page import ObjectPage

    ObjectPage(server, resolve_objects(arguments.what))
    return Event().wait


def _kind_of(what: list[str]) -> str:
    """Return what is meant: objects, unless it is one file or folder of demonstrations, or one report."""
    if not what:
        return _EPISODE
    path = Path(what[0])
    if len(what) == 1 and (path.suffix == ".h5" or (path / "manifest.json").is_file()):
        return _DEMOS
    return _REPORT if len(what) == 1 and (path / "report.json").is_file() else _OBJECTS


def _check_options(arguments: argparse.Namespace, kind: str) -> None:
    """Raise `UsageError` for an option that does not go with what is shown."""
    legal = {"demonstration": (_DEMOS,), "episode": (_REPORT,), "export": (_EPISODE, _DEMOS, _REPORT)}
    for name in (*_OF_EPISODES, *legal):
        if getattr(arguments, name) not in (None, []) and kind not in legal.get(name, (_EPISODE,)):
            raise UsageError(f"--{name} does not go with {kind} (see artiskill view --help)")


def _picker(arguments: argparse.Namespace, kind: str) -> Any:
    from artiskill.viewer.pickers import DemoPicker, ReportPicker

    if kind == _EPISODE:
        return _live_picker(arguments)
    path = Path(arguments.what[0])
    if kind == _DEMOS:
        return DemoPicker(path, arguments.demonstration or 0)
    return ReportPicker(path, arguments.episode or 0)


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


def _export(picker: Any, path: Path) -> None:
    from artiskill.viewer.replay import export_episode

    written = export_episode(picker.load(), path)
    print(f"replay: {written} ({written.stat().st_size / 1e6:.1f} MB)")


def _serving(arguments: argparse.Namespace) -> Any:
    from artiskill.viewer import LOOPBACK, PORT, serving

    port = PORT if arguments.port is None else arguments.port
    return serving(arguments.host or LOOPBACK, port)


def _say_where(arguments: argparse.Namespace, server: Any) -> None:
    host = arguments.host or "127.0.0.1"
    host = "localhost" if host in ("0.0.0.0", "::") else host
    print(f"open http://{host}:{server.get_port()} in a browser; Ctrl-C ends", flush=True)
