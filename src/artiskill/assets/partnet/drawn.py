"""The drawn surfaces of an object: OBJ files read, placed in their bodies, labelled, merged for drawing.

Texture coordinates keep OBJ's convention: (0, 0) is the image's lower left corner, values beyond [0, 1] repeat.
trimesh was tried as the reader: it takes as long (82 files of the data set: 0.15 s), turns the corners of quads
round, and of ten odd files it accepts five malformed ones silently: NaN, an index of 0, a vertex of two numbers.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from pathlib import Path, PurePosixPath

import numpy as np

from artiskill.assets.articulated_object import VisualMesh
from artiskill.assets.partnet.mtl import ObjMaterial, load_material, read_mtl
from artiskill.assets.partnet.part_names import PartLabel, PartNames
from artiskill.assets.partnet.urdf import Body, UrdfMesh, transform
from artiskill.errors import AssetError, shown
from artiskill.files import is_file, read_text
from artiskill.geometry.meshes import TriMesh, merge, triangle_areas

# The data set's models measure about 2 across; areas and volumes of larger coordinates would overflow.
_LARGEST_COORDINATE = 1e6
# 100,000 faces have 10 MB; an object of many more takes minutes to cut into convex pieces
_MOST_BYTES, MOST_FACES = 100_000_000, 600_000


@dataclass(frozen=True, eq=False)
class ObjPart:
    """The faces of one `usemtl` section, or of several with equal materials; `mesh` in the file's coordinates."""

    material: ObjMaterial
    mesh: TriMesh


@dataclass(frozen=True, eq=False)
class DrawnMesh:
    """One mesh file of a body."""

    label: PartLabel  # which part it belongs to
    # one mesh per material; in the body's frame and the file's units, then in the link's frame and metres
    sections: tuple[ObjPart, ...]

    @property
    def mesh(self) -> TriMesh:
        """All sections as one mesh."""
        return merge(section.mesh for section in self.sections)

    def moved(self, pose: np.ndarray, scale: float, shift: np.ndarray) -> "DrawnMesh":
        """Return it with every vertex x at `scale * (pose x) + shift`."""
        sections = []
        for section in self.sections:
            vertices = transform(pose, section.mesh.vertices) * scale + shift
            sections.append(replace(section, mesh=replace(section.mesh, vertices=vertices)))
        return replace(self, sections=tuple(sections))


def read_drawn(bodies: tuple[Body, ...], folder: Path, names: PartNames) -> list[list[DrawnMesh]]:
    """Read the drawn meshes of each body, in the body's frame and the file's units.

    Raises:
        AssetError: a mesh file is missing, empty, does not parse, or lies outside the folder.
    """
    drawn, faces = [], 0
    for body in bodies:
        where = f"{folder.name}: link {body.name!r}"
        drawn.append([_read_mesh(mesh, folder, names, where) for mesh in body.meshes])
        faces += sum(len(section.mesh.faces) for mesh in drawn[-1] for section in mesh.sections)
        if faces > MOST_FACES:
            raise AssetError(f"{folder.name} has more than the {MOST_FACES} triangles that are legal")
    return drawn


def vertices_of(drawn: list[DrawnMesh]) -> np.ndarray:
    """Return all vertices, (N, 3); N may be 0."""
    return np.concatenate([np.empty((0, 3)), *(s.mesh.vertices for mesh in drawn for s in mesh.sections)])


def group_by_part(drawn: Sequence[DrawnMesh]) -> dict[PartLabel, list[DrawnMesh]]:
    """Group the meshes of each part, parts in the file's order."""
    groups: dict[PartLabel, list[DrawnMesh]] = {}
    for mesh in drawn:
        groups.setdefault(mesh.label, []).append(mesh)
    return groups


def visual_meshes(
    drawn: Sequence[DrawnMesh], textures: dict[Path, np.ndarray | None], warnings: list[str]
) -> tuple[VisualMesh, ...]:
    """Return surfaces to draw, merged where part name and material agree; warn of unreadable textures."""
    groups: dict[tuple[str, ObjMaterial, bool], list[TriMesh]] = {}
    for mesh in drawn:
        for section in mesh.sections:
            key = (mesh.label.part, section.material, section.mesh.uvs is None)
            groups.setdefault(key, []).append(section.mesh)
    visuals = []
    for (part, obj_material, _), meshes in groups.items():
        material = load_material(obj_material, textures)
        if obj_material.texture is not None and material.texture is None:
            text = f"texture {obj_material.texture.name!r} is missing or unreadable: drawn in plain colour"
            if text not in warnings:
                warnings.append(text)
        visuals.append(VisualMesh(merge(meshes), material, part))
    return tuple(visuals)


