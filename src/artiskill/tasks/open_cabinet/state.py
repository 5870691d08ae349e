"""The `state` observation of the cabinet tasks."""

from artiskill.errors import AssetError
from artiskill.geometry.arrays import Array, namespace
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.fields import ObservationField, object_fields, robot_fields, robot_size, write_robot
from artiskill.tasks.open_cabinet.goal import OpenGoal

_ROOT_SIZE = 13  # position, orientation, linear and angular velocity


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
    size = _ROOT_SIZE + 3 * max_joints
    values = xp.zeros((batch, size + robot_size(snapshot)), dtype=xp.float32)
    values[:, 0:3] = snapshot.link_position_w[:, 0]
    values[:, 3:7] = snapshot.link_quaternion_w[
        :, 0
    ]  # then its velocities, which are 0: a cabinet's root stands still
    values[:, _ROOT_SIZE : _ROOT_SIZE + joints] = snapshot.object_qpos
    values[:, _ROOT_SIZE + max_joints : _ROOT_SIZE + max_joints + joints] = snapshot.object_qvel
    values[goal.row, _ROOT_SIZE + 2 * max_joints + goal.joint] = 1.0
    write_robot(snapshot, values[:, size:])
    return values
