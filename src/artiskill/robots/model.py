"""From a `RobotConfig` to the robot's part of a MuJoCo model: bodies, joints, sites and native drives.

The drives are MuJoCo actuators, so that one environment step is one call of many substeps: velocity actuators
behind an exact first-order filter, the base's through a site (so that its velocity is the one in its own frame),
position servos for the fingers. `gravcomp` balances gravity.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from artiskill.geometry.rotations import quat_from_axis_angle, quat_from_rpy
from artiskill.robots.arm_config import ArmConfig, BodyConfig, FingerConfig, ShapeConfig, load_arm
from artiskill.robots.config import MountConfig, RobotConfig

GEOM_TYPES = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "hull": mujoco.mjtGeom.mjGEOM_MESH,
}


def add_shape(body: Any, name: str, kind: str, size: Any, position: Any, quaternion: Any) -> Any:
    """Add a primitive to `body` and return the geom; for a hull the caller names its mesh.

    Args:
        body: an `MjsBody`.
        name: of the geom.
        kind: a key of `GEOM_TYPES`.
        size: as in `assets.articulated_object.CollisionShape`; empty for a hull.
        position: (3,) in the body's frame.
        quaternion: (4,) in the body's frame.
    """
    padded = np.zeros(3)
    padded[: len(size)] = size
    return body.add_geom(
        name=name,
        type=GEOM_TYPES[kind],
        size=padded,
        pos=np.asarray(position, dtype=float),
        quat=np.asarray(quaternion, dtype=float),
    )


BASE_BODY, LIFT_BODY, TORSO_BODY = "mobile_base", "lift", "torso"
BASE_JOINTS = ("root_x_axis_joint", "root_y_axis_joint", "root_z_rotation_joint")
LIFT_JOINT = "linear_actuator_height"
_OUTER_FROM = 4  # index of link 5, the forearm
_HALF_TURN_Z = quat_from_axis_angle((0, 0, 1), math.pi)


@dataclass(frozen=True)
class RobotPart:
    """Names of what was added, in the order that actions, qpos and observations have.

    Attributes:
        config: the robot.
        joints: all R joints: base x, y, yaw; lift; then per arm its joints and two fingers.
        actuators: one per joint, in the same order.
        bodies: body name -> name of its drawn part (see `robots.visuals`).
        fingertip_sites: two per arm, at the end of each pad's inner face.
        finger_line_sites: where each finger's line starts, in the same order; it ends at the fingertip.
        tool_sites: one per arm, between the pads, oriented as the hand (z forward, fingers close along y).
        finger_geoms: shapes that grip.
        outer_geoms: the arms' other shapes from link 5 on, which can reach the robot's own trunk.
        inner_geoms: the arms' shapes up to link 4, which overlap the torso at the shoulder.
        torso_geoms: shapes of torso and head.
        column_geoms: platform and column, which must not touch the ground.
    """

    config: RobotConfig
    joints: tuple[str, ...]
    actuators: tuple[str, ...]
    bodies: dict[str, str]
    fingertip_sites: tuple[str, ...]
    finger_line_sites: tuple[str, ...]
    tool_sites: tuple[str, ...]
    finger_geoms: tuple[str, ...]
    outer_geoms: tuple[str, ...]
    inner_geoms: tuple[str, ...]
    torso_geoms: tuple[str, ...]
    column_geoms: tuple[str, ...]


class _Builder:
    """Collects names while bodies are added; one per call of `add_robot`."""

    def __init__(self, spec: Any, config: RobotConfig) -> None:
        self.spec = spec
        self.config = config
        self.arm: ArmConfig = load_arm(config.arm)
        self.joints: list[str] = []
        self.bodies: dict[str, str] = {}
        self.fingertip_sites: list[str] = []
        self.finger_line_sites: list[str] = []
        self.tool_sites: list[str] = []
        self.geoms: dict[str, list[str]] = {role: [] for role in ("finger", "outer", "inner", "torso", "column")}

    def body(self, parent: Any, name: str, part: str, position: Any, quaternion: Any, inertial: BodyConfig) -> Any:
        body = parent.add_body(name=name, pos=np.asarray(position, dtype=float), quat=quaternion, gravcomp=1)
        body.explicitinertial = True
        body.mass = inertial.mass_kg
        body.ipos = inertial.center_of_mass_m
        body.inertia = inertial.inertia_kgm2
        self.bodies[name] = part
        return body

    def joint(
        self, body: Any, name: str, kind: Any, axis: Any, limits: tuple[float, ...] | None, armature: float
    ) -> None:
        joint = body.add_joint(
            name=name, type=kind, axis=axis, armature=armature, frictionloss=self.config.drives.joint_friction
        )
        joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE if limits else mujoco.mjtLimited.mjLIMITED_FALSE
        if limits:
            joint.range = limits
        self.joints.append(name)

    def shapes(self, body: Any, role: str, shapes: Iterable[ShapeConfig]) -> None:
        for i, shape in enumerate(shapes):
            name = f"{body.name}_shape{i}"
            geom = add_shape(body, name, shape.kind, shape.size, shape.position_m, shape.quaternion)
            geom.mass = 0  # the inertia is explicit
            self.geoms[role].append(name)


def add_robot(spec: Any, config: RobotConfig) -> RobotPart:
    """Add the robot at the world's origin to a `mujoco.MjSpec`.

    Returns:
        The names of everything that later stages look up.
    """
    builder = _Builder(spec, config)
    torso = _add_trunk(builder)
    for mount in config.mounts:
        _add_arm(builder, torso, mount)
    actuators = _add_drives(builder)
    return RobotPart(
        config=config,
        joints=tuple(builder.joints),
        actuators=tuple(actuators),
        bodies=builder.bodies,
        fingertip_sites=tuple(builder.fingertip_sites),
        finger_line_sites=tuple(builder.finger_line_sites),
        tool_sites=tuple(builder.tool_sites),
        finger_geoms=tuple(builder.geoms["finger"]),
        outer_geoms=tuple(builder.geoms["outer"]),
        inner_geoms=tuple(builder.geoms["inner"]),
        torso_geoms=tuple(builder.geoms["torso"]),
        column_geoms=tuple(builder.geoms["column"]),
    )


def _add_trunk(builder: _Builder) -> Any:
    """Base, lift and torso; returns the torso's body."""
    config, identity = builder.config, (1, 0, 0, 0)
    base = builder.body(builder.spec.worldbody, BASE_BODY, "mobile_base", (0, 0, 0), identity, config.base.body)
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    builder.joint(base, BASE_JOINTS[0], slide, (1, 0, 0), config.base.range_m, 0)
    builder.joint(base, BASE_JOINTS[1], slide, (0, 1, 0), config.base.range_m, 0)
    builder.joint(base, BASE_JOINTS[2], hinge, (0, 0, 1), None, 0)
    base.add_site(name=BASE_BODY)
    builder.shapes(base, "column", config.base.collisions)
    lift = builder.body(base, LIFT_BODY, "lift", (0, 0, 0), identity, config.lift.body)
    builder.joint(lift, LIFT_JOINT, slide, (0, 0, 1), config.lift.range_m, 0)
    builder.shapes(lift, "column", config.lift.collisions)
    torso = builder.body(lift, TORSO_BODY, "torso", config.torso.position_m, identity, config.torso.body)
    builder.shapes(torso, "torso", config.torso.collisions)
    return torso


