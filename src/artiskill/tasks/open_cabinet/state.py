"""The `state` observation of the cabinet tasks."""

import numpy as np

from artiskill.errors import AssetError
from artiskill.geometry.arrays import Array, namespace
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.fields import ObservationField, object_fields, robot_fields, robot_values
from artiskill.tasks.open_cabinet.goal import OpenGoal


def state_fields(max_joints: int, arms: int) -> tuple[ObservationField, ...]:
    """What the numbers of the state vector are, in order."""
    target = ObservationField("target joint, one-hot", max_joints, 1.0, "1")
    return (*object_fields(max_joints), target, *robot_fields(arms))


def observe_cabinet_state(snapshot: Snapshot, goal: OpenGoal, max_joints: int) -> Array:
    """The state vector, (B, D) float32: object, target, robot; see `state_fields`.

    Raises:
        AssetError: the object has more joints than the vector has slots.
    """
    xp = namespace(snapshot.object_qpos)
    batch, joints = snapshot.object_qpos.shape
    if joints > max_joints:
        raise AssetError(
            f"an object with {joints} joints does not fit a state vector with max_object_joints = {max_joints}; "
            "raise that value in the task's config"
        )
    dtype = snapshot.object_qpos.dtype
    slots = xp.arange(max_joints)[None, :]
    padding = xp.zeros((batch, max_joints - joints), dtype=dtype)
    still = xp.zeros((batch, 6), dtype=dtype)  # a cabinet's root stands still
    values = [
        snapshot.link_position_w[:, 0],
        snapshot.link_quaternion_w[:, 0],
        still,
        snapshot.object_qpos,
        padding,
        snapshot.object_qvel,
        padding,
        xp.astype(slots == goal.joint[:, None], dtype),
        *robot_values(snapshot),
    ]
    return xp.astype(xp.concat(values, axis=-1), np.float32 if xp is np else xp.float32)
