"""`artiskill render`: pictures and videos of an episode or of an object alone."""

import argparse
from pathlib import Path
from typing import Any

from artiskill.cli.parser import UsageError, add_command, add_set, overrides_of

_EPILOG = """examples:
  artiskill render --task OpenCabinetDrawer --object cabinet-0023 --level 3 --out look.png
  artiskill render --task OpenCabinetDrawer --object cabinet-0023 --view all --step 60 --out sheet.png
  artiskill render --task OpenCabinetDrawer --object cabinet-0023 --view cloud --azimuth 180 --out episode.gif
  artiskill render --object generated:cabinet:7 --open 0.8 --out cabinet.png

Without --task, the object is drawn alone; a video opens and closes its joints. See docs/pictures.md."""

# options of only one of the two kinds of pictures
_OF_EPISODES = ("target", "level", "policy", "step", "view", "masks", "set")
_OF_OBJECTS = ("open",)


def add_commands(commands: Any) -> None:
    """Add the command."""
    parser = add_command(
        commands, "render", _render, "draw an episode or an object, as a picture or video", _EPILOG
    )
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help=".png, .jpg, .gif, .webp or .mp4")
    parser.add_argument("--object", required=True, help="id, generated:<category>:<seed>, partnet:<id> or path")
    parser.add_argument("--width", type=int, help="pixels (default: 640)")
    parser.add_argument("--height", type=int, help="pixels (default: 480)")
    parser.add_argument("--azimuth", type=float, metavar="DEG", help="direction of the camera, counted from +x")
    parser.add_argument("--elevation", type=float, metavar="DEG", help="angle of the camera above the horizon")
    parser.add_argument(
        "--distance", type=float, metavar="METRES", help="from the camera to the point it looks at"
    )
    parser.add_argument(
        "--at", type=float, nargs=3, metavar=("X", "Y", "Z"), help="point that the camera looks at, in metres"
    )
    add_set(parser, "change light and other values of render.yaml", "--look")
    alone = parser.add_argument_group("an object alone")
    alone.add_argument(
        "--open",
        type=float,
        nargs="+",
        metavar="SHARE",
        help="how far joints are open, one share for all or one each (default: 0)",
    )
    episode = parser.add_argument_group("an episode")
    episode.add_argument("--task", help="name of the task, or module:Task of your own package")
    episode.add_argument("--target", help="target link (default: drawn by the level)")
    episode.add_argument("--level", "--seed", type=int, help="level (seed) of the episode (default: 0)")
    episode.add_argument("--policy", help="expert, random, still or path/to/solution.py (default: expert)")
    episode.add_argument("--step", type=int, help="draw a still picture after this many steps (default: 0)")
    episode.add_argument("--view", help="world, sensor, cloud or all (default: world)")
    episode.add_argument("--masks", action="store_true", default=None, help="colour the task's segmentation masks")
    episode.add_argument(
        "--set", nargs="+", action="extend", metavar="KEY=VALUE", help="change values of the task's configuration"
    )


def _render(arguments: argparse.Namespace) -> None:
    alone = arguments.task is None
    reason = "needs --task" if alone else "cannot be combined with --task"
    for name in _OF_EPISODES if alone else _OF_OBJECTS:
        if getattr(arguments, name) is not None:
            raise UsageError(f"--{name} {reason} (see artiskill render --help)")
    path = _render_object(arguments) if alone else _render_episode(arguments)
    print(f"picture: {path}")


def _render_episode(arguments: argparse.Namespace) -> Path:
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
    from artiskill.sensors.render_config import load_render_config

    return load_render_config("picture", overrides_of(arguments.look))
