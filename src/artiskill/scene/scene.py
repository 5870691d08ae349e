"""`Scene`: a compiled model of robot, object, props and ground, with every name resolved once."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape, VisualMesh
from artiskill.robots.config import RobotConfig
from artiskill.robots.model import GEOM_TYPES, RobotPart, add_robot
from artiskill.robots.visuals import robot_visuals
from artiskill.scene.layout import SceneLayout, add_padding, layout_of, plan_padding
from artiskill.scene.object_model import ObjectPart, add_object
from artiskill.scene.physics import Group, PhysicsConfig, set_contact, set_joint_limits_solver, set_options
from artiskill.scene.props import Prop, add_props

# The engine would write each warning to a file in the working directory as well, where nobody asked for one; what
# matters of it is raised as an error here.
_LOG = mujoco.MjLogConfig.get()
_LOG.logto_file = False
_LOG.set()


@dataclass(frozen=True, eq=False)
class SceneIndex:
    """Where things are in the engine's arrays. R robot joints, J object joints, L object links, T fingertips.

    Attributes:
        robot: the R robot joints, in qpos, qvel and joint arrays alike (all have one degree of freedom).
        root_qpos: position and orientation of an object that is free to move, in qpos; else empty.
        root_dof: its linear (world frame) and angular (own frame) velocity, in qvel; else empty.
        object_qpos: the J object joints, in qpos.
        object_dof: the J object joints, in qvel and other arrays of degrees of freedom.
        object_bodies: the L links, in body arrays, in the object's order.
        prop_qpos: positions and orientations of the K free props, seven numbers each, in qpos.
        prop_dof: their velocities, six numbers each, in qvel.
        finger_lines: in the sensor data, (T, 2, 3) positions of each finger line's start and tip.
        fingertip_velocities: in the sensor data, (T, 3).
        tool_positions: in the sensor data, (A, 3).
        tool_axes: in the sensor data, (A, 3, 3), one axis of the hand per row.
    """

    robot: slice
    root_qpos: slice
    root_dof: slice
    object_qpos: slice
    object_dof: slice
    object_bodies: slice
    prop_qpos: slice
    prop_dof: slice
    finger_lines: slice
    fingertip_velocities: slice
    tool_positions: slice
    tool_axes: slice


@dataclass(frozen=True, eq=False)
class Scene:
    """A model ready to step; never changed after it is built.

    Attributes:
        model: the compiled `mujoco.MjModel`. Copy it before changing anything.
        index: where things are in its arrays.
        physics: the configuration it was built with.
        robot: names of the robot's parts.
        object: the object.
        layout: its sizes; scenes of one layout step together.
        props: what else a task has put there.
    """

    model: Any
    index: SceneIndex
    physics: PhysicsConfig
    robot: RobotPart
    object: ArticulatedObject
    layout: SceneLayout
    props: tuple[Prop, ...] = ()

    @cached_property
    def visuals(self) -> tuple[tuple[int, VisualMesh], ...]:
        """Everything drawn, with the body index that carries it; the ground is not among it."""
        drawn: list[tuple[int, VisualMesh]] = []
        for body, part in self.robot.bodies.items():
            index = self.model.body(body).id
            drawn += [(index, visual) for visual in robot_visuals(part)]
        for index, link in enumerate(self.object.links, start=self.index.object_bodies.start):
            drawn += [(index, visual) for visual in link.visuals]
        drawn += [(self.model.body(prop.body).id, prop.visual()) for prop in self.props]
        return tuple(drawn)

    @cached_property
    def collision_shapes(self) -> tuple[tuple[int, CollisionShape], ...]:
        """Everything that can touch something, with the body index that carries it; the ground is not among it."""
        model = self.model
        kinds: dict[int, Any] = {int(geom): kind for kind, geom in GEOM_TYPES.items()}
        found: list[tuple[int, CollisionShape]] = []
        for geom in np.flatnonzero(model.geom_contype | model.geom_conaffinity).tolist():
            kind = kinds.get(int(model.geom_type[geom]))
            if kind is None:  # the ground
                continue
            vertices = None
            if kind == "hull":
                mesh = model.geom_dataid[geom]
                first = model.mesh_vertadr[mesh]
                vertices = np.array(model.mesh_vert[first : first + model.mesh_vertnum[mesh]], dtype=np.float64)
            pose = model.geom_pos[geom].copy(), model.geom_quat[geom].copy()
            size = tuple(model.geom_size[geom][: _SIZES[kind]].tolist())
            found.append((int(model.geom_bodyid[geom]), CollisionShape(kind, size, *pose, vertices)))
        return tuple(found)


_SIZES = {"box": 3, "cylinder": 2, "capsule": 2, "sphere": 1, "hull": 0}  # numbers in a shape's size


def build_scene(
    robot: RobotConfig, obj: ArticulatedObject, physics: PhysicsConfig, props: tuple[Prop, ...] = ()
) -> Scene:
    """Compile robot, object, props and ground into one model, padded to a layout where the object fits one.

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
    sensors = _add_sensors(spec, robot_part)
    object_part = add_object(spec, obj, physics)
    add_props(spec, props, physics)
    set_joint_limits_solver(spec.joints, physics)
    links, joints = len(obj.links), len(obj.joints)
    padding = plan_padding(obj, object_part, spec)
    if padding is not None:
        add_padding(spec, object_part, padding)
        links, joints = padding.config.links, padding.config.joints
    model = spec.compile()
    index = _resolve(model, robot_part, object_part, joints, sensors)
    return Scene(model, index, physics, robot_part, obj, layout_of(model, links, joints), props)


