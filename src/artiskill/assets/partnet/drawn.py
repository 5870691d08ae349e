"""The drawn surfaces of an imported object: read, placed in their bodies, labelled, merged for drawing."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from artiskill.assets.articulated_object import Material, VisualMesh
from artiskill.assets.partnet.bodies import Body, PlacedMesh, transform
from artiskill.assets.partnet.mtl import ObjMaterial, load_material
from artiskill.assets.partnet.obj import MOST_FACES, ObjPart, read_obj
from artiskill.assets.partnet.semantics import PartLabel, PartNames
from artiskill.errors import AssetError, shown
from artiskill.geometry.meshes import TriMesh, merge


@dataclass(frozen=True, eq=False)
class DrawnMesh:
    """One mesh file of a body.

    Attributes:
        label: which part it belongs to.
        sections: one mesh per material; in the body's frame and the file's units, then in the
            link's frame and metres.
    """

    label: PartLabel
    sections: tuple[ObjPart, ...]

    @property
    def mesh(self) -> TriMesh:
        """All sections as one mesh."""
        return merge(section.mesh for section in self.sections)

    def moved(self, pose: np.ndarray, scale: float, shift: np.ndarray) -> "DrawnMesh":
        """With every vertex x at `scale * (pose x) + shift`."""
        return DrawnMesh(
            self.label,
            tuple(
                ObjPart(
                    section.material,
                    TriMesh(
                        transform(pose, section.mesh.vertices) * scale + shift,
                        section.mesh.faces,
                        section.mesh.uvs,
                    ),
                )
                for section in self.sections
            ),
        )


def read_drawn(bodies: tuple[Body, ...], folder: Path, names: PartNames) -> list[list[DrawnMesh]]:
    """The drawn meshes of each body, in the body's frame and the file's units.

    Raises:
        AssetError: a mesh file is missing, empty, does not parse, or lies outside the folder.
    """
    drawn, faces = [], 0
    for body in bodies:
        where = f"{folder.name}: link {body.name!r}"
        drawn.append([_read_placed(placed, folder, names, where) for placed in body.meshes])
        faces += sum(len(section.mesh.faces) for mesh in drawn[-1] for section in mesh.sections)
        if faces > MOST_FACES:
            raise AssetError(f"{folder.name} has more than the {MOST_FACES} triangles that are legal")
    return drawn


def vertices_of(drawn: list[DrawnMesh]) -> np.ndarray:
    """All vertices, (N, 3); N may be 0."""
    return np.concatenate([np.empty((0, 3)), *(s.mesh.vertices for mesh in drawn for s in mesh.sections)])


def group_by_part(drawn: Sequence[DrawnMesh]) -> dict[PartLabel, list[DrawnMesh]]:
    """Meshes of one part together, parts in the file's order."""
    groups: dict[PartLabel, list[DrawnMesh]] = {}
    for mesh in drawn:
        groups.setdefault(mesh.label, []).append(mesh)
    return groups


def visual_meshes(
    drawn: Sequence[DrawnMesh], textures: dict[Path, np.ndarray | None], warnings: list[str]
) -> tuple[VisualMesh, ...]:
    """Surfaces to draw, merged where part name and material agree; unreadable textures are warned of."""
    groups: dict[tuple[str, ObjMaterial, bool], list[TriMesh]] = {}
    for mesh in drawn:
        for section in mesh.sections:
            key = (mesh.label.part, section.material, section.mesh.uvs is None)
            groups.setdefault(key, []).append(section.mesh)
    visuals = []
    for (part, obj_material, _), meshes in groups.items():
        material: Material = load_material(obj_material, textures)
        missing = obj_material.texture is not None and material.texture is None
        if missing and obj_material.texture is not None:
            text = f"texture {obj_material.texture.name!r} is missing or unreadable: drawn in plain colour"
            if text not in warnings:
                warnings.append(text)
        visuals.append(VisualMesh(merge(meshes), material, part))
    return tuple(visuals)


def _read_placed(placed: PlacedMesh, folder: Path, names: PartNames, where: str) -> DrawnMesh:
    file = PurePosixPath(placed.mesh.file.replace("\\", "/"))
    if file.is_absolute() or ".." in file.parts or ":" in file.parts[0]:
        raise AssetError(f"{where}: mesh file {shown(placed.mesh.file)} must be a path inside the object's folder")
    if file.suffix.lower() != ".obj":
        raise AssetError(
            f"{where}: mesh file {shown(placed.mesh.file)} has the unknown format {file.suffix!r}; legal: .obj"
        )
    sections = tuple(
        ObjPart(section.material, section.mesh.scaled(placed.mesh.scale))
        for section in read_obj(folder.joinpath(*file.parts), where)
    )
    return DrawnMesh(names.label(placed.mesh, placed.link), sections).moved(placed.pose, 1.0, np.zeros(3))
