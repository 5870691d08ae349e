"""Every handle can be gripped by the real gripper, or hooked, and is within the arm's reach."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Handle
from artiskill.assets.kinematics import joint_values, link_poses
from artiskill.checks.config import GripConfig
from artiskill.checks.context import CheckContext, CheckResult, at_most, collide, failed, fine
from artiskill.geometry.meshes import depth_inside
from artiskill.geometry.rotations import (
    quat_conjugate,
    quat_from_axis_angle,
    quat_from_matrix,
    quat_multiply,
    quat_rotate,
    quat_to_matrix,
    transform_points,
)
from artiskill.robots.arm_config import ArmConfig, ShapeConfig, load_arm
from artiskill.robots.config import load_robot
from artiskill.robots.model import add_shape
from artiskill.scene.object_model import object_spec, resolve_object_scene
from artiskill.scene.physics import Group, PhysicsConfig

_GRIPPER = ("gripper/hand", "gripper/finger1", "gripper/finger2")
_GROUND = "the ground"
# Where the wide-open gripper does not fit, into a recess say, each pad starts this far beside the handle.
_CLEARANCE_M = 0.018
# where a hook is tried: leaning of the fingers out of the panel's plane, places along the handle (shares of its
# half length), how far the tips reach in behind it, and how finely the space behind it is searched
_LEANS_RAD = np.radians((0.0, 15.0, 25.0, 40.0, 60.0))
_PLACES = (0.0, 0.5, -0.5)
_ENGAGEMENTS_M = (0.010, 0.020, 0.035)
_LEVEL_M = 0.002
_PULL_STEP_M = 0.002


def check_handles(context: CheckContext) -> list[CheckResult]:
    """Check each handle: it can be gripped or, where it says so, hooked.

    Gripped: in one of the handle's grasp poses the open gripper is free, and when its fingers close, both pads
    meet the handle. Hooked: the tips of the closed fingers fit behind it from some side, and the handle stops them
    when they are pulled away. The object is at rest, the ground is there. The bail of a bucket, which lies against
    its wall at rest, may be taken half way up instead.
    """
    obj = context.object
    if not obj.handles:
        return [fine("object", "it has no handles")]
    probe = GripperProbe(obj, load_arm(load_robot(context.config.grip.robot).arm))
    states = [(context.rest, "")]
    if obj.category == "bucket" and context.joints:
        states.append((joint_values(obj, 0.5), ", half way up"))
    found: dict[str, CheckResult] = {}
    for qpos, when in states:
        probe.set_joints(qpos)
        for placed in _placed_handles(obj, qpos):
            if placed.name not in found or not found[placed.name].passed:
                found[placed.name] = _judge(probe, placed, context.config.grip, when)
    return list(found.values())


def check_reach(context: CheckContext) -> list[CheckResult]:
    """Check how far the arm's first joint is from the handle hardest to reach, the lift at its best height."""
    obj, grip = context.object, context.config.grip
    if not obj.handles:
        return [fine("object", "it has no handles")]
    robot = load_robot(grip.robot)
    mount = robot.torso.position_m[2] + robot.mounts[0].position_m[2]
    low, high = (mount + lift for lift in robot.lift.range_m)
    results = []
    for placed in _placed_handles(obj, context.rest):
        height = float(placed.grasps[0][0][2])
        distance = float(np.hypot(max(low - height, height - high, 0.0), grip.stand_off_m))
        note = f"{height:.2f} m above the ground, {grip.stand_off_m:g} m in front of it"
        results.append(at_most(placed.name, distance, grip.reach_m, "m", note))
    return [max(results, key=lambda result: result.value or 0.0)]


@dataclass(frozen=True, eq=False)
class Contact:
    """One contact of the gripper.

    Attributes:
        finger: 1 or 2; 0 for the hand.
        link: name of the object's link, or of the ground.
        depth_m: how far the two shapes are in one another.
        position: (3,) m, in the object frame.
    """

    finger: int
    link: str
    depth_m: float
    position: np.ndarray


