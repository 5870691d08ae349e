"""An object as one binary glTF file: a node per link, surfaces below it, materials and textures inside.

glTF has y up and models that face +z; the node `object` turns ours so. A link's node stands as at rest. Its
`extras` hold the joint: kind, axis and origin in the node's frame, limits, spring, and the value at which the node
stands.
"""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Link, Material, VisualMesh
from artiskill.assets.kinematics import joint_values, link_poses
from artiskill.errors import MissingExtraError
from artiskill.exports.common import drawn_surfaces, smooth_mesh, surface_files
from artiskill.geometry.meshes import merge
from artiskill.geometry.rotations import quat_to_matrix

EXTRA = "export"
_ROOT = "object"
# columns: where the object's x (its back), y and z (up) go: -z, -x and y of glTF
_TO_GLTF = np.array(((0.0, -1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (-1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
_MOST_POLISHED = 0.85  # roughness falls from 1 by so much at shininess 1


def import_trimesh() -> Any:
    """The library that writes glTF.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import trimesh
    except ImportError as error:
        raise MissingExtraError("exporting glTF", EXTRA) from error
    return trimesh


def write_glb(obj: ArticulatedObject, folder: Path) -> Path:
    """Write the object into an empty folder and return the file.

    Raises:
        MissingExtraError: trimesh is not installed.
    """
    trimesh = import_trimesh()
    scene = trimesh.Scene(base_frame="world")
    scene.graph.update(frame_from="world", frame_to=_ROOT, matrix=_TO_GLTF)
    frames = _rest_frames(obj)
    names = _node_names(obj)
    for index, link in enumerate(obj.links):
        above = np.eye(4) if link.parent < 0 else frames[link.parent]
        parent = _ROOT if link.parent < 0 else names[link.parent]
        scene.graph.update(frame_from=parent, frame_to=names[index], matrix=np.linalg.inv(above) @ frames[index])
    made: dict[str, Any] = {}
    for file in surface_files(obj):
        if file.material.name not in made:
            made[file.material.name] = _material(trimesh, file.visual.material, file.material.name)
        mesh = _mesh(trimesh, [file.visual], made[file.material.name])
        scene.add_geometry(
            mesh, node_name=f"{file.stem}-node", geom_name=file.stem, parent_node_name=names[file.link]
        )
    extras = {names[i]: _link_extras(link) for i, link in enumerate(obj.links)}
    extras[_ROOT] = {"id": obj.id, "category": obj.category}

    def put_extras(tree: dict[str, Any]) -> None:
        for node in tree["nodes"]:
            if node["name"] in extras:
                node["extras"] = extras[node["name"]]
        tree["asset"]["generator"] = "ArtiSkill, trimesh"

    path = folder / f"{obj.id}.glb"
    path.write_bytes(trimesh.exchange.gltf.export_glb(scene, include_normals=True, tree_postprocessor=put_extras))
    return path


@lru_cache(maxsize=512)
def body_glb(visuals: tuple[VisualMesh, ...]) -> bytes:
    """Return some surfaces as glTF in the frame that they are in: a mesh for each material, no other nodes.

    Raises:
        MissingExtraError: trimesh is not installed.
    """
    trimesh = import_trimesh()
    groups: dict[int, list[VisualMesh]] = {}
    for visual in drawn_surfaces(visuals):
        groups.setdefault(id(visual.material), []).append(visual)
    scene = trimesh.Scene()
    for number, group in enumerate(groups.values()):
        material = _material(trimesh, group[0].material, str(number))
        scene.add_geometry(_mesh(trimesh, group, material), geom_name=str(number))
    found: bytes = trimesh.exchange.gltf.export_glb(scene, include_normals=True)
    return found


def _rest_frames(obj: ArticulatedObject) -> list[np.ndarray]:
    """Poses (4, 4) of all links in the object frame, at rest."""
    frames = []
    for position, quaternion in zip(*link_poses(obj, joint_values(obj, 0.0)), strict=True):
        frame = np.eye(4)
        frame[:3, :3], frame[:3, 3] = quat_to_matrix(quaternion), position
        frames.append(frame)
    return frames


def _node_names(obj: ArticulatedObject) -> list[str]:
    """The links' names; those that a node of another kind bears get a trailing `_`."""
    return [f"{link.name}_" if link.name in (_ROOT, "world") else link.name for link in obj.links]


def _link_extras(link: Link) -> dict[str, Any]:
    joint = link.joint
    if joint is None:
        return {"link": link.name}
    limits = [float(limit) if np.isfinite(limit) else None for limit in joint.limits]  # JSON knows no infinity
    described = {
        "name": joint.name,
        "kind": joint.kind,
        "axis": [float(v) + 0.0 for v in joint.axis],
        "origin": [float(v) + 0.0 for v in joint.origin],
        "limits": limits,
        "value": float(joint.rest),
        "stiffness": float(joint.stiffness),
        "spring_reference": float(joint.spring_reference),
    }
    return {"link": link.name, "joint": described}


def _mesh(trimesh: Any, visuals: Sequence[VisualMesh], material: Any) -> Any:
    """Return surfaces of one material as one mesh."""
    smooth = [smooth_mesh(visual.mesh) for visual in visuals]
    mesh = merge(mesh for mesh, _ in smooth)
    return trimesh.Trimesh(
        mesh.vertices,
        mesh.faces,
        vertex_normals=np.concatenate([normals for _, normals in smooth]),
        visual=trimesh.visual.TextureVisuals(uv=mesh.uvs, material=material),
        process=False,
        metadata={"part": visuals[0].part},
    )


def _material(trimesh: Any, material: Material, name: str) -> Any:
    """Physically based: glTF multiplies linear colour and texture, as `Material` does."""
    from PIL import Image

    image = None if material.texture is None else Image.fromarray(np.ascontiguousarray(material.texture))
    return trimesh.visual.material.PBRMaterial(
        name=name,
        baseColorFactor=np.array(material.rgba, dtype=float),
        baseColorTexture=image,
        metallicFactor=0.0,
        roughnessFactor=1.0 - _MOST_POLISHED * material.shininess,
        alphaMode="OPAQUE" if material.rgba[3] >= 1 else "BLEND",
        doubleSided=True,
    )
