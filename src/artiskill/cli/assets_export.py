"""`artiskill assets export`: an object as files of other programs."""

import argparse
from pathlib import Path
from typing import Any

_EPILOG = """examples:
  artiskill assets export cabinet-0001 --format mjcf --out exported/cabinet-0001
  artiskill assets export generated:chair:7 --format urdf --out exported/chair
  artiskill assets export partnet:40147 --format glb --out exported/40147

docs/objects.md says what each format holds."""

_HOW_TO_READ = {
    "mjcf": "mujoco.MjModel.from_xml_path({path!r}); scene.xml beside it has a floor",
    "urdf": "artiskill.load_object(Path({folder!r})), or any program that reads URDF",
    "glb": "any program that reads glTF",
}


def add_command(commands: Any) -> None:
    """Describe the command."""
    parser = commands.add_parser(
        "export",
        help="write an object as MJCF, URDF or glTF",
        description="Write an object as MJCF, URDF or glTF, into a folder that needs nothing outside it.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("object", help="an id, generated:<category>:<seed>, partnet:<id> or a path")
    parser.add_argument("--format", required=True, help="mjcf, urdf or glb")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="(default: exported/<id>-<format>)")
    parser.add_argument("--force", action="store_true", help="replace a folder that holds other files")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Load, write, and say what reads it."""
    from artiskill.assets.catalog import load_object
    from artiskill.errors import UnknownNameError
    from artiskill.exports.export import FORMATS, export_object

    if arguments.format not in FORMATS:  # said before an import that takes a while
        raise UnknownNameError("format", arguments.format, FORMATS)
    obj = load_object(arguments.object)
    folder = arguments.out or Path("exported") / f"{obj.id}-{arguments.format}"
    path = export_object(obj, arguments.format, folder, arguments.force)
    print(f"{obj.id}: {path}")
    print(f"read it with {_HOW_TO_READ[arguments.format].format(path=str(path), folder=str(path.parent))}")
