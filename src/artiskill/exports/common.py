"""What the formats share: surfaces as OBJ, MTL and PNG files, XML, and the object as the engine compiles it.

Programs disagree on what a colour beside a texture means. A texture is therefore written with the colour
multiplied in, and its material is white. OBJ is written here: with trimesh, MJCF and URDF would need the extra
`export`, too.
"""

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape, Material, VisualMesh
from artiskill.assets.finishes import srgb_to_linear
from artiskill.errors import AssetError
from artiskill.geometry.meshes import TriMesh, convex_hull
from artiskill.geometry.normals import corner_normals
from artiskill.scene.object_model import ObjectScene, build_object_scene
from artiskill.scene.physics import PhysicsConfig

MATERIALS_FILE = "materials.mtl"
_CREASE_RAD = math.radians(40)  # rounder edges than this look smooth
_PHONG_EXPONENT = 200.0  # of a polished surface; the importer divides by the same number
_WHITE = (1.0, 1.0, 1.0)


def compile_object(obj: ArticulatedObject, physics: PhysicsConfig) -> ObjectScene:
    """Return the object alone as the engine compiles it, so that masses, inertias and contacts agree with scenes.

    Raises:
        AssetError: the engine refuses it.
    """
    try:
        return build_object_scene(obj, physics, ground=False)
    except ValueError as error:
        raise AssetError(f"object {obj.id!r} does not compile: {error}") from error


@dataclass(frozen=True, eq=False)
class FileMaterial:
    """A material as files hold it."""

    name: str  # unique within the export; letters, digits and `_`
    srgb: tuple[float, float, float]  # display colour, three numbers in [0, 1]
    alpha: float  # opacity in [0, 1]
    shininess: float  # as in `Material`
    texture: np.ndarray | None  # (H, W, 3) uint8 sRGB with the colour multiplied in, or None

    @property
    def texture_file(self) -> str:
        """Name of the image's file."""
        return f"{self.name}.png"


@dataclass(frozen=True, eq=False)
class SurfaceFile:
    """One drawn surface: the index of its link, its file's name without ending, what it is made of."""

    link: int  # index of the link
    stem: str  # unique within the export
    visual: VisualMesh  # the surface; its material has a texture only if the mesh has coordinates for it
    material: FileMaterial  # as files hold it


def surface_files(obj: ArticulatedObject) -> tuple[SurfaceFile, ...]:
    """Return every drawn surface that has faces, with names for files; equal materials are one."""
    materials: dict[tuple[object, ...], FileMaterial] = {}
    files = []
    for index, link in enumerate(obj.links):
        for number, visual in enumerate(drawn_surfaces(link.visuals)):
            key = _material_key(visual.material)
            if key not in materials:
                materials[key] = _file_material(visual.material, len(materials))
            stem = "-".join(safe_name(word) for word in (link.name, str(number), visual.part) if word)
            files.append(SurfaceFile(index, stem, visual, materials[key]))
    return tuple(files)


def drawn_surfaces(visuals: Iterable[VisualMesh]) -> list[VisualMesh]:
    """Return the surfaces that have faces, as our pictures show them."""
    return [_as_drawn(visual) for visual in visuals if len(visual.mesh.faces)]


def write_surfaces(files: tuple[SurfaceFile, ...], folder: Path, meshes: str, textures: str) -> None:
    """Write one OBJ file per surface, one MTL file for all, and the textures.

    `meshes` and `textures` name the sub-folders of `folder` for OBJ and MTL files and for images.
    """
    from PIL import Image

    for name in (meshes, textures):
        (folder / name).mkdir(exist_ok=True)
    for file in files:
        text = obj_text(file.visual.mesh, file.material.name)
        (folder / meshes / f"{file.stem}.obj").write_text(text, encoding="utf-8")
    materials = distinct_materials(files)
    lines = [line for material in materials for line in _mtl_lines(material, f"../{textures}")]
    (folder / meshes / MATERIALS_FILE).write_text("\n".join(lines) + "\n", encoding="utf-8")
    for material in materials:
        if material.texture is not None:
            Image.fromarray(material.texture).save(folder / textures / material.texture_file, format="PNG")


def distinct_materials(files: tuple[SurfaceFile, ...]) -> list[FileMaterial]:
    """Return each material once, in order of first use."""
    return list({file.material.name: file.material for file in files}.values())