def _add_arm(builder: _Builder, torso: Any, mount: MountConfig) -> None:
    arm, parent = builder.arm, torso
    for i, (joint, link) in enumerate(zip(arm.joints, arm.links, strict=True)):
        position, quaternion = np.asarray(joint.position_m), quat_from_rpy(joint.rpy_rad)
        if i == 0:
            position, quaternion = np.asarray(mount.position_m), quat_from_rpy(mount.rpy_rad)
        body = builder.body(parent, f"{mount.side}_{link.name}", link.name, position, quaternion, link.body)
        builder.joint(
            body,
            f"{mount.side}_{joint.name}",
            mujoco.mjtJoint.mjJNT_HINGE,
            (0, 0, 1),
            joint.range_rad,
            builder.config.drives.arm_armature,
        )
        builder.shapes(body, "inner" if i < _OUTER_FROM else "outer", link.collisions)
        parent = body
    hand = builder.body(
        parent,
        f"{mount.side}_panda_hand",
        "panda_hand",
        arm.hand.position_m,
        quat_from_rpy(arm.hand.rpy_rad),
        arm.hand.body,
    )
    builder.shapes(hand, "outer", arm.hand.collisions)
    _add_fingers(builder, hand, mount.side, arm.finger)


def _add_fingers(builder: _Builder, hand: Any, side: str, finger: FingerConfig) -> None:
    tool = f"{side}_tool_center"
    hand.add_site(name=tool, pos=np.asarray(finger.position_m) + np.asarray(finger.pad_m))
    builder.tool_sites.append(tool)
    for number, name in ((1, "leftfinger"), (2, "rightfinger")):
        turn = np.array((1.0, 0, 0, 0)) if number == 1 else _HALF_TURN_Z
        body = builder.body(hand, f"{side}_panda_{name}", "panda_finger", finger.position_m, turn, finger.body)
        builder.joint(
            body,
            f"{side}_panda_finger_joint{number}",
            mujoco.mjtJoint.mjJNT_SLIDE,
            (0, 1, 0),
            finger.range_m,
            builder.config.drives.finger_armature,
        )
        builder.shapes(body, "finger", finger.collisions)
        for label, position, names in (
            ("tip", finger.tip_m, builder.fingertip_sites),
            ("line_start", finger.line_start_m, builder.finger_line_sites),
        ):
            site = f"{side}_panda_{name}_{label}"
            body.add_site(name=site, pos=position)
            names.append(site)


