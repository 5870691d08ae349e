"""`Scene`: a compiled model of robot, object and ground, with every name resolved once."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, VisualMesh
from artiskill.robots.config import RobotConfig
from artiskill.robots.model import RobotPart, add_robot
from artiskill.robots.visuals import robot_visuals
from artiskill.scene.object_model import ObjectPart, add_object
from artiskill.scene.physics import Group, PhysicsConfig, set_contact, set_joint_limits_solver, set_options


@dataclass(frozen=True)
class Layout:
    """Sizes that two scenes must share to step in one batch: the engine's arrays have them as shapes."""

    bodies: int
    joints: int
    geoms: int
    qpos: int
    dof: int
    actuators: int


@dataclass(frozen=True, eq=False)
class SceneIndex:
    """Where things are in the engine's arrays. R robot joints, J object joints, L object links, T fingertips.

    Attributes:
        robot: the R robot joints, in qpos, qvel and joint arrays alike (all have one degree of freedom).
        object_joints: the J object joints, in qpos and qvel.
        object_bodies: the L links, in body arrays, in the object's order.
        fingertip_sites: (T,) two per arm.
        finger_line_sites: (T,) in the same order.
        fingertip_bodies: (T,) bodies that the fingertips belong to.
        tool_sites: (A,) one per arm.
    """

    robot: slice
    object_joints: slice
    object_bodies: slice
    fingertip_sites: np.ndarray
    finger_line_sites: np.ndarray
    fingertip_bodies: np.ndarray
    tool_sites: np.ndarray


@dataclass(frozen=True, eq=False)
class Scene:
    """A model ready to step; never changed after it is built.

    Attributes:
        model: the compiled `mujoco.MjModel`. Copy it before changing anything.
        index: where things are in its arrays.
        physics: the configuration it was built with.
        robot: names of the robot's parts.
        object: the object.
    """

    model: Any
    index: SceneIndex
    physics: PhysicsConfig
    robot: RobotPart
    object: ArticulatedObject

    @property
    def layout(self) -> Layout:
        """The sizes of the engine's arrays."""
        m = self.model
        return Layout(m.nbody, m.njnt, m.ngeom, m.nq, m.nv, m.nu)

    @cached_property
    def visuals(self) -> tuple[tuple[int, VisualMesh], ...]:
        """Everything drawn, with the body index that carries it; the ground is not among it."""
        drawn: list[tuple[int, VisualMesh]] = []
        for body, part in self.robot.bodies.items():
            index = self.model.body(body).id
            drawn += [(index, visual) for visual in robot_visuals(part)]
        for index, link in enumerate(self.object.links, start=self.index.object_bodies.start):
            drawn += [(index, visual) for visual in link.visuals]
        return tuple(drawn)


def build_scene(robot: RobotConfig, obj: ArticulatedObject, physics: PhysicsConfig) -> Scene:
    """Compile robot, object and ground into one model.

    The model holds collision shapes only; what is drawn is in `Scene.visuals`, for the project's own renderer.
    """
    spec = mujoco.MjSpec()
    spec.modelname = f"{robot.name}+{obj.id}"
    set_options(spec, physics)
    ground = spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
    # a pair collides where either side asks for it; the robot's parts ask for the ground, its column does not
    set_contact(ground, Group.GROUND, Group.LOOSE, physics.contact.ground_friction, physics)
    robot_part = add_robot(spec, robot)
    _set_robot_contacts(spec, robot_part, physics)
    object_part = add_object(spec, obj, physics)
    set_joint_limits_solver(spec.joints, physics)
    model = spec.compile()
    return Scene(model, _resolve(model, robot_part, object_part), physics, robot_part, obj)


def _set_robot_contacts(spec: Any, robot: RobotPart, physics: PhysicsConfig) -> None:
    contact = physics.contact
    touchable = Group.OBJECT | Group.LOOSE
    for names, collides_with, friction in (
        (robot.finger_geoms, touchable | Group.GROUND, contact.finger_friction),
        (robot.link_geoms, touchable | Group.GROUND, contact.ground_friction),
        (robot.column_geoms, touchable, contact.ground_friction),
    ):
        for name in names:
            set_contact(spec.geom(name), Group.ROBOT, collides_with, friction, physics)
    for name in robot.finger_geoms:
        spec.geom(name).priority = 1


def _resolve(model: Any, robot: RobotPart, obj: ObjectPart) -> SceneIndex:
    joints = [model.joint(name).id for name in (*robot.joints, *obj.joints)]
    assert joints == list(range(model.njnt)), "robot joints first, then the object's, in their own order"
    assert model.nq == model.nv == model.njnt, "every joint has one degree of freedom"
    bodies = [model.body(name).id for name in obj.bodies]
    assert bodies == list(range(bodies[0], bodies[0] + len(bodies))), "object links are contiguous"
    tips = np.array([model.site(name).id for name in robot.fingertip_sites])
    return SceneIndex(
        robot=slice(0, len(robot.joints)),
        object_joints=slice(len(robot.joints), len(joints)),
        object_bodies=slice(bodies[0], bodies[0] + len(bodies)),
        fingertip_sites=tips,
        finger_line_sites=np.array([model.site(name).id for name in robot.finger_line_sites]),
        fingertip_bodies=model.site_bodyid[tips],
        tool_sites=np.array([model.site(name).id for name in robot.tool_sites]),
    )