def _set_robot_contacts(spec: Any, robot: RobotPart, physics: PhysicsConfig) -> None:
    contact, touchable = physics.contact, Group.OBJECT | Group.LOOSE
    trunk, ground = Group.ROBOT | Group.TRUNK, touchable | Group.GROUND
    for names, group, collides_with, friction in (
        (robot.finger_geoms, Group.ROBOT, ground | Group.TRUNK, contact.finger_friction),
        (robot.outer_geoms, Group.ROBOT, ground | Group.TRUNK, contact.ground_friction),
        (robot.inner_geoms, Group.ROBOT, ground, contact.ground_friction),
        (robot.torso_geoms, trunk, ground, contact.ground_friction),
        (robot.column_geoms, trunk, touchable, contact.ground_friction),
    ):
        for name in names:
            set_contact(spec.geom(name), group, collides_with, friction, physics)
    for name in robot.finger_geoms:
        spec.geom(name).priority = 1
    _let_arms_meet(spec, robot)


def _let_arms_meet(spec: Any, robot: RobotPart) -> None:
    """What the second arm reaches the first arm with collides with that arm; one arm never touches itself."""
    sides = [mount.side for mount in robot.config.mounts]
    for name in (*robot.finger_geoms, *robot.outer_geoms):
        if name.startswith(sides[0]):
            spec.geom(name).contype |= int(Group.FIRST_ARM)
        else:
            spec.geom(name).conaffinity |= int(Group.FIRST_ARM)


def _add_sensors(spec: Any, robot: RobotPart) -> dict[str, slice]:
    """Frame sensors of the gripper's sites; the engine fills one array of them faster than Python gathers many.

    Returns:
        Where each group is in the sensor data; the names are those of `SceneIndex`.
    """
    kind = mujoco.mjtSensor
    lines = [site for pair in zip(robot.finger_line_sites, robot.fingertip_sites, strict=True) for site in pair]
    axes = (kind.mjSENS_FRAMEXAXIS, kind.mjSENS_FRAMEYAXIS, kind.mjSENS_FRAMEZAXIS)
    groups = {
        "finger_lines": [(kind.mjSENS_FRAMEPOS, site) for site in lines],
        "fingertip_velocities": [(kind.mjSENS_FRAMELINVEL, site) for site in robot.fingertip_sites],
        "tool_positions": [(kind.mjSENS_FRAMEPOS, site) for site in robot.tool_sites],
        "tool_axes": [(axis, site) for site in robot.tool_sites for axis in axes],
    }
    where, start = {}, 0
    for group, sensors in groups.items():
        for number, (sensor, site) in enumerate(sensors):
            spec.add_sensor(name=f"{group}{number}", type=sensor, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site)
        where[group] = slice(start, start + 3 * len(sensors))
        start += 3 * len(sensors)
    return where


def _resolve(model: Any, robot: RobotPart, obj: ObjectPart, places: int, sensors: dict[str, slice]) -> SceneIndex:
    """Find everything; `places` is how many joints the object takes up, with those that pad it."""
    joints = [model.joint(name).id for name in (*robot.joints, *obj.root, *obj.joints)]
    assert joints == list(range(len(joints))), "robot joints first, then the object's, in their own order"
    bodies = [model.body(name).id for name in obj.bodies]
    assert bodies == list(range(bodies[0], bodies[0] + len(bodies))), "object links are contiguous"
    # qpos and degrees of freedom, one run after the other
    padding = places - len(obj.joints)
    runs_qpos = _runs(len(robot.joints), 7 * len(obj.root), len(obj.joints), padding, total=model.nq)
    runs_dof = _runs(len(robot.joints), 6 * len(obj.root), len(obj.joints), padding, total=model.nv)
    return SceneIndex(
        robot=runs_qpos[0],
        root_qpos=runs_qpos[1],
        root_dof=runs_dof[1],
        object_qpos=runs_qpos[2],
        object_dof=runs_dof[2],
        object_bodies=slice(bodies[0], bodies[0] + len(bodies)),
        prop_qpos=runs_qpos[-1],
        prop_dof=runs_dof[-1],
        **sensors,
    )


def _runs(*sizes: int, total: int) -> list[slice]:
    """Slices of so many numbers each, one after the other; a last one has the rest."""
    ends = np.cumsum((0, *sizes)).tolist()
    return [slice(start, stop) for start, stop in pairwise((*ends, total))]


CAPACITY = 256  # scenes; one takes a fifth to half a megabyte


@lru_cache(maxsize=CAPACITY)
def cached_scene(
    robot: RobotConfig, obj: ArticulatedObject, physics: PhysicsConfig, props: tuple[Prop, ...] = ()
) -> Scene:
    """`build_scene`, remembered. Objects are told apart by identity: loading one twice gives the same instance."""
    return build_scene(robot, obj, physics, props)
