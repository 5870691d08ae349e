"""Wavefront OBJ and MTL as PartNet-Mobility writes them: one triangle mesh per material, with UVs.

Texture coordinates keep OBJ's convention: (0, 0) is the image's lower left corner, values beyond [0, 1] repeat.
"""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import Material
from artiskill.errors import AssetError
from artiskill.geometry.meshes import TriMesh, triangle_areas

# The data set's models measure about 2 across; areas and volumes of larger coordinates would overflow.
_LARGEST_COORDINATE = 1e6
# Statements of an MTL file that hold numbers, and how many; others are skipped or names.
_MTL_NUMBERS = {"Kd": 3, "d": 1, "Tr": 1, "Ns": 1}
# A Phong exponent this high looks polished; the data set's wood has 30.
_POLISHED_EXPONENT = 200.0
_GREY = (0.7, 0.7, 0.7)


@dataclass(frozen=True)
class ObjMaterial:
    """What an MTL file says: sRGB colour and opacity in [0, 1], the texture's path or None, Phong exponent."""

    rgb: tuple[float, float, float] = _GREY
    alpha: float = 1.0
    texture: Path | None = None
    exponent: float = 30.0


@dataclass(frozen=True, eq=False)
class ObjPart:
    """The faces of one `usemtl` section, or of several with equal materials; `mesh` in the file's coordinates."""

    material: ObjMaterial
    mesh: TriMesh


def read_obj(path: Path, where: str) -> tuple[ObjPart, ...]:
    """Read an OBJ file and its materials.

    Polygons become fans of triangles; negative indices count from the end; normals, groups and smoothing are
    skipped. A missing material file or image is no error: the part is grey, as viewers draw it.

    Args:
        path: the file.
        where: what it belongs to, for messages.

    Raises:
        AssetError: the file is missing, has a line that does not parse, an index out of range, a coordinate that
            is not finite or too large, no face or no area; or its material file does not parse.
    """
    if not path.is_file():
        raise AssetError(f"{where}: mesh file {path.name!r} does not exist in {path.parent.name!r}")
    reader = _ObjReader(path, f"{where}: mesh file {path.name!r}")
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise AssetError(f"{where}: mesh file {path.name!r} cannot be read: {error.strerror}") from error
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split("#", 1)[0].split()
        if words:
            reader.read(words, number)
    return reader.parts()


class _ObjReader:
    """Collects one file's lines."""

    def __init__(self, path: Path, where: str) -> None:
        self._path, self._where = path, where
        self._points: list[tuple[float, ...]] = []
        self._uvs: list[tuple[float, ...]] = []
        self._materials: dict[str, ObjMaterial] = {}
        self._material = ObjMaterial()
        self._corners: dict[ObjMaterial, list[tuple[int, int]]] = {}  # three (point, uv or -1) per triangle

    def read(self, words: list[str], number: int) -> None:
        try:
            self._read(words[0], words[1:])
        except AssetError:  # of the material file, which says what is wrong with it
            raise
        except (ValueError, IndexError) as error:
            raise AssetError(f"{self._where}, line {number}, does not parse: {' '.join(words)!r}") from error

    def parts(self) -> tuple[ObjPart, ...]:
        if not self._corners:
            raise AssetError(f"{self._where} is empty: it has {len(self._points)} vertices and no face")
        points = np.array(self._points, dtype=float)
        self._check_coordinates("vertex coordinate", points)
        self._check_coordinates("texture coordinate", np.array(self._uvs, dtype=float))
        uvs = np.array([*self._uvs, (0.0, 0.0)], dtype=np.float32)  # the last stands for "none"
        parts = []
        for material, corners in self._corners.items():
            used, index = np.unique(np.array(corners), axis=0, return_inverse=True)
            has_uvs = bool((used[:, 1] >= 0).all())
            mesh = TriMesh(points[used[:, 0]], index.reshape(-1, 3), uvs[used[:, 1]] if has_uvs else None)
            parts.append(ObjPart(material, mesh))
        if not sum(float(triangle_areas(part.mesh).sum()) for part in parts) > 0:
            raise AssetError(f"{self._where} has no area: all its faces are points or lines")
        return tuple(parts)

    def _check_coordinates(self, what: str, values: np.ndarray) -> None:
        bad = values[~(np.abs(values) <= _LARGEST_COORDINATE)]
        if bad.size:
            wrong = "too large" if np.isfinite(bad[0]) else "not finite"
            raise AssetError(
                f"{self._where} has a {what} that is {wrong}: {bad[0]:g}; at most {_LARGEST_COORDINATE:g} is legal"
            )

    def _read(self, key: str, values: list[str]) -> None:
        if key == "v":
            self._points.append((float(values[0]), float(values[1]), float(values[2])))
        elif key == "vt":
            self._uvs.append((float(values[0]), float(values[1]) if len(values) > 1 else 0.0))
        elif key == "f":
            self._read_face(values)
        elif key == "mtllib":
            self._materials.update(read_mtl(self._path.parent / " ".join(values), self._where))
        elif key == "usemtl":
            self._material = self._materials.get(" ".join(values), ObjMaterial())

    def _read_face(self, values: list[str]) -> None:
        corners = [self._corner(value) for value in values]
        if len(corners) < 3:
            raise ValueError
        triangles = self._corners.setdefault(self._material, [])
        for second, third in pairwise(corners[1:]):
            triangles += (corners[0], second, third)

    def _corner(self, value: str) -> tuple[int, int]:
        fields = value.split("/")
        point = _index(fields[0], len(self._points))
        uv = _index(fields[1], len(self._uvs)) if len(fields) > 1 and fields[1] else -1
        return point, uv


