"""An object as MJCF: `<id>.xml` has the object alone, to be included or attached; `scene.xml` puts it on a floor.

Joints, limits, springs, masses, collision shapes and contact parameters are those of our own scenes. Drawn
surfaces are mesh geoms that touch nothing, group 2; collision shapes are group 3. Joint friction and damping are
0, for in the benchmark the task draws both anew in every episode; the first `joint` default is where to set them.
"""

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape, Joint, Link
from artiskill.exports.common import (
    SurfaceFile,
    add,
    compile_object,
    distinct_materials,
    numbers,
    surface_files,
    write_hull,
    write_surfaces,
    write_xml,
)
from artiskill.scene.object_model import FREE_CATEGORIES, OBJECT_PREFIX, ObjectScene
from artiskill.scene.physics import Group, PhysicsConfig

SCENE_FILE = "scene.xml"
_MESHES, _TEXTURES = "meshes", "textures"
_JOINT_TYPES = {"prismatic": "slide", "revolute": "hinge"}
_CLASS, _VISUAL, _COLLISION = "object", "object_visual", "object_collision"


def write_mjcf(obj: ArticulatedObject, folder: Path) -> Path:
    """Write the object into an empty folder and return the main file."""
    physics = PhysicsConfig()
    files, compiled = surface_files(obj), compile_object(obj, physics)
    write_surfaces(files, folder, _MESHES, _TEXTURES)
    root = ET.Element("mujoco", model=obj.id)
    add(root, "compiler", angle="radian", meshdir=_MESHES, texturedir=_TEXTURES, autolimits="false")
    # the solver settings that hold a handle without sinking through it
    solver = {"integrator": "implicitfast", "solver": "Newton", "cone": "elliptic"}
    step, impratio = numbers([physics.timestep_s]), numbers([physics.contact.impratio])
    add(root, "option", timestep=step, **solver, impratio=impratio, iterations=physics.solver_iterations)
    _add_defaults(root, compiled)
    assets = add(root, "asset")
    _add_materials(assets, files)
    world = add(root, "worldbody")
    free = obj.category in FREE_CATEGORIES
    bodies: list[ET.Element] = []
    for index, link in enumerate(obj.links):
        parent = world if link.parent < 0 else bodies[link.parent]
        body = _add_body(parent, link, compiled.model.body(compiled.bodies[index]), free)
        _add_visuals(body, assets, [file for file in files if file.link == index])
        for number, shape in enumerate(link.collisions):
            name = f"{link.name}_shape{number}"
            geom = _add_collision(body, name, shape)
            geom.set("friction", numbers(compiled.model.geom(OBJECT_PREFIX + name).friction))
            if shape.kind == "hull":
                write_hull(shape, folder / _MESHES / f"{name}.obj")
                add(assets, "mesh", name=name, file=f"{name}.obj", inertia="convex")
        bodies.append(body)
    path = folder / f"{obj.id}.xml"
    write_xml(root, path)
    _write_scene(obj, path, physics)
    return path


def _add_defaults(root: ET.Element, compiled: ObjectScene) -> None:
    """Add what all joints, drawn surfaces and collision shapes have in common."""
    model = compiled.model
    default = add(add(root, "default"), "default", class_=_CLASS)
    joint = add(default, "joint", damping=0, frictionloss=0)  # one place to change them
    if len(compiled.joints):
        joint.set("solreflimit", numbers(model.jnt_solref[compiled.joints[0]]))
        joint.set("solimplimit", numbers(model.jnt_solimp[compiled.joints[0]]))
    visual = add(default, "default", class_=_VISUAL)
    add(visual, "geom", type="mesh", contype=0, conaffinity=0, group=2, mass=0)
    geom = add(add(default, "default", class_=_COLLISION), "geom", group=3)
    with_shapes = [link.name for link in compiled.object.links if link.collisions]
    if with_shapes:
        first = model.geom(f"{OBJECT_PREFIX}{with_shapes[0]}_shape0")
        geom.set("contype", str(first.contype[0]))
        geom.set("conaffinity", str(first.conaffinity[0]))
        geom.set("solref", numbers(first.solref))
        geom.set("solimp", numbers(first.solimp))


