"""An object as a folder of URDF laid out like PartNet-Mobility's, so that our importer and its tools read it.

`mobility.urdf` has named visuals (`handle-15`), `semantics.txt` a line per link, `meta.json` the category. Lengths
are metres and z is up; `meta.json` says so to our importer, which then neither scales nor moves the object. What
URDF cannot say is left out: springs, and that chairs and buckets stand free. `object.npz` holds the object itself,
which `load_object` returns as long as no file of the folder is changed.
"""

import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Category, CollisionShape, Joint, Link
from artiskill.assets.exported_folder import OBJECT_FILE
from artiskill.assets.handles import is_handle_part
from artiskill.assets.object_file import write_object
from artiskill.exports.common import (
    SurfaceFile,
    add,
    compile_object,
    numbers,
    surface_files,
    write_hull,
    write_surfaces,
    write_xml,
)
from artiskill.geometry.rotations import quat_rotate, quat_to_rpy
from artiskill.scene.physics import PhysicsConfig

URDF_FILE = "mobility.urdf"
MODEL_CATEGORIES: dict[Category, str] = {"cabinet": "StorageFurniture", "chair": "Chair", "bucket": "Bucket"}
_MESHES, _TEXTURES = "textured_objs", "images"
# URDF demands them of every limited joint; high enough never to matter
_EFFORT, _VELOCITY = 1000.0, 100.0
_STILL = np.array((1.0, 0.0, 0.0, 0.0))


def write_urdf(obj: ArticulatedObject, folder: Path) -> Path:
    """Write the object into an empty folder and return the URDF file."""
    files = surface_files(obj)
    write_surfaces(files, folder, _MESHES, _TEXTURES)
    labels = _part_labels(obj, files)
    compiled = compile_object(obj, PhysicsConfig())
    root = ET.Element("robot", name=obj.id)
    # for MuJoCo, which reads URDF and would drop folders; it takes no flat surfaces; others skip the element
    compiler = {"strippath": "false", "discardvisual": "true", "fusestatic": "false"}
    add(add(root, "mujoco"), "compiler", **compiler)
    for index, link in enumerate(obj.links):
        element = add(root, "link", name=link.name)
        shift = -_origin(link)
        _add_inertial(element, compiled.model.body(compiled.bodies[index]), shift)
        for file, label in zip(files, labels, strict=True):
            if file.link == index:
                _add_visual(element, file, label, shift)
        for number, shape in enumerate(link.collisions):
            _add_collision(element, f"{link.name}_shape{number}", shape, shift, folder)
    for link in obj.links[1:]:
        _add_joint(root, link, obj.links[link.parent])
    write_xml(root, folder / URDF_FILE)
    _write_annotations(obj, folder)
    write_object(obj, folder / OBJECT_FILE)
    return folder / URDF_FILE


def _origin(link: Link) -> np.ndarray:
    """Return where URDF's frame of the link sits in ours: URDF has it on the joint's axis."""
    return np.zeros(3) if link.joint is None else np.asarray(link.joint.origin, dtype=float)


def _add_origin(element: ET.Element, position: np.ndarray, quaternion: np.ndarray = _STILL) -> None:
    add(element, "origin", xyz=numbers(position), rpy=numbers(quat_to_rpy(quaternion)))


def _add_inertial(link: ET.Element, compiled: Any, shift: np.ndarray) -> None:
    """Add the mass of a link, whose body in the engine's model is given; one without shapes may have none."""
    if compiled.mass[0] <= 0:
        return
    element = add(link, "inertial")
    _add_origin(element, compiled.ipos + shift, compiled.iquat)
    add(element, "mass", value=numbers(compiled.mass))
    moments = {f"i{axis}{axis}": numbers([m]) for axis, m in zip("xyz", compiled.inertia, strict=True)}
    add(element, "inertia", **moments, ixy=0, ixz=0, iyz=0)


def _add_visual(link: ET.Element, file: SurfaceFile, label: str, shift: np.ndarray) -> None:
    element = add(link, "visual", name=label)
    _add_origin(element, shift)
    add(add(element, "geometry"), "mesh", filename=f"{_MESHES}/{file.stem}.obj")


