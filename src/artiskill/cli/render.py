"""`artiskill render`: pictures of an episode, from the world or by the robot's cameras, or of an object alone."""

import argparse
from pathlib import Path
from typing import Any

_EPILOG = """examples:
  artiskill render --task OpenCabinetDrawer --object cabinet-0023 --level 3 --out look.png
  artiskill render --task OpenCabinetDrawer --object cabinet-0023 --view all --step 60 --out sheet.png
  artiskill render --task OpenCabinetDrawer --object cabinet-0023 --view cloud --azimuth 180 --out episode.gif
  artiskill render --object generated:cabinet:7 --open 0.8 --out cabinet.png

Without --task it is a picture of the object alone, its joints at a share of their ranges; a moving one opens and
closes them. docs/pictures.md says more."""

# what only one of the two kinds of pictures knows
_OF_EPISODES = ("target", "level", "policy", "step", "view", "masks", "set")
_OF_OBJECTS = ("open",)


def add_command(commands: Any) -> None:
    """Describe the command."""
    parser = commands.add_parser(
        "render",
        help="make a picture or film of an episode or an object",
        description="Make a picture or film of an episode or an object.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help=".png, .jpg, .gif, .webp or .mp4")
    parser.add_argument("--object", required=True, help="an id, generated:<category>:<seed>, partnet:<id>, a path")
    parser.add_argument("--width", type=int, help="pixels (default: 640)")
    parser.add_argument("--height", type=int, help="pixels (default: 480)")
    parser.add_argument("--azimuth", type=float, metavar="DEG", help="where the camera stands, from +x on")
    parser.add_argument("--elevation", type=float, metavar="DEG", help="its height above the horizon")
    parser.add_argument("--distance", type=float, metavar="METRES", help="from its target")
    parser.add_argument("--at", type=float, nargs=3, metavar=("X", "Y", "Z"), help="its target, metres")
    parser.add_argument(
        "--look", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="light and more: render.yaml"
    )
    alone = parser.add_argument_group("an object alone")
    alone.add_argument("--open", type=float, nargs="+", metavar="SHARE", help="of all joints or each (default: 0)")
    episode = parser.add_argument_group("an episode")
    episode.add_argument("--task", help="name of the task")
    episode.add_argument("--target", help="the target link (default: the level draws one)")
    episode.add_argument("--level", "--seed", type=int, help="which episode (default: 0)")
    episode.add_argument("--policy", help="expert, random, still or path/to/solution.py (default: expert)")
    episode.add_argument("--step", type=int, help="of a still picture: after so many steps (default: 0)")
    episode.add_argument("--view", help="world, sensor, cloud or all (default: world)")
    episode.add_argument("--masks", action="store_true", default=None, help="paint the task's masks over it")
    episode.add_argument("--set", nargs="+", action="extend", metavar="KEY=VALUE", help="task settings")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Check, draw, write, and say where."""
    from artiskill.cli.parser import UsageError

    alone = arguments.task is None
    reason = "needs --task" if alone else "is for an object alone, without --task"
    for name in _OF_EPISODES if alone else _OF_OBJECTS:
        if getattr(arguments, name) is not None:
            raise UsageError(f"--{name} {reason} (see artiskill render --help)")
    path = _render_object(arguments) if alone else _render_episode(arguments)
    print(f"picture: {path}")


def _render_episode(arguments: argparse.Namespace) -> Path:
    from artiskill.cli.parser import overrides_of
    from artiskill.evaluation.pictures import EpisodeChoice, save_episode_picture
    from artiskill.evaluation.scene_pictures import PictureStyle

    style = PictureStyle(
        view=arguments.view or "world",
        masks=bool(arguments.masks),
        width=arguments.width,
        height=arguments.height,
        viewpoint=_viewpoint(arguments),
        look=_look(arguments),
    )
    episode = EpisodeChoice(
        task=arguments.task,
        object=arguments.object,
        target=arguments.target,
        level=arguments.level or 0,
        policy=arguments.policy or "expert",
        config=overrides_of(arguments.set or []),
    )
    return save_episode_picture(arguments.out, episode, style, arguments.step or 0)


def _render_object(arguments: argparse.Namespace) -> Path:
    from artiskill.evaluation.pictures import save_object_picture

    opened = arguments.open
    if opened is not None and len(opened) == 1:
        opened = opened[0]
    return save_object_picture(
        arguments.out,
        arguments.object,
        opened,
        arguments.width,
        arguments.height,
        _viewpoint(arguments),
        _look(arguments),
    )


def _viewpoint(arguments: argparse.Namespace) -> Any:
    from artiskill.envs.rendering import Viewpoint

    target = None if arguments.at is None else tuple(arguments.at)
    return Viewpoint(arguments.azimuth, arguments.elevation, arguments.distance, target)


def _look(arguments: argparse.Namespace) -> Any:
    from artiskill.cli.parser import overrides_of
    from artiskill.sensors.render_config import load_render_config

    return load_render_config("picture", overrides_of(arguments.look))
