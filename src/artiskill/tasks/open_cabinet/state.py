"""The `state` observation of the cabinet tasks."""

from artiskill.geometry.arrays import Array, namespace
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.fields import (
    ObservationField,
    object_fields,
    object_size,
    robot_fields,
    robot_size,
    write_object,
    write_robot,
)
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
    target = object_size(max_joints)
    robot = target + max_joints
    values = xp.zeros((snapshot.object_qpos.shape[0], robot + robot_size(snapshot)), dtype=xp.float32)
    write_object(snapshot, max_joints, values[:, :target])
    values[goal.row, target + goal.joint] = 1.0
    write_robot(snapshot, values[:, robot:])
    return values