def _add_collision(link: ET.Element, name: str, shape: CollisionShape, shift: np.ndarray, folder: Path) -> None:
    """Add a shape; URDF has no capsule, so that one is a cylinder and two spheres."""
    centre = np.asarray(shape.position, dtype=float) + shift
    if shape.kind == "box":
        geometry = _collision_at(link, centre, shape.quaternion)
        add(geometry, "box", size=numbers(2 * s for s in shape.size))
    elif shape.kind == "sphere":
        add(_collision_at(link, centre), "sphere", radius=numbers(shape.size[:1]))
    elif shape.kind == "hull":
        file = f"{_MESHES}/{name}.obj"
        write_hull(shape, folder / file)
        add(_collision_at(link, centre, shape.quaternion), "mesh", filename=file)
    else:
        radius, half = shape.size
        geometry = _collision_at(link, centre, shape.quaternion)
        add(geometry, "cylinder", radius=numbers([radius]), length=numbers([2 * half]))
        for side in (-half, half) if shape.kind == "capsule" else ():
            cap = quat_rotate(np.asarray(shape.quaternion, dtype=float), np.array((0.0, 0.0, side)))
            add(_collision_at(link, centre + cap), "sphere", radius=numbers([radius]))


def _collision_at(link: ET.Element, centre: np.ndarray, quaternion: np.ndarray = _STILL) -> ET.Element:
    element = add(link, "collision")
    _add_origin(element, centre, quaternion)
    return add(element, "geometry")


def _add_joint(root: ET.Element, link: Link, parent: Link) -> None:
    joint = link.joint
    name = f"{link.name}_fixed" if joint is None else joint.name
    element = add(root, "joint", name=name, type=_joint_type(joint))
    place = np.asarray(link.position, dtype=float) + quat_rotate(np.asarray(link.quaternion, float), _origin(link))
    _add_origin(element, place - _origin(parent), link.quaternion)
    add(element, "parent", link=parent.name)
    add(element, "child", link=link.name)
    if joint is None:
        return
    add(element, "axis", xyz=numbers(joint.axis))
    add(element, "dynamics", damping=0, friction=0)
    if np.isfinite(joint.limits).all():
        lower, upper = (numbers([limit]) for limit in joint.limits)
        add(element, "limit", lower=lower, upper=upper, effort=numbers([_EFFORT]), velocity=numbers([_VELOCITY]))


def _joint_type(joint: Joint | None) -> str:
    if joint is None:
        return "fixed"
    if joint.kind == "revolute" and not np.isfinite(joint.limits).all():
        return "continuous"
    return joint.kind


def _part_labels(obj: ArticulatedObject, files: tuple[SurfaceFile, ...]) -> list[str]:
    """Return `<part>-<number>` per surface: the same number for all surfaces of one handle, else one each."""
    first = len(obj.handles)
    return [
        f"{file.visual.part or 'part'}-{_handle_number(obj, file) if _is_handle(obj, file) else first + k}"
        for k, file in enumerate(files)
    ]


def _is_handle(obj: ArticulatedObject, file: SurfaceFile) -> bool:
    return is_handle_part(file.visual.part) and bool(obj.handles_of(obj.links[file.link].name))


def _handle_number(obj: ArticulatedObject, file: SurfaceFile) -> int:
    """Return which of the object's handles the surface belongs to: the nearest one of its link."""
    middle = file.visual.mesh.bounds.mean(axis=0)
    own = [k for k, handle in enumerate(obj.handles) if handle.link == obj.links[file.link].name]
    return min(own, key=lambda k: float(np.linalg.norm(obj.handles[k].points.mean(axis=0) - middle)))


def _write_annotations(obj: ArticulatedObject, folder: Path) -> None:
    meta = {
        "model_cat": MODEL_CATEGORIES[obj.category],
        "anno_id": obj.id,
        "artiskill": {"scale": 1.0, "origin": [0.0, 0.0, 0.0]},
    }
    (folder / "meta.json").write_text(json.dumps(meta, indent=2) + "\n", encoding="utf-8")
    lines = [f"{link.name} {_semantic_joint(obj, link)} {_semantic_name(link)}" for link in obj.links]
    (folder / "semantics.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _semantic_joint(obj: ArticulatedObject, link: Link) -> str:
    """Return the data set's word for how a link moves."""
    if link.parent < 0:
        return "heavy" if obj.category == "cabinet" else "free"
    if link.joint is None:
        return "static"
    return "slider" if link.joint.kind == "prismatic" else "hinge"


def _semantic_name(link: Link) -> str:
    """Return what the link is: the part with most faces that is no handle."""
    parts = [v for v in link.visuals if v.part and not is_handle_part(v.part)]
    if link.parent < 0 or not parts:
        return "body"
    return max(parts, key=lambda visual: len(visual.mesh.faces)).part