def _read_mesh(mesh: UrdfMesh, folder: Path, names: PartNames, where: str) -> DrawnMesh:
    file = PurePosixPath(mesh.file.replace("\\", "/"))
    if file.is_absolute() or ".." in file.parts or ":" in file.parts[0]:
        raise AssetError(f"{where}: mesh file {shown(mesh.file)} must be a path inside the object's folder")
    if file.suffix.lower() != ".obj":
        raise AssetError(
            f"{where}: mesh file {shown(mesh.file)} has the unknown format {file.suffix!r}; legal: .obj"
        )
    sections = tuple(
        ObjPart(section.material, section.mesh.scaled(mesh.scale))
        for section in read_obj(folder.joinpath(*file.parts), where)
    )
    return DrawnMesh(names.label(mesh), sections).moved(mesh.pose, 1.0, np.zeros(3))


def read_obj(path: Path, where: str) -> tuple[ObjPart, ...]:
    """Read an OBJ file and its materials.

    Polygons become fans of triangles; negative indices count from the end; normals, groups, objects, lines and
    smoothing are skipped. A missing material file or image is no error: the part is grey, as viewers draw it.
    Faces that no one can see are left out.

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
    """Collects one file's lines.

    Lines come in long runs of one kind, and a corner such as `7/7/1` comes again and again: runs are read at once.
    """

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
        """Return what has been read, without faces that no one can see.

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
        needed = _needed_faces(points, [section[..., 0] for section in sections])
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
        """Read the materials of one file whose name may hold spaces, or of several."""
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
    """Yield line number and words of each statement; comments are cut off, a backslash joins lines."""
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
    """Turn OBJ's index, from 1 or negative from the end, into one from 0; ValueError if there is no such entry."""
    index = int(text)
    index = index - 1 if index > 0 else count + index
    if not 0 <= index < count or text in ("0", "-0"):
        raise ValueError
    return index


def _needed_faces(points: np.ndarray, sections: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return which faces are needed so that every side looks as it should.

    The data set lists most faces twice, once for each side. Of two faces with the same corners and one material,
    one is enough. Of the two sides of a closed surface that have each a material of their own, the inner one is
    never seen.

    Args:
        points: (P, 3).
        sections: for each material its faces, (F, 3) point numbers.

    Returns:
        For each material (F,) bool.
    """
    keep = [_first_of_each(faces) for faces in sections]
    if len(sections) == 2:
        pair = [faces[kept] for faces, kept in zip(sections, keep, strict=True)]
        inner = _inner_side(points, *pair)
        if inner is not None:
            keep[inner] = np.zeros_like(keep[inner])
    return keep


def _first_of_each(faces: np.ndarray) -> np.ndarray:
    """Return (F,) bool: the first of those with the same three corners, whichever way round."""
    _, first = np.unique(_corner_sets(faces), return_index=True)
    kept = np.zeros(len(faces), dtype=bool)
    kept[first] = True
    return kept


def _inner_side(points: np.ndarray, front: np.ndarray, back: np.ndarray) -> int | None:
    """Return which of two back-to-back surfaces, 0 or 1, is inside a closed one; None if they are not that."""
    if len(front) != len(back) or not np.array_equal(np.sort(_corner_sets(front)), np.sort(_corner_sets(back))):
        return None
    if not (_is_closed(front) and _is_closed(back)):
        return None
    corners = points[front] - points[front].mean(axis=(0, 1))
    volume = np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return 1 if volume > 0 else 0


def _is_closed(faces: np.ndarray) -> bool:
    """Return whether every edge is run along once in each direction."""
    count = int(faces.max()) + 1
    ends = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    forward, backward = ends[:, 0] * count + ends[:, 1], ends[:, 1] * count + ends[:, 0]
    return np.array_equal(np.sort(forward), np.sort(backward)) and len(np.unique(forward)) == len(forward)


def _corner_sets(faces: np.ndarray) -> np.ndarray:
    """Return one number per face that is the same for faces of the same three corners."""
    ordered = np.sort(faces.astype(np.int64), axis=1)
    if not len(ordered):
        return np.empty(0, dtype=np.int64)
    # point numbers are below 2^21 in any file that can be read in reasonable time
    return (ordered[:, 0] << 42) | (ordered[:, 1] << 21) | ordered[:, 2]
