"""An object alone on the ground, as a compiled model: for checks, exports and their tests."""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.scene.object_model import ObjectPart, add_object
from artiskill.scene.options import Group, set_contact, set_joint_limits_solver, set_options
from artiskill.scene.physics import PhysicsConfig

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
