"""`export_object`: an object to a self-contained folder of another program's format; `export_objects`: many."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from artiskill import __version__
from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object, object_id_of
from artiskill.errors import check_name
from artiskill.exports.folders import check_replaceable, replace_folder
from artiskill.exports.glb import write_glb
from artiskill.exports.mjcf import write_mjcf
from artiskill.exports.urdf import write_urdf
from artiskill.jobs.whole_files import output_path

_WRITERS: dict[str, Callable[[ArticulatedObject, Path], Path]] = {
    "mjcf": write_mjcf,
    "urdf": write_urdf,
    "glb": write_glb,
}
FORMATS = tuple(_WRITERS)
_OTHER_NAMES = {"gltf": "glb"}  # what else people call them


def export_object(
    obj: ArticulatedObject,
    format: str,  # noqa: A002 - the word that everyone uses
    folder: Path | str,
    force: bool = False,
) -> Path:
    """Write an object to a folder of its own; all paths inside are relative to it.

    Args:
        obj: the object.
        format: `mjcf` (MuJoCo), `urdf` (laid out like PartNet-Mobility; `load_object` reads it back) or `glb`,
            also called `gltf` (binary glTF, for looking at; needs the extra `export`).
        folder: made where it is missing; it appears complete or not at all. An earlier export of this object in
            this format is replaced.
        force: also replace a folder with other files in it, with another object, or in another format.

    Returns:
        The main file: `<id>.xml`, `mobility.urdf` or `<id>.glb`.

    Raises:
        UnknownNameError: no such format.
        ConfigError: the folder holds files that no export of this object wrote, or cannot be written.
        MissingExtraError: `glb` without the extra `export`.
    """
    name = format_named(format)
    marker = {
        "made_by": f"ArtiSkill {__version__}",
        "format": name,
        "object": obj.id,
        "category": obj.category,
        "content_hash": obj.content_hash,
        "source": str(obj.metadata.get("source", "unknown")),
    }
    return replace_folder(output_path(folder), lambda new: _WRITERS[name](obj, new), marker, force)


def export_objects(
    objects: Iterable[str | ArticulatedObject],
    format: str,  # noqa: A002
    folder: Path | str,
    force: bool = False,
) -> Iterator[tuple[ArticulatedObject, Path]]:
    """Write each object to a folder of its own, `<folder>/<id>`, one after the other.

    Args:
        objects: themselves, or names that `load_object` takes.
        format: as of `export_object`.
        folder: above the objects' own.
        force: as of `export_object`.

    Yields:
        Each object and its main file, once it is there.

    Raises:
        UnknownNameError, ConfigError, MissingExtraError: as `export_object`; of all folders before any is written.
    """
    name, above, items = format_named(format), output_path(folder), tuple(objects)
    for item in items:
        object_id = object_id_of(item)
        check_replaceable(above / object_id, object_id, name, force)
    for item in items:
        obj = load_object(item) if isinstance(item, str) else item
        yield obj, export_object(obj, name, above / obj.id, force)


def format_named(given: str) -> str:
    """The one of `FORMATS` that a name means.

    Raises:
        UnknownNameError: none.
    """
    check_name("format", given, (*FORMATS, *_OTHER_NAMES))
    return _OTHER_NAMES.get(given, given)
