"""Wavefront OBJ as PartNet-Mobility writes it, and as it may: one triangle mesh per material, with UVs.

Texture coordinates keep OBJ's convention: (0, 0) is the image's lower left corner, values beyond [0, 1] repeat.
Lines come in long runs of one kind, and a corner such as `7/7/1` comes again and again: runs are read at once.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np

from artiskill.assets.partnet.backs import needed_faces
from artiskill.assets.partnet.mtl import ObjMaterial, read_mtl
from artiskill.errors import AssetError, shown
from artiskill.files import is_file, read_text
from artiskill.geometry.meshes import TriMesh, triangle_areas

# The data set's models measure about 2 across; areas and volumes of larger coordinates would overflow.
_LARGEST_COORDINATE = 1e6
# 100,000 faces have 10 MB; an object of many more takes minutes to cut into convex pieces
_MOST_BYTES, MOST_FACES = 100_000_000, 600_000


@dataclass(frozen=True, eq=False)
class ObjPart:
    """The faces of one `usemtl` section, or of several with equal materials; `mesh` in the file's coordinates."""

    material: ObjMaterial
    mesh: TriMesh


def read_obj(path: Path, where: str) -> tuple[ObjPart, ...]:
    """Read an OBJ file and its materials.

    Polygons become fans of triangles; negative indices count from the end; normals, groups, objects, lines and
    smoothing are skipped. A missing material file or image is no error: the part is grey, as viewers draw it.
    Faces that no one can see (`backs`) are left out.

    Args:
        path: the file.
        where: what it belongs to, for messages.

    Raises:
        AssetError: the file is missing, has a line that does not parse, an index out of range, a coordinate that
            is not finite or too large, no face or no area; or its material file does not parse.
    """
    if not is_file(path):
        raise AssetError(f"{where}: mesh file {path.name!r} does not exist in {path.parent.name!r}")
    reader = _ObjReader(path, f"{where}: mesh file {path.name!r}")
    try:
        text = read_text(path, _MOST_BYTES, errors="replace")
    except OSError as error:
        raise AssetError(f"{where}: mesh file {path.name!r} cannot be read: {error.strerror}") from error
    reader.read(text.splitlines())
    return reader.parts()


class _ObjReader:
    """Collects one file's lines."""

    def __init__(self, path: Path, where: str) -> None:
        self._path, self._where = path, where
        self._points: list[tuple[float, ...]] = []
        self._uvs: list[tuple[float, ...]] = []
        self._faces = 0
        self._materials: dict[str, ObjMaterial] = {}
        self._material = ObjMaterial()
        self._corners: dict[ObjMaterial, list[tuple[int, int]]] = {}  # three (point, uv or -1) per triangle

    def read(self, lines: list[str]) -> None:
        """Read all lines, run by run."""
        for key, run in groupby(_statements(lines), key=_key):
            self._read_run(key, run)

    def _read_run(self, key: str, run: Iterator[tuple[int, list[str]]]) -> None:
        known: dict[str, tuple[int, int]] = {}  # a run of faces adds no point, so that a corner means the same
        number, words = 0, [key]
        try:
            for statement in run:
                number, words = statement
                if key == "f":
                    self._read_face(words[1:], known)
                else:
                    self._read_line(key, words[1:])
        except AssetError:  # which says what is wrong, with a material file say
            raise
        except (ValueError, IndexError) as error:
            raise AssetError(f"{self._where}, line {number}, does not parse: {shown(' '.join(words))}") from error

    def parts(self) -> tuple[ObjPart, ...]:
        """What has been read, without faces that no one can see.

        Raises:
            AssetError: no face, no area, or coordinates that are not finite or too large.
        """
        if not self._corners:
            raise AssetError(f"{self._where} is empty: it has {len(self._points)} vertices and no face")
        points = np.array(self._points, dtype=float)
        self._check_coordinates("vertex coordinate", points)
        self._check_coordinates("texture coordinate", np.array(self._uvs, dtype=float))
        uvs = np.array([*self._uvs, (0.0, 0.0)], dtype=np.float32)  # the last stands for "none"
        sections = [np.array(corners).reshape(-1, 3, 2) for corners in self._corners.values()]
        needed = needed_faces(points, [section[..., 0] for section in sections])
        parts = []
        for material, section, keep in zip(self._corners, sections, needed, strict=True):
            if not keep.any():
                continue
            corners = section[keep].reshape(-1, 2)
            codes, index = np.unique(corners[:, 0] * (len(uvs) + 1) + corners[:, 1] + 1, return_inverse=True)
            point, uv = codes // (len(uvs) + 1), codes % (len(uvs) + 1) - 1
            has_uvs = bool((uv >= 0).all())
            coordinates = uvs[uv] * np.asarray(material.stretch, dtype=np.float32) if has_uvs else None
            parts.append(ObjPart(material, TriMesh(points[point], index.reshape(-1, 3), coordinates)))
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

    def _read_line(self, key: str, values: list[str]) -> None:
        if key == "v":
            self._points.append((float(values[0]), float(values[1]), float(values[2])))
        elif key == "vt":
            self._uvs.append((float(values[0]), float(values[1]) if len(values) > 1 else 0.0))
        elif key == "mtllib":
            self._materials.update(self._read_materials(values))
        elif key == "usemtl":
            self._material = self._materials.get(" ".join(values), ObjMaterial())

    def _read_materials(self, values: list[str]) -> dict[str, ObjMaterial]:
        """Of one file whose name may hold spaces, or of several."""
        folder, whole = self._path.parent, " ".join(values)
        names = values if not is_file(folder / whole) and len(values) > 1 else [whole]
        found: dict[str, ObjMaterial] = {}
        for name in names:
            found.update(read_mtl(folder / name, self._where))
        return found

    def _read_face(self, values: list[str], known: dict[str, tuple[int, int]]) -> None:
        if self._faces + len(values) - 2 > MOST_FACES:
            raise AssetError(f"{self._where} has more than the {MOST_FACES} triangles that are legal")
        corners = []
        for value in values:
            corner = known.get(value)
            if corner is None:
                corner = known[value] = self._corner(value)
            corners.append(corner)
        if len(corners) < 3:
            raise ValueError
        self._faces += len(corners) - 2
        triangles = self._corners.setdefault(self._material, [])
        if len(corners) == 3:
            triangles += corners
            return
        for second, third in pairwise(corners[1:]):
            triangles += (corners[0], second, third)

    def _corner(self, value: str) -> tuple[int, int]:
        fields = value.split("/")
        point = _index(fields[0], len(self._points))
        uv = _index(fields[1], len(self._uvs)) if len(fields) > 1 and fields[1] else -1
        return point, uv


def _statements(lines: list[str]) -> Iterator[tuple[int, list[str]]]:
    """Line number and words of each statement; comments are cut off, a backslash joins lines."""
    carried: list[str] = []
    for number, line in enumerate(lines, start=1):
        words = (line.split("#", 1)[0] if "#" in line else line).split()
        if words and words[-1] == "\\":
            carried += words[:-1]
            continue
        if carried:
            words, carried = carried + words, []
        if words:
            yield number, words


def _key(statement: tuple[int, list[str]]) -> str:
    return statement[1][0]


def _index(text: str, count: int) -> int:
    """OBJ's index, from 1 or negative from the end, to one from 0; ValueError where there is no such entry."""
    index = int(text)
    index = index - 1 if index > 0 else count + index
    if not 0 <= index < count or text in ("0", "-0"):
        raise ValueError
    return index
