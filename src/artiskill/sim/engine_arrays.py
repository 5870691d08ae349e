"""The engine's arrays of a batch: where the object is in them, and how they become a `Snapshot`."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.geometry.arrays import rotate
from artiskill.scene.scene import Scene
from artiskill.sim.snapshot import Snapshot


@dataclass(frozen=True)
class Places:
    """The object's places in the engine's arrays, those that pad it included; alike in all scenes of a layout.

    Attributes:
        links: in body arrays.
        joints: in joint arrays.
        qpos: of the joints, in qpos.
        dof: of the joints, in qvel.
    """

    links: slice
    joints: slice
    qpos: slice
    dof: slice


def places_of(scene: Scene) -> Places:
    """The places of a scene's layout."""
    index, layout = scene.index, scene.layout
    has_root = index.root_dof.stop > index.root_dof.start  # one free joint, between the robot's and these
    return Places(
        links=run(index.object_bodies.start, layout.links),
        joints=run(index.robot.stop + has_root, layout.joints),
        qpos=run(index.object_qpos.start, layout.joints),
        dof=run(index.object_dof.start, layout.joints),
    )


def run(start: int, count: int) -> slice:
    """So many from a start on."""
    return slice(start, start + count)


class EngineArrays:
    """Live views of a `mujoco.batch.Batch`, made once; each has the batch dimension first."""

    def __init__(self, batch: Any) -> None:
        bind = batch.bind
        self.qpos, self.qvel, self.ctrl, self.time = bind("qpos"), bind("qvel"), bind("ctrl"), bind("time")
        self.xpos, self.xquat, self.xmat = bind("xpos"), bind("xquat"), bind("xmat")
        self.anchor, self.axis, self.sensors = bind("xanchor"), bind("xaxis"), bind("sensordata")

    def snapshot(
        self, scene: Scene, places: Places, own_joints: np.ndarray, previous: tuple[np.ndarray, np.ndarray]
    ) -> Snapshot:
        """What is true now; the arrays are copies.

        Args:
            scene: of any of the environments.
            places: of its layout.
            own_joints: (B, J) 1 where a place is a joint of the object, else 0.
            previous: positions (B, L, 3) and quaternions (B, L, 4) of the links one step ago.
        """
        index, batch = scene.index, len(own_joints)
        qpos, qvel, sensors = self.qpos.copy(), self.qvel.copy(), self.sensors.copy()
        position, quaternion = self.xpos.copy(), self.xquat.copy()
        rotation = self.xmat[:, places.links].copy().reshape(batch, -1, 3, 3)
        tool_axes = sensors[:, index.tool_axes].reshape(batch, -1, 3, 3)
        return Snapshot(
            time_s=self.time.copy(),
            step_s=scene.physics.step_s,
            robot_qpos=qpos[:, index.robot],
            robot_qvel=qvel[:, index.robot],
            robot_joint_anchor_w=self.anchor[:, index.robot].copy(),
            robot_joint_axis_w=self.axis[:, index.robot].copy(),
            finger_line_w=sensors[:, index.finger_lines].reshape(batch, -1, 2, 3),
            fingertip_velocity_w=sensors[:, index.fingertip_velocities].reshape(batch, -1, 3),
            tool_position_w=sensors[:, index.tool_positions].reshape(batch, -1, 3),
            tool_rotation_w=tool_axes.swapaxes(-1, -2),
            object_joints=own_joints.sum(axis=1).astype(np.int64),
            object_qpos=qpos[:, places.qpos] * own_joints,
            object_qvel=qvel[:, places.dof] * own_joints,
            root_velocity_w=_root_velocity(qvel[:, index.root_dof], rotation[:, 0]),
            prop_position_w=qpos[:, index.prop_qpos].reshape(batch, -1, 7)[..., :3],
            prop_velocity_w=qvel[:, index.prop_dof].reshape(batch, -1, 6)[..., :3],
            link_position_w=position[:, places.links],
            link_quaternion_w=quaternion[:, places.links],
            link_rotation_w=rotation,
            previous_link_position_w=previous[0].copy(),
            previous_link_quaternion_w=previous[1].copy(),
            body_position_w=position,
            body_quaternion_w=quaternion,
        )


def _root_velocity(qvel: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """(B, 6) world-frame velocity from that of a free joint, whose angular part is in the body's own frame."""
    if not qvel.shape[1]:
        return np.zeros((len(qvel), 6))
    qvel[:, 3:] = rotate(rotation, qvel[:, 3:])
    return qvel