def _add_drives(builder: _Builder) -> list[str]:
    drives = builder.config.drives
    for i, name in enumerate(BASE_JOINTS):
        gear = np.zeros(6)
        gear[(0, 1, 5)[i]] = 1
        _velocity_drive(builder, name, BASE_BODY, mujoco.mjtTrn.mjTRN_SITE, drives.base_damping, None, gear)
    joint = mujoco.mjtTrn.mjTRN_JOINT
    _velocity_drive(builder, LIFT_JOINT, LIFT_JOINT, joint, drives.lift_damping, None)
    for mount in builder.config.mounts:
        for spec in builder.arm.joints:
            name = f"{mount.side}_{spec.name}"
            _velocity_drive(builder, name, name, joint, drives.arm_damping, spec.effort_nm)
        for number in (1, 2):
            _finger_servo(builder, f"{mount.side}_panda_finger_joint{number}")
    return list(builder.joints)


def _velocity_drive(
    builder: _Builder,
    name: str,
    target: str,
    transmission: Any,
    damping: float,
    effort: float | None,
    gear: np.ndarray | None = None,
) -> None:
    """Force = damping * (filtered control - velocity), as the paper's drives with stiffness 0."""
    actuator = builder.spec.add_actuator(name=name, target=target, trntype=transmission)
    actuator.set_to_velocity(kv=damping)
    actuator.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
    actuator.dynprm[0] = 1.0 / (2 * math.pi * builder.config.drives.filter_cutoff_hz)
    if gear is not None:
        actuator.gear = gear
    _limit_force(actuator, effort)


def _finger_servo(builder: _Builder, name: str) -> None:
    drives, finger = builder.config.drives, builder.arm.finger
    actuator = builder.spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    actuator.set_to_position(kp=drives.finger_stiffness, kv=drives.finger_damping)
    _limit_force(actuator, finger.effort_n)


def _limit_force(actuator: Any, effort: float | None) -> None:
    if effort is not None:
        actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        actuator.forcerange = (-effort, effort)
