"""Where an object's files lie: the data set's folder, an object's folder, or a zip of one object."""

import os
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from artiskill.errors import AssetError, UnknownNameError, shown
from artiskill.files import is_file, is_folder

DATASET_VARIABLE = "PARTNET_MOBILITY_DATASET"
URDF_NAME = "mobility.urdf"
# Objects of the data set have a few MB; a zip beyond this is no object, or a trap.
_MOST_ZIP_BYTES = 512 * 1024**2
_MOST_ZIP_FILES = 20_000


def find_partnet_folder(
    id: str,  # noqa: A002 - the data set's word
    dataset_dir: Path | str | None = None,
) -> Path:
    """The folder `<dataset>/<id>` or the zip `<dataset>/<id>.zip` of an object.

    Args:
        id: the object's number, `40147` say.
        dataset_dir: folder of the data set; the environment variable PARTNET_MOBILITY_DATASET where None.

    Raises:
        AssetError: no folder is named, or it does not exist.
        UnknownNameError: it holds no such object.
    """
    given = dataset_dir if dataset_dir is not None else os.environ.get(DATASET_VARIABLE)
    if not given:
        raise AssetError(
            f"PartNet-Mobility object {shown(id)}: no data set folder given; pass dataset_dir or set the "
            f"environment variable {DATASET_VARIABLE} to the folder that holds its folder or zip"
        )
    dataset = Path(given).expanduser()
    if not is_folder(dataset):
        source = "dataset_dir" if dataset_dir is not None else DATASET_VARIABLE
        raise AssetError(f"PartNet-Mobility data set folder {str(dataset)!r} (from {source}) does not exist")
    names = {entry.name: entry for entry in dataset.iterdir() if entry.is_dir() or entry.suffix == ".zip"}
    for name in (id, f"{id}.zip"):
        if name in names:
            return names[name]
    legal = {entry.stem if entry.suffix == ".zip" else entry.name for entry in names.values()}
    raise UnknownNameError("PartNet-Mobility object", id, legal, f"(data set folder {str(dataset)!r})")


@contextmanager
def open_object(path: Path) -> Iterator[tuple[Path, str]]:
    """The object's folder and its name; of a zip, a temporary folder that lasts as long as the context.

    Raises:
        AssetError: the path does not exist, is neither folder nor zip, or the zip holds no or several objects.
    """
    if is_folder(path):
        yield path, path.resolve().name
        return
    if not os.path.exists(path):
        raise AssetError(
            f"PartNet folder {shown(str(path))} does not exist; legal: an object's folder or a zip of one"
        )
    if not is_file(path) or not zipfile.is_zipfile(path):
        raise AssetError(f"{str(path)!r} is neither a folder nor a zip; legal: an object's folder or a zip of one")
    with tempfile.TemporaryDirectory(prefix="artiskill-partnet-") as temporary:
        try:
            with zipfile.ZipFile(path) as archive:
                prefix = _object_prefix(archive, path)
                target = Path(temporary) / (prefix.name or path.stem)
                _extract(archive, prefix, target, path)
        except (OSError, ValueError, RuntimeError, EOFError, zipfile.BadZipFile, zlib.error) as error:
            if isinstance(error, AssetError):
                raise
            raise AssetError(f"zip {str(path)!r} cannot be read: {error}") from error
        yield target, target.name


def _object_prefix(archive: zipfile.ZipFile, path: Path) -> PurePosixPath:
    """The folder inside the zip that holds the one mobility.urdf."""
    names = [PurePosixPath(name) for name in archive.namelist()]
    found = sorted(name.parent for name in names if name.name == URDF_NAME and "__MACOSX" not in name.parts)
    if not found:
        top = ", ".join(sorted({name.parts[0] for name in names if name.parts})[:5]) or "nothing"
        raise AssetError(
            f"zip {str(path)!r} holds no {URDF_NAME} (its top level: {top}); legal: one object, as "
            f"{URDF_NAME} or <id>/{URDF_NAME}"
        )
    if len(found) > 1:
        raise AssetError(
            f"zip {str(path)!r} holds {len(found)} objects ({', '.join(str(f) for f in found[:5])}); legal: one. "
            "Unpack it and name one object's folder"
        )
    return found[0]


def _extract(archive: zipfile.ZipFile, prefix: PurePosixPath, target: Path, path: Path) -> None:
    target.mkdir()
    members = [info for info in archive.infolist() if not info.is_dir()]
    if len(members) > _MOST_ZIP_FILES or sum(info.file_size for info in members) > _MOST_ZIP_BYTES:
        legal = f"{_MOST_ZIP_BYTES / 1e6:.0f} MB or {_MOST_ZIP_FILES} files"
        raise AssetError(f"zip {str(path)!r} unpacks to more than {legal}: not one object")
    for info in members:
        name = PurePosixPath(info.filename)
        if not name.is_relative_to(prefix):
            continue
        inside = name.relative_to(prefix)
        if ".." in inside.parts or inside.is_absolute():
            raise AssetError(f"zip {str(path)!r} holds the file {info.filename!r}, which leads outside of it")
        file = target.joinpath(*inside.parts)
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            file.write_bytes(archive.read(info))
        except (zipfile.BadZipFile, RuntimeError, NotImplementedError, EOFError) as error:
            raise AssetError(f"zip {str(path)!r}: the file {info.filename!r} cannot be read: {error}") from error