def read_mtl(path: Path, where: str) -> dict[str, ObjMaterial]:
    """Materials of an MTL file by name; empty where the file is missing.

    Args:
        path: the file.
        where: what it belongs to, for messages.

    Raises:
        AssetError: the file cannot be read, or a number in it is none; the message names file, line and statement.
    """
    if not path.is_file():
        return {}
    where = f"{where}: material file {path.name!r}"
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise AssetError(f"{where} cannot be read: {error.strerror}") from error
    materials: dict[str, dict[str, list[str]]] = {}
    entry: dict[str, list[str]] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split("#", 1)[0].split()
        if words and words[0] == "newmtl":
            entry = materials.setdefault(" ".join(words[1:]), {})
        elif words:
            _check_statement(words[0], words[1:], f"{where}, line {number}")
            entry[words[0]] = words[1:]
    return {name: _material(entry, path.parent) for name, entry in materials.items()}


def load_material(material: ObjMaterial, textures: dict[Path, np.ndarray | None]) -> Material:
    """The drawable material; `textures` keeps the images that are read already, None for unreadable ones."""
    image = None
    if material.texture is not None:
        if material.texture not in textures:
            textures[material.texture] = _read_image(material.texture)
        image = textures[material.texture]
    name = material.texture.stem if material.texture is not None else "plain"
    red, green, blue = (_srgb_to_linear(c) for c in material.rgb)
    shininess = float(np.clip(material.exponent / _POLISHED_EXPONENT, 0.0, 1.0))
    return Material(name, (red, green, blue, material.alpha), image, shininess)


def _check_statement(key: str, values: list[str], where: str) -> None:
    """Raises AssetError unless a statement with numbers has as many, all finite; `d` may have an option first."""
    count = _MTL_NUMBERS.get(key, 0)
    numbers = values[-count:] if key in ("d", "Tr") else values
    try:
        legal = len(numbers) == count and all(np.isfinite(float(number)) for number in numbers)
    except ValueError:
        legal = False
    if count and not legal:
        number = f"{count} finite numbers" if count > 1 else "a finite number"
        raise AssetError(f"{where}: {key} must be {number}, not {' '.join(values)!r}")


def _material(entry: dict[str, list[str]], folder: Path) -> ObjMaterial:
    red, green, blue = (min(max(float(c), 0.0), 1.0) for c in entry.get("Kd", map(str, _GREY)))
    alpha = float(entry["d"][-1]) if "d" in entry else 1.0 - float(entry.get("Tr", ["0"])[-1])
    # options such as `-s 1 1 1` may stand before the file's name, which may hold spaces
    texture = entry.get("map_Kd")
    file = (
        folder / (texture[-1] if texture and texture[0].startswith("-") else " ".join(texture))
        if texture
        else None
    )
    return ObjMaterial((red, green, blue), min(max(alpha, 0.0), 1.0), file, float(entry.get("Ns", ["30"])[0]))


def _index(text: str, count: int) -> int:
    """OBJ's index, from 1 or negative from the end, to one from 0; ValueError where there is no such entry."""
    index = int(text)
    index = index - 1 if index > 0 else count + index
    if not 0 <= index < count or text in ("0", "-0"):
        raise ValueError
    return index


def _read_image(path: Path) -> np.ndarray | None:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGB"))
    except (OSError, UnidentifiedImageError):
        return None


def _srgb_to_linear(value: float) -> float:
    """IEC 61966-2-1; MTL colours are display values."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4
