"""The real gripper beside an object: where hand and fingers, placed anywhere, run into object or ground."""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.geometry.rotations import quat_from_axis_angle, quat_from_rpy, quat_rotate
from artiskill.robots.arm_config import ArmConfig, ShapeConfig
from artiskill.robots.shapes import add_shape
from artiskill.scene.object_scene import object_spec, resolve_object_scene
from artiskill.scene.options import Group
from artiskill.scene.physics import PhysicsConfig

HAND, FINGERS = 0, (1, 2)
_GROUND = -1
_NAMES = ("gripper/hand", "gripper/finger1", "gripper/finger2")


@dataclass(frozen=True, eq=False)
class Touch:
    """One contact of the gripper.

    Attributes:
        part: `HAND` or one of `FINGERS`.
        link: index of the object's link, -1 for the ground.
        depth_m: how far the two shapes are in one another.
        position: (3,) m, in the object frame.
    """

    part: int
    link: int
    depth_m: float
    position: np.ndarray


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
        self._tip_m = arm.finger.position_m[2] + arm.finger.tip_m[2]
        self._pad_m = arm.finger.position_m[2] + arm.finger.pad_m[2]
        link_of_body = {int(body): i for i, body in enumerate(scene.bodies)}
        part_of_body = {self._model.body(name).id: k for k, name in enumerate(_NAMES)}
        bodies = self._model.geom_bodyid.tolist()
        self._links = [link_of_body.get(body, _GROUND) for body in bodies]
        self._parts: list[int | None] = [part_of_body.get(body) for body in bodies]

    def set_joints(self, qpos: np.ndarray) -> None:
        """Put the object's joints elsewhere, (J,)."""
        self._data.qpos[self._scene.qpos] = qpos

    @property
    def tip_m(self) -> float:
        """From between the pads to the fingers' ends."""
        return self._tip_m - self._pad_m

    def touches(self, position: np.ndarray, quaternion: np.ndarray, opening_m: float) -> list[Touch]:
        """All contacts of the gripper with object and ground.

        Args:
            position: (3,) of the point between the pads, in the object frame.
            quaternion: (4,) of the hand: z from wrist to tips, the fingers open along y.
            opening_m: of each finger, from the middle.
        """
        model, data = self._model, self._data
        data.qpos[-9:-6] = position - quat_rotate(quaternion, np.array((0.0, 0.0, self._pad_m)))
        data.qpos[-6:-2] = quaternion
        data.qpos[-2:] = opening_m
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        return self._found()

    def _found(self) -> list[Touch]:
        contact: Any = self._data.contact
        found = []
        for k, (first, second) in enumerate(contact.geom.tolist()):
            if self._parts[first] is None:
                first, second = second, first
            part = self._parts[first]
            if part is not None and contact.dist[k] < 0:
                found.append(Touch(part, self._links[second], -float(contact.dist[k]), contact.pos[k].copy()))
        return found


def _add_gripper(spec: Any, arm: ArmConfig) -> None:
    hand = spec.worldbody.add_body(name=_NAMES[HAND])
    hand.add_freejoint()
    _add_shapes(hand, arm.hand.collisions)
    turns = (np.array((1.0, 0.0, 0.0, 0.0)), quat_from_axis_angle((0, 0, 1), np.pi))
    for name, turn in zip(_NAMES[1:], turns, strict=True):
        finger = hand.add_body(name=name, pos=arm.finger.position_m, quat=turn)
        finger.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 1, 0))
        _add_shapes(finger, arm.finger.collisions)


def _add_shapes(body: Any, shapes: tuple[ShapeConfig, ...]) -> None:
    for i, shape in enumerate(shapes):
        quaternion = quat_from_rpy(shape.rpy_rad)
        geom = add_shape(body, f"{body.name}_{i}", shape.kind, shape.size, shape.position_m, quaternion)
        geom.contype, geom.conaffinity = int(Group.ROBOT), int(Group.OBJECT | Group.GROUND)
