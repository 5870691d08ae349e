"""An object as MJCF: `<id>.xml` has the object alone, to be included or attached; `scene.xml` puts it on a floor.

Joints, limits, springs, masses, collision shapes and contact parameters are those of our own scenes. Drawn
surfaces are mesh geoms that touch nothing, group 2; collision shapes are group 3. Joint friction and damping are
0, for in the benchmark the task draws both anew in every episode; the first `joint` default is where to set them.
"""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape, Joint, Link
from artiskill.exports.engine_values import EngineValues, Inertial, ShapeContact, engine_values
from artiskill.exports.obj_files import SurfaceFile, distinct_materials, obj_text, surface_files, write_surfaces
from artiskill.exports.xml_text import add, numbers, write_xml
from artiskill.geometry.meshes import convex_hull
from artiskill.scene.object_model import FREE_CATEGORIES
from artiskill.scene.options import Group
from artiskill.scene.physics import PhysicsConfig

SCENE_FILE = "scene.xml"
_MESHES, _TEXTURES = "meshes", "textures"
_JOINT_TYPES = {"prismatic": "slide", "revolute": "hinge"}
_CLASS, _VISUAL, _COLLISION = "object", "object_visual", "object_collision"


def write_mjcf(obj: ArticulatedObject, folder: Path) -> Path:
    """Write the object into an empty folder and return the main file."""
    physics = PhysicsConfig()
    files, values = surface_files(obj), engine_values(obj, physics)
    write_surfaces(files, folder, _MESHES, _TEXTURES)
    root = ET.Element("mujoco", model=obj.id)
    add(root, "compiler", angle="radian", meshdir=_MESHES, texturedir=_TEXTURES, autolimits="false")
    _add_options(root, physics)
    _add_defaults(root, values)
    assets = add(root, "asset")
    _add_materials(assets, files)
    world = add(root, "worldbody")
    bodies: list[ET.Element] = []
    for index, link in enumerate(obj.links):
        parent = world if link.parent < 0 else bodies[link.parent]
        body = _add_body(parent, link, values.inertials[index], obj.category in FREE_CATEGORIES)
        _add_visuals(body, assets, [file for file in files if file.link == index])
        for number, shape in enumerate(link.collisions):
            contact = values.contacts[index][number]
            _add_collision(body, assets, f"{link.name}_shape{number}", shape, contact, folder)
        bodies.append(body)
    path = folder / f"{obj.id}.xml"
    write_xml(root, path)
    _write_scene(obj, path, physics)
    return path


def _add_options(root: ET.Element, physics: PhysicsConfig) -> None:
    """The solver settings that hold a handle without sinking through it."""
    add(
        root,
        "option",
        timestep=numbers([physics.timestep_s]),
        integrator="implicitfast",
        solver="Newton",
        cone="elliptic",
        impratio=numbers([physics.contact.impratio]),
        iterations=physics.solver_iterations,
    )


def _add_defaults(root: ET.Element, values: EngineValues) -> None:
    default = add(add(root, "default"), "default", class_=_CLASS)
    joint = add(default, "joint", damping=0, frictionloss=0)  # one place to change them
    if len(values.limit_solref):
        joint.set("solreflimit", numbers(values.limit_solref))
        joint.set("solimplimit", numbers(values.limit_solimp))
    visual = add(default, "default", class_=_VISUAL)
    add(visual, "geom", type="mesh", contype=0, conaffinity=0, group=2, mass=0)
    contacts = [contact for link in values.contacts for contact in link]
    collision = add(default, "default", class_=_COLLISION)
    geom = add(collision, "geom", group=3)
    if contacts:
        first = contacts[0]
        geom.set("contype", str(first.group))
        geom.set("conaffinity", str(first.collides_with))
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


def _add_body(parent: ET.Element, link: Link, inertial: Inertial, free: bool) -> ET.Element:
    body = add(parent, "body", name=link.name, pos=numbers(link.position), quat=numbers(link.quaternion))
    if link.parent < 0:
        body.set("childclass", _CLASS)
        if free:
            add(body, "freejoint", name="root")
    if inertial.mass_kg > 0:
        mass, moments = numbers([inertial.mass_kg]), numbers(inertial.moments_kg_m2)
        add(
            body,
            "inertial",
            pos=numbers(inertial.position),
            quat=numbers(inertial.quaternion),
            mass=mass,
            diaginertia=moments,
        )
    if link.joint is not None:
        _add_joint(body, link.joint)
    return body


def _add_joint(body: ET.Element, joint: Joint) -> None:
    limited = bool(np.isfinite(joint.limits).all())
    added = add(
        body,
        "joint",
        name=joint.name,
        type=_JOINT_TYPES[joint.kind],
        axis=numbers(joint.axis),
        pos=numbers(joint.origin),
        limited="true" if limited else "false",
    )
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


def _add_collision(
    body: ET.Element, assets: ET.Element, name: str, shape: CollisionShape, contact: ShapeContact, folder: Path
) -> None:
    placed = {"pos": numbers(shape.position), "quat": numbers(shape.quaternion)}
    placed["friction"] = numbers(contact.friction)
    if shape.kind == "hull":
        assert shape.vertices is not None
        text = obj_text(convex_hull(shape.vertices).mesh)
        (folder / _MESHES / f"{name}.obj").write_text(text, encoding="utf-8")
        add(assets, "mesh", name=name, file=f"{name}.obj", inertia="convex")
        add(body, "geom", class_=_COLLISION, name=name, type="mesh", mesh=name, **placed)
    else:
        add(body, "geom", class_=_COLLISION, name=name, type=shape.kind, size=numbers(shape.size), **placed)


def _write_scene(obj: ArticulatedObject, path: Path, physics: PhysicsConfig) -> None:
    root = ET.Element("mujoco", model=f"{obj.id} on a floor")
    add(root, "include", file=path.name)
    centre = obj.bounds.mean(axis=0)
    add(
        root,
        "statistic",
        center=numbers(centre),
        extent=numbers([float(np.linalg.norm(np.ptp(obj.bounds, axis=0)))]),
    )
    add(add(root, "visual"), "headlight", diffuse="0.4 0.4 0.4", ambient="0.3 0.3 0.3", specular="0 0 0")
    assets = add(root, "asset")
    sky = {"rgb1": "0.8 0.86 0.92", "rgb2": "0.5 0.58 0.66", "width": "64", "height": "384"}
    add(assets, "texture", type="skybox", builtin="gradient", **sky)
    world = add(root, "worldbody")
    add(world, "light", pos="-2 -2 4", dir="1 1 -2", type="directional", diffuse="0.6 0.6 0.6")
    add(
        world,
        "geom",
        class_=_COLLISION,
        name="ground",
        type="plane",
        group=0,
        size="0 0 1",
        rgba="0.75 0.75 0.73 1",
        contype=int(Group.GROUND),
        conaffinity=int(Group.LOOSE),
        friction=numbers((physics.contact.ground_friction, 0.005, 0.0001)),
    )
    write_xml(root, path.with_name(SCENE_FILE))
