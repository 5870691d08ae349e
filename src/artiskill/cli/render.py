"""`artiskill render`: pictures and videos of an episode or of an object alone."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from artiskill.cli.parser import UsageError, add_command, add_set, overrides_of

_EPILOG = """examples:
  artiskill render --task OpenCabinetDrawer --object cabinet-0023 --level 3 --out look.png
  artiskill render --task OpenCabinetDrawer --object cabinet-0023 --view all --step 60 --out sheet.png
  artiskill render --task OpenCabinetDrawer --object cabinet-0023 --view cloud --azimuth 180 --out episode.gif
  artiskill render --task PushChair --object chair-0004 --policy pretrained --view points --out film.webp
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
    add = parser.add_argument
    add("--out", type=Path, required=True, metavar="FILE", help=".png, .jpg, .gif, .webp or .mp4")
    add("--object", required=True, help="id, generated:<category>:<seed>, partnet:<id> or path")
    add("--width", type=int, help="pixels (default: 640)")
    add("--height", type=int, help="pixels (default: 480)")
    add("--azimuth", type=float, metavar="DEG", help="direction of the camera, counted from +x")
    add("--elevation", type=float, metavar="DEG", help="angle of the camera above the horizon")
    add("--distance", type=float, metavar="METRES", help="from the camera to the point it looks at")
    at = "point that the camera looks at, in metres"
    add("--at", type=float, nargs=3, metavar=("X", "Y", "Z"), help=at)
    add_set(parser, "change light and other values of render.yaml", "--look")
    alone = parser.add_argument_group("an object alone").add_argument
    opened = "how far joints are open, one share for all or one each (default: 0)"
    alone("--open", type=float, nargs="+", metavar="SHARE", help=opened)
    _add_episode_options(parser.add_argument_group("an episode").add_argument)


def _add_episode_options(add: Callable[..., object]) -> None:
    add("--task", help="name of the task")
    add("--target", help="target link (default: drawn by the level)")
    add("--level", "--seed", type=int, help="level (seed) of the episode (default: 0)")
    add("--policy", help="expert, random, still, pretrained or path/to/solution.py (default: expert)")
    add("--step", type=int, help="draw a still picture after this many steps (default: 0)")
    add("--view", help="world, sensor, cloud, all or points (default: world)")
    add("--masks", action="store_true", default=None, help="colour the task's segmentation masks")
    changes = "change values of the task's configuration"
    add("--set", nargs="+", action="extend", metavar="KEY=VALUE", help=changes)


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
