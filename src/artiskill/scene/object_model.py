"""An `ArticulatedObject` as bodies, joints and geoms of a MuJoCo specification; alone on the ground, too."""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape, Link
from artiskill.robots.model import add_shape
from artiskill.scene.physics import Group, PhysicsConfig, set_contact, set_joint_limits_solver, set_options

_MIN_MASS_KG = 0.05  # of a moving link whose collision shapes are too small to weigh anything
OBJECT_PREFIX = "object/"
ROOT_JOINT = OBJECT_PREFIX + "root"
WHEEL_PART = "wheel"
# objects that stand on the ground and are free to move; the others are fixed to the world
FREE_CATEGORIES = ("chair", "bucket")


@dataclass(frozen=True)
class ObjectPart:
    """Names of what was added, in the object's own order; `root` is the free joint, where there is one."""

    bodies: tuple[str, ...]
    joints: tuple[str, ...]
    root: tuple[str, ...] = ()


def add_object(spec: Any, obj: ArticulatedObject, physics: PhysicsConfig) -> ObjectPart:
    """Add the object: at the world's origin, fixed there or free, whichever its category calls for.

    Links of one object do not collide with one another: generated ones never touch within their limits, and
    overlapping hulls of imported ones would jam them. The joints' limits keep doors and drawers in place.
    """
    bodies: list[Any] = []
    joints: list[str] = []
    free = obj.category in FREE_CATEGORIES
    touches = Group.ROBOT | Group.LOOSE | (Group.GROUND if free else 0)
    for link in obj.links:
        parent = spec.worldbody if link.parent < 0 else bodies[link.parent]
        body = parent.add_body(name=OBJECT_PREFIX + link.name, pos=link.position, quat=link.quaternion)
        if link.parent < 0 and free:
            body.add_freejoint(name=ROOT_JOINT)
        if link.joint is not None:
            joints.append(_add_joint(body, link))
        for i, shape in enumerate(link.collisions):
            geom = _add_collision(spec, body, f"{body.name}_shape{i}", shape)
            geom.density = link.density_kg_m3
            contact = physics.contact
            friction = contact.wheel_friction if shape.part == WHEEL_PART else contact.object_friction
            set_contact(geom, Group.OBJECT, touches, friction, physics)
        if link.joint is not None and not link.collisions:
            body.explicitinertial, body.mass, body.inertia = True, _MIN_MASS_KG, (1e-4, 1e-4, 1e-4)
        bodies.append(body)
    return ObjectPart(tuple(b.name for b in bodies), tuple(joints), (ROOT_JOINT,) if free else ())


def _add_joint(body: Any, link: Link) -> str:
    joint = link.joint
    assert joint is not None
    kinds = {"prismatic": mujoco.mjtJoint.mjJNT_SLIDE, "revolute": mujoco.mjtJoint.mjJNT_HINGE}
    limited = bool(np.isfinite(joint.limits).all())
    added = body.add_joint(
        name=OBJECT_PREFIX + joint.name, type=kinds[joint.kind], axis=joint.axis, pos=joint.origin
    )
    added.limited = mujoco.mjtLimited.mjLIMITED_TRUE if limited else mujoco.mjtLimited.mjLIMITED_FALSE
    if limited:
        added.range = joint.limits
    added.stiffness[0], added.springref = joint.stiffness, joint.spring_reference
    return added.name


def _add_collision(spec: Any, body: Any, name: str, shape: CollisionShape) -> Any:
    geom = add_shape(body, name, shape.kind, shape.size, shape.position, shape.quaternion)
    if shape.kind == "hull":
        assert shape.vertices is not None
        mesh = spec.add_mesh(name=name, uservert=np.asarray(shape.vertices, dtype=float).ravel())
        geom.meshname = mesh.name
    return geom


GROUND = "ground"


@dataclass(frozen=True, eq=False)
class ObjectScene:
    """A model of ground and object, ready to step; never changed after it is built.

    Attributes:
        model: the compiled `mujoco.MjModel`.
        object: the object.
        bodies: (L,) the links, in body arrays.
        joints: (J,) the object's joints, in joint arrays.
        qpos: (J,) likewise in qpos.
        dofs: (J,) likewise in qvel.
    """

    model: Any
    object: ArticulatedObject
    bodies: np.ndarray
    joints: np.ndarray
    qpos: np.ndarray
    dofs: np.ndarray

    @property
    def is_free(self) -> bool:
        """Whether the root can move; it then has the first seven numbers of qpos."""
        return bool(self.model.njnt) and self.model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE

    def rest_data(self) -> Any:
        """A new `mujoco.MjData` of the object at rest: standing where its root belongs, joints at `Joint.rest`."""
        data = mujoco.MjData(self.model)
        data.qpos[self.qpos] = self.object.rest_qpos
        mujoco.mj_forward(self.model, data)
        return data


def object_spec(
    obj: ArticulatedObject, physics: PhysicsConfig, ground: bool = True, hold: bool = False
) -> tuple[Any, ObjectPart]:
    """A specification of ground and object, for callers that add more before they compile.

    Args:
        obj: the object.
        physics: rates, solver, contacts.
        ground: whether there is a ground.
        hold: fix the root to the world even if the object's category is free to move.

    Returns:
        The `mujoco.MjSpec`, and the names of the object's parts in it.
    """
    spec = mujoco.MjSpec()
    spec.modelname = obj.id
    set_options(spec, physics)
    if ground:
        plane = spec.worldbody.add_geom(name=GROUND, type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
        set_contact(plane, Group.GROUND, Group.LOOSE, physics.contact.ground_friction, physics)
    part = add_object(spec, obj, physics)
    if hold:
        for joint in [j for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_FREE]:
            spec.delete(joint)
    set_joint_limits_solver(spec.joints, physics)
    return spec, part


def resolve_object_scene(model: Any, obj: ArticulatedObject, part: ObjectPart) -> ObjectScene:
    """Find the object in a model that was compiled from its specification."""
    joints = np.array([model.joint(name).id for name in part.joints], dtype=int)
    return ObjectScene(
        model=model,
        object=obj,
        bodies=np.array([model.body(name).id for name in part.bodies], dtype=int),
        joints=joints,
        qpos=model.jnt_qposadr[joints],
        dofs=model.jnt_dofadr[joints],
    )


def build_object_scene(
    obj: ArticulatedObject, physics: PhysicsConfig, ground: bool = True, hold: bool = False
) -> ObjectScene:
    """Compile ground and object; the arguments are those of `object_spec`.

    Raises:
        ValueError: the engine refuses the object: a moving link without mass, say; its message says which.
    """
    spec, part = object_spec(obj, physics, ground, hold)
    return resolve_object_scene(spec.compile(), obj, part)
