"""`artiskill assets export`: objects as files of other programs."""

import argparse
from pathlib import Path
from typing import Any

_EPILOG = """examples:
  artiskill assets export cabinet-0001 --format mjcf --out exported/cabinet-0001
  artiskill assets export generated:chair:7 --format urdf --out exported/chair
  artiskill assets export partnet:40147 --format gltf --out exported/40147
  artiskill assets export cabinet-0001 chair-0003 --format urdf --out exported     a folder each

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
        help="write objects as MJCF, URDF or glTF",
        description="Write objects as MJCF, URDF or glTF, each into a folder that needs nothing outside it.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "objects", nargs="+", help="ids, generated:<category>:<seed>, partnet:<id>, paths, or splits"
    )
    parser.add_argument("--format", required=True, help="mjcf, urdf or glb (also called gltf)")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FOLDER",
        help="of one object (default: exported/<id>-<format>); of several, each has a folder of its id in it "
        "(default: exported/<format>)",
    )
    parser.add_argument(
        "--force",
        action="store_true",
        help="replace a folder that holds anything but the same object in this format",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Load, write, and say what reads it."""
    from artiskill.assets.catalog import load_object, object_id_of, resolve_objects
    from artiskill.exports.export import export_object, export_objects, format_named

    name = format_named(arguments.format)  # said before an import that takes a while
    items = resolve_objects(arguments.objects)
    if len(items) > 1:
        path = Path()
        for obj, path in export_objects(items, name, arguments.out or Path("exported") / name, arguments.force):
            print(f"{obj.id}: {path}", flush=True)
    else:
        obj = load_object(items[0]) if isinstance(items[0], str) else items[0]
        folder = arguments.out or Path("exported") / f"{object_id_of(obj)}-{name}"
        path = export_object(obj, name, folder, arguments.force)
        print(f"{obj.id}: {path}")
    which = "it" if len(items) == 1 else "one"
    print(f"read {which} with {_HOW_TO_READ[name].format(path=str(path), folder=str(path.parent))}")