def obj_text(mesh: TriMesh, material: str | None = None) -> str:
    """Return a mesh as OBJ; with a material, also normals that keep its creases, and its texture coordinates."""
    lines = [f"v {numbers(vertex, 9)}" for vertex in mesh.vertices.tolist()]
    corners = [[str(v) for v in face] for face in (mesh.faces + 1).tolist()]
    if material is not None:
        normals, index = _distinct_normals(mesh)
        lines = [f"mtllib {MATERIALS_FILE}", *lines, *(f"vn {numbers(normal, 9)}" for normal in normals.tolist())]
        if mesh.uvs is not None:
            lines += [f"vt {numbers(uv, 9)}" for uv in mesh.uvs.tolist()]
            corners = [[f"{v}/{v}" for v in face] for face in corners]
        else:
            corners = [[f"{v}/" for v in face] for face in corners]
        lines.append(f"usemtl {material}")
        numbered = zip(corners, (index + 1).tolist(), strict=True)
        corners = [[f"{v}/{n}" for v, n in zip(face, own, strict=True)] for face, own in numbered]
    lines += ["f " + " ".join(face) for face in corners]
    return "\n".join(lines) + "\n"


def write_hull(shape: CollisionShape, path: Path) -> None:
    """Write the convex hull of a collision shape's vertices as OBJ."""
    assert shape.vertices is not None
    path.write_text(obj_text(convex_hull(shape.vertices).mesh), encoding="utf-8")


def smooth_mesh(mesh: TriMesh) -> tuple[TriMesh, np.ndarray]:
    """Return a mesh whose vertices have one unit normal each, (V, 3): those on a crease are doubled.

    The corners of a triangle without area, as real objects have, get one that points up.
    """
    normals, index = _distinct_normals(mesh)
    normals = np.where((normals == 0.0).all(axis=1, keepdims=True), (0.0, 0.0, 1.0), normals)
    corners = np.stack((mesh.faces, index), axis=-1).reshape(-1, 2)
    pairs, faces = np.unique(corners, axis=0, return_inverse=True)
    uvs = None if mesh.uvs is None else mesh.uvs[pairs[:, 0]]
    return TriMesh(mesh.vertices[pairs[:, 0]], faces.reshape(-1, 3), uvs), normals[pairs[:, 1]]


def safe_name(text: str) -> str:
    """Replace every character that could break a file or XML name by `_`."""
    return re.sub(r"[^A-Za-z0-9_.]", "_", text)


def _distinct_normals(mesh: TriMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return normals (N, 3) to four digits, and which of them each corner has, (F, 3)."""
    rounded = np.round(corner_normals(mesh, _CREASE_RAD), 4).reshape(-1, 3) + 0.0
    normals, index = np.unique(rounded, axis=0, return_inverse=True)
    return normals, index.reshape(-1, 3)


def _as_drawn(visual: VisualMesh) -> VisualMesh:
    """Return the surface as our pictures show it: without texture coordinates it has its plain colour."""
    if visual.mesh.uvs is not None or visual.material.texture is None:
        return visual
    return replace(visual, material=replace(visual.material, texture=None))


def _material_key(material: Material) -> tuple[object, ...]:
    texture = material.texture
    image = None if texture is None else (texture.shape, np.ascontiguousarray(texture).tobytes())
    return material.rgba, material.shininess, image


def _file_material(material: Material, number: int) -> FileMaterial:
    name = f"{safe_name(material.name) or 'material'}_{number}"
    linear = np.array(material.rgba[:3], dtype=float)
    alpha = float(material.rgba[3])
    if material.texture is None:
        red, green, blue = (round(float(v), 6) for v in linear_to_srgb(linear))
        return FileMaterial(name, (red, green, blue), alpha, material.shininess, None)
    baked = np.round(255 * linear_to_srgb(srgb_to_linear(material.texture) * linear)).astype(np.uint8)
    return FileMaterial(name, _WHITE, alpha, material.shininess, baked)


def linear_to_srgb(linear: np.ndarray) -> np.ndarray:
    """Encode linear intensities 0..1 as sRGB 0..1 (IEC 61966-2-1)."""
    c = np.clip(linear, 0.0, 1.0)
    return np.where(c <= 0.0031308, c * 12.92, 1.055 * c ** (1 / 2.4) - 0.055)


def _mtl_lines(material: FileMaterial, textures: str) -> list[str]:
    lines = [
        f"newmtl {material.name}",
        "illum 2",
        f"Kd {numbers(material.srgb, 9)}",
        f"Ks {numbers([0.5 * material.shininess] * 3, 9)}",
        f"Ns {numbers([_PHONG_EXPONENT * material.shininess], 6)}",
        f"d {numbers([material.alpha], 6)}",
    ]
    if material.texture is not None:
        lines.append(f"map_Kd {textures}/{material.texture_file}")
    return [*lines, ""]


def numbers(values: Iterable[float], digits: int = 12) -> str:
    """Return numbers to so many significant digits, without negative zeros."""
    return " ".join(format(float(value) + 0.0, f".{digits}g") for value in values)


def add(parent: ET.Element, tag: str, **attributes: str | int) -> ET.Element:
    """Add a child with attributes; a trailing `_` of a name, for Python's keywords, is dropped."""
    return ET.SubElement(parent, tag, {name.rstrip("_"): str(value) for name, value in attributes.items()})


def write_xml(root: ET.Element, path: Path) -> None:
    """Write an indented document."""
    ET.indent(root)
    path.write_bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n")
