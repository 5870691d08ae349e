"""`export_object`: an object to a self-contained folder of another program's format."""

from collections.abc import Callable
from pathlib import Path

from artiskill import __version__
from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.errors import check_name
from artiskill.exports.folders import replace_folder
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


def export_object(
    obj: ArticulatedObject,
    format: str,  # noqa: A002 - the word that everyone uses
    folder: Path | str,
    force: bool = False,
) -> Path:
    """Write an object to a folder of its own; all paths inside are relative to it.

    Args:
        obj: the object.
        format: `mjcf` (MuJoCo), `urdf` (laid out like PartNet-Mobility; `load_object` reads it back) or `glb`
            (binary glTF, for looking at; needs the extra `export`).
        folder: made where it is missing; it appears complete or not at all. An earlier export there is replaced.
        force: also replace a folder with other files in it.

    Returns:
        The main file: `<id>.xml`, `mobility.urdf` or `<id>.glb`.

    Raises:
        UnknownNameError: no such format.
        ConfigError: the folder holds files that no export wrote, or cannot be written.
        MissingExtraError: `glb` without the extra `export`.
    """
    check_name("format", format, FORMATS)
    marker = {
        "made_by": f"ArtiSkill {__version__}",
        "format": format,
        "object": obj.id,
        "category": obj.category,
        "content_hash": obj.content_hash,
        "source": str(obj.metadata.get("source", "unknown")),
    }
    return replace_folder(output_path(folder), lambda new: _WRITERS[format](obj, new), marker, force)