@dataclass(frozen=True, eq=False)
class PlacedHandle:
    """A handle in the object frame.

    Attributes:
        name: the link's and what the handle is; numbered where that is not enough.
        handle: in its link's frame.
        position: (3,) of the link.
        quaternion: (4,) of the link.
    """

    name: str
    handle: Handle
    position: np.ndarray
    quaternion: np.ndarray

    @property
    def grasps(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Position between the pads and orientation of the hand, of each grasp pose."""
        handle = self.handle
        positions = transform_points(self.position, self.quaternion, handle.grasp_positions)
        quaternions = quat_multiply(self.quaternion, handle.grasp_quaternions)
        return list(zip(positions, quaternions, strict=True))

    def is_met(self, contact: Contact, near_m: float) -> bool:
        """Return whether a contact is one with the handle: with its link, inside of its hull or nearly so."""
        local = quat_rotate(quat_conjugate(self.quaternion), contact.position - self.position)
        return contact.link == self.handle.link and bool(
            depth_inside(self.handle.planes, local[None])[0] > -near_m
        )


def _placed_handles(obj: ArticulatedObject, qpos: np.ndarray) -> list[PlacedHandle]:
    positions, quaternions = link_poses(obj, qpos)
    placed = []
    for k, handle in enumerate(obj.handles):
        same = [j for j, h in enumerate(obj.handles) if (h.link, h.kind) == (handle.link, handle.kind)]
        number = f" {1 + same.index(k)}" if len(same) > 1 else ""
        link = obj.link_index(handle.link)
        name = f"{handle.link} {handle.kind}{number}"
        placed.append(PlacedHandle(name, handle, positions[link], quaternions[link]))
    return placed


class GripperProbe:
    """An object on the ground, at rest at first, and a hand with two fingers that can be put anywhere."""

    def __init__(self, obj: ArticulatedObject, arm: ArmConfig) -> None:
        """Compile the model.

        Raises:
            ValueError: the engine refuses the object.
        """
        spec, part = object_spec(obj, PhysicsConfig(), hold=True)
        _add_gripper(spec, arm)
        self._scene = scene = resolve_object_scene(spec.compile(), obj, part)
        self._model, self._data = scene.model, scene.rest_data()
        self._pad_m = arm.finger.position_m[2] + arm.finger.pad_m[2]
        # from between the pads to the fingers' ends
        self.tip_m = arm.finger.position_m[2] + arm.finger.tip_m[2] - self._pad_m
        names = {int(body): link.name for body, link in zip(scene.bodies, obj.links, strict=True)}
        parts = {self._model.body(name).id: k for k, name in enumerate(_GRIPPER)}
        bodies = self._model.geom_bodyid.tolist()
        self._links = [names.get(body, _GROUND) for body in bodies]
        self._parts: list[int | None] = [parts.get(body) for body in bodies]

    def set_joints(self, qpos: np.ndarray) -> None:
        """Set the object's joint values, (J,)."""
        self._data.qpos[self._scene.qpos] = qpos

    def contacts(self, position: np.ndarray, quaternion: np.ndarray, opening_m: float) -> list[Contact]:
        """Return all contacts of the gripper with object and ground.

        Args:
            position: (3,) of the point between the pads, in the object frame.
            quaternion: (4,) of the hand: z from wrist to tips, the fingers open along y.
            opening_m: of each finger, from the middle.
        """
        data = self._data
        data.qpos[-9:-6] = position - quat_rotate(quaternion, np.array((0.0, 0.0, self._pad_m)))
        data.qpos[-6:-2] = quaternion
        data.qpos[-2:] = opening_m
        collide(self._model, data)
        found = []
        for k, (first, second) in enumerate(data.contact.geom.tolist()):
            if self._parts[first] is None:
                first, second = second, first
            part = self._parts[first]
            if part is not None and data.contact.dist[k] < 0:
                depth = -float(data.contact.dist[k])
                found.append(Contact(part, self._links[second], depth, data.contact.pos[k].copy()))
        return found


def _add_gripper(spec: Any, arm: ArmConfig) -> None:
    hand = spec.worldbody.add_body(name=_GRIPPER[0])
    hand.add_freejoint()
    _add_shapes(hand, arm.hand.collisions)
    turns = (np.array((1.0, 0.0, 0.0, 0.0)), quat_from_axis_angle((0, 0, 1), np.pi))
    for name, turn in zip(_GRIPPER[1:], turns, strict=True):
        finger = hand.add_body(name=name, pos=arm.finger.position_m, quat=turn)
        finger.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 1, 0))
        _add_shapes(finger, arm.finger.collisions)


def _add_shapes(body: Any, shapes: tuple[ShapeConfig, ...]) -> None:
    for i, shape in enumerate(shapes):
        name = f"{body.name}_{i}"
        geom = add_shape(body, name, shape.kind, shape.size, shape.position_m, shape.quaternion)
        geom.contype, geom.conaffinity = int(Group.ROBOT), int(Group.OBJECT | Group.GROUND)


