"""`artiskill demos pictures`: strips of the most different demonstrations of an object."""

import argparse
from pathlib import Path
from typing import Any

_EPILOG = """examples:
  artiskill demos pictures demos/chairs --object chair-0004 --out chair.png
  artiskill demos pictures demos/doors --object cabinet-0006 --target link_1 --count 3 --out door.png"""


def add_command(commands: Any) -> None:
    """Describe the sub-command."""
    parser = commands.add_parser(
        "pictures",
        help="strips of the most different demonstrations of an object",
        description="Draw the most different demonstrations of an object, a row each.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("path", type=Path, help="a folder of demonstrations")
    parser.add_argument("--object", required=True, help="id, or a PartNet folder")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help=".png or .jpg")
    parser.add_argument("--target", metavar="LINK", help="only demonstrations of this link")
    parser.add_argument("--count", type=int, default=5, help="demonstrations (default: %(default)s)")
    parser.add_argument("--moments", type=int, default=5, help="of each (default: %(default)s)")
    parser.add_argument("--view", default="world", help="world, sensor, cloud or all (default: %(default)s)")
    parser.add_argument("--width", type=int, default=320, help="of each picture, pixels (default: %(default)s)")
    parser.add_argument("--azimuth", type=float, metavar="DEG", help="where the camera stands, from +x on")
    parser.add_argument("--elevation", type=float, metavar="DEG", help="its height above the horizon")
    parser.add_argument("--distance", type=float, metavar="METRES", help="from its target")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Draw, write, say what is where."""
    from artiskill.cli.demos_replay import find_object
    from artiskill.demos.demos import Demos
    from artiskill.envs.rendering import Viewpoint
    from artiskill.evaluation.pictures import save_demos_picture
    from artiskill.evaluation.scene_pictures import PictureStyle

    demos = Demos(arguments.path)
    found = find_object(arguments.object, demos)
    name, given = (found, None) if isinstance(found, str) else (found.id, found)
    sensor = arguments.view == "sensor"
    style = PictureStyle(
        view=arguments.view,
        width=None if sensor else arguments.width,
        height=None if sensor else arguments.width * 3 // 4,
        viewpoint=Viewpoint(arguments.azimuth, arguments.elevation, arguments.distance),
    )
    with demos.open(name) as file:
        numbers = save_demos_picture(
            arguments.out, file, style, arguments.count, arguments.moments, arguments.target, given
        )
    print(f"{arguments.out}: {name}, demonstrations {', '.join(map(str, numbers))}")