def _add_materials(assets: ET.Element, files: tuple[SurfaceFile, ...]) -> None:
    for material in distinct_materials(files):
        look = add(assets, "material", name=material.name, rgba=numbers((*material.srgb, material.alpha)))
        look.set("specular", numbers([0.5 * material.shininess]))
        look.set("shininess", numbers([material.shininess]))
        if material.texture is not None:
            add(assets, "texture", name=material.name, type="2d", file=material.texture_file)
            look.set("texture", material.name)


def _add_body(parent: ET.Element, link: Link, compiled: Any, free: bool) -> ET.Element:
    """Add a link; `compiled` is its body in the engine's model. Without collision shapes it may weigh nothing."""
    body = add(parent, "body", name=link.name, pos=numbers(link.position), quat=numbers(link.quaternion))
    if link.parent < 0:
        body.set("childclass", _CLASS)
        if free:
            add(body, "freejoint", name="root")
    if compiled.mass[0] > 0:
        place = {"pos": numbers(compiled.ipos), "quat": numbers(compiled.iquat)}
        add(body, "inertial", **place, mass=numbers(compiled.mass), diaginertia=numbers(compiled.inertia))
    if link.joint is not None:
        _add_joint(body, link.joint)
    return body


def _add_joint(body: ET.Element, joint: Joint) -> None:
    limited = bool(np.isfinite(joint.limits).all())
    added = add(body, "joint", name=joint.name, type=_JOINT_TYPES[joint.kind], axis=numbers(joint.axis))
    added.set("pos", numbers(joint.origin))
    added.set("limited", "true" if limited else "false")
    if limited:
        added.set("range", numbers(joint.limits))
    if joint.stiffness > 0:
        added.set("stiffness", numbers([joint.stiffness]))
        added.set("springref", numbers([joint.spring_reference]))


def _add_visuals(body: ET.Element, assets: ET.Element, files: list[SurfaceFile]) -> None:
    for file in files:
        # a shell, for a drawn surface need not be closed
        add(assets, "mesh", name=file.stem, file=f"{file.stem}.obj", inertia="shell")
        add(body, "geom", class_=_VISUAL, name=file.stem, mesh=file.stem, material=file.material.name)


def _add_collision(body: ET.Element, name: str, shape: CollisionShape) -> ET.Element:
    is_mesh = shape.kind == "hull"
    kind = {"type": "mesh", "mesh": name} if is_mesh else {"type": shape.kind, "size": numbers(shape.size)}
    place = {"pos": numbers(shape.position), "quat": numbers(shape.quaternion)}
    return add(body, "geom", class_=_COLLISION, name=name, **kind, **place)


def _write_scene(obj: ArticulatedObject, path: Path, physics: PhysicsConfig) -> None:
    """Write the object on a floor, with a sky and a light."""
    root = ET.Element("mujoco", model=f"{obj.id} on a floor")
    add(root, "include", file=path.name)
    extent = float(np.linalg.norm(np.ptp(obj.bounds, axis=0)))
    add(root, "statistic", center=numbers(obj.bounds.mean(axis=0)), extent=numbers([extent]))
    add(add(root, "visual"), "headlight", diffuse="0.4 0.4 0.4", ambient="0.3 0.3 0.3", specular="0 0 0")
    assets = add(root, "asset")
    sky = {"rgb1": "0.8 0.86 0.92", "rgb2": "0.5 0.58 0.66", "width": "64", "height": "384"}
    add(assets, "texture", type="skybox", builtin="gradient", **sky)
    world = add(root, "worldbody")
    add(world, "light", pos="-2 -2 4", dir="1 1 -2", type="directional", diffuse="0.6 0.6 0.6")
    look = {"type": "plane", "group": "0", "size": "0 0 1", "rgba": "0.75 0.75 0.73 1"}
    ground = add(world, "geom", class_=_COLLISION, name="ground", **look)
    ground.set("contype", str(int(Group.GROUND)))
    ground.set("conaffinity", str(int(Group.LOOSE)))
    ground.set("friction", numbers((physics.contact.ground_friction, 0.005, 0.0001)))
    write_xml(root, path.with_name(SCENE_FILE))