def _judge(probe: GripperProbe, placed: PlacedHandle, config: GripConfig, when: str) -> CheckResult:
    """Try all grasp poses, first with the gripper wide open, then the hook."""
    narrow = min(config.opening_m, placed.handle.grasp_width_m / 2 + _CLEARANCE_M)
    attempts = [
        _try_grasp(probe, placed, config, pose, opening)
        for opening in (config.opening_m, narrow)
        for pose in placed.grasps
    ]
    best = min(attempts, key=lambda attempt: (not attempt.gripped, attempt.depth_m))
    if best.gripped:
        note = f"gripped {1e3 * best.width_m:.0f} mm wide{when}"
        return at_most(placed.name, 1e3 * best.depth_m, 1e3 * config.penetration_m, "mm", note)
    problem = f"not gripped: {best.problem}"
    if not placed.handle.hookable:
        return failed(placed.name, f"{problem}{when}; it does not say that it can be hooked")
    side = _try_hook(probe, placed, config)
    if side:
        return fine(placed.name, f"hooked from {side}{when}; {problem}")
    return failed(placed.name, f"{problem}{when}; not hooked: no place behind it from any side")


@dataclass(frozen=True)
class GraspAttempt:
    """Outcome of one grasp pose.

    Attributes:
        depth_m: how deep the open gripper is in something.
        problem: what was in the way; empty if both pads met the handle.
        width_m: distance of the pads where they met it.
    """

    depth_m: float
    problem: str
    width_m: float = 0.0

    @property
    def gripped(self) -> bool:
        """Whether both pads met the handle."""
        return not self.problem


def _try_grasp(
    probe: GripperProbe,
    placed: PlacedHandle,
    config: GripConfig,
    pose: tuple[np.ndarray, np.ndarray],
    open_m: float,
) -> GraspAttempt:
    worst = max(probe.contacts(*pose, open_m), key=lambda contact: contact.depth_m, default=None)
    depth = 0.0 if worst is None else worst.depth_m
    if worst is not None and depth > config.penetration_m:
        return GraspAttempt(depth, f"the open gripper runs {1e3 * depth:.0f} mm into {worst.link}")
    met: dict[int, float] = {}
    for opening in np.arange(open_m, -config.step_m / 2, -config.step_m):
        for contact in probe.contacts(*pose, max(float(opening), 0.0)):
            if contact.finger and contact.finger not in met:
                if not placed.is_met(contact, config.near_handle_m):
                    return GraspAttempt(depth, f"a closing finger meets {contact.link} beside the handle")
                met[contact.finger] = float(opening)
        if len(met) == 2:
            return GraspAttempt(depth, "", sum(met.values()))
    return GraspAttempt(depth, f"{2 - len(met)} of 2 pads close without meeting it")


def _try_hook(probe: GripperProbe, placed: PlacedHandle, config: GripConfig) -> str:
    """Return from where closed fingers can hook the handle, or nothing."""
    outward = -quat_to_matrix(placed.grasps[0][1])[:, 2]
    for side, position, quaternion in _hook_poses(probe, placed, outward):
        contacts = probe.contacts(position, quaternion, 0.0)
        if all(contact.depth_m <= config.penetration_m for contact in contacts):
            for way in np.arange(_PULL_STEP_M, config.pull_m + _PULL_STEP_M / 2, _PULL_STEP_M):
                contacts = probe.contacts(position + way * outward, quaternion, 0.0)
                if any(c.finger and placed.is_met(c, config.near_handle_m) for c in contacts):
                    return side
    return ""


def _hook_poses(
    probe: GripperProbe, placed: PlacedHandle, outward: np.ndarray
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield poses of the closed gripper, its tips behind the handle: from which side, position, orientation."""
    frame = quat_to_matrix(placed.grasps[0][1])
    points = transform_points(placed.position, placed.quaternion, placed.handle.points)
    levels = points @ outward
    depths = np.arange(levels.max() - _LEVEL_M, levels.min(), -_LEVEL_M)
    for way in (frame[:, 1], -frame[:, 1], frame[:, 0], -frame[:, 0]):
        beside = np.cross(way, outward)
        near, reach = float((points @ way).min()), points @ beside
        middle, half = (reach.max() + reach.min()) / 2, (reach.max() - reach.min()) / 2
        for lean in _LEANS_RAD:
            towards = np.cos(lean) * way - np.sin(lean) * outward
            turn = quat_from_matrix(np.stack((np.cross(beside, towards), beside, towards), axis=1))
            for depth in depths:
                for place in _PLACES:
                    for engagement in _ENGAGEMENTS_M:
                        tip = (near + engagement) * way + depth * outward + (middle + place * half) * beside
                        yield _side(way), tip - probe.tip_m * towards, turn


def _side(way: np.ndarray) -> str:
    """Return where fingers that point this way come from."""
    axis = int(np.argmax(np.abs(way)))
    sides = (("front", "behind"), ("the right", "the left"), ("below", "above"))
    return sides[axis][int(way[axis] < 0)]
