"""The `state` observation: a vector of the object, what is the task's own, and the robot, as a table of fields."""

from dataclasses import dataclass

import numpy as np

from artiskill.errors import AssetError
from artiskill.geometry.arrays import Array, namespace
from artiskill.sim.snapshot import Snapshot

# Values are clipped to their field's bounds, so that spaces are finite. Nothing in a sane episode reaches them:
# the base's range is 10 m, and drives turn no joint faster than 3.14 rad/s.
_FAR_M, _FAST, _ANGLE_RAD = 20.0, 100.0, 100.0
_ROOT_SIZE = 13  # position, orientation, linear and angular velocity


@dataclass(frozen=True)
class ObservationField:
    """A run of numbers in the state vector.

    Attributes:
        name: what it is.
        size: how many numbers.
        bound: they lie in [-bound, bound].
        unit: of each.
    """

    name: str
    size: int
    bound: float
    unit: str


def state_fields(
    max_joints: int, arms: int, extra: tuple[ObservationField, ...] = ()
) -> tuple[ObservationField, ...]:
    """Return what the numbers of the state vector are, in order; `extra` are the task's own."""
    return (*object_fields(max_joints), *extra, *robot_fields(arms))


def robot_fields(arms: int) -> tuple[ObservationField, ...]:
    """Return the robot's part: 38 numbers for one arm, 68 for two (arm joints are those of a Panda)."""
    joints = 1 + 9 * arms
    return (
        ObservationField("fingertip positions, world frame", 6 * arms, _FAR_M, "m"),
        ObservationField("fingertip velocities, world frame", 6 * arms, _FAST, "m/s"),
        ObservationField("base position x, y", 2, _FAR_M, "m"),
        ObservationField("base yaw", 1, _ANGLE_RAD, "rad"),
        ObservationField("base velocity x, y, world frame", 2, _FAST, "m/s"),
        ObservationField("base yaw rate", 1, _FAST, "rad/s"),
        ObservationField("lift, arm and finger positions", joints, _ANGLE_RAD, "m, rad"),
        ObservationField("lift, arm and finger velocities", joints, _FAST, "m/s, rad/s"),
    )


def object_fields(max_joints: int) -> tuple[ObservationField, ...]:
    """Return the object's part: its root, then its joints padded with zeros to a fixed number."""
    return (
        ObservationField("object root position, world frame", 3, _FAR_M, "m"),
        ObservationField("object root orientation (w, x, y, z)", 4, 1.0, "1"),
        ObservationField("object root linear velocity, world frame", 3, _FAST, "m/s"),
        ObservationField("object root angular velocity, world frame", 3, _FAST, "rad/s"),
        ObservationField("object joint positions", max_joints, _ANGLE_RAD, "m, rad"),
        ObservationField("object joint velocities", max_joints, _FAST, "m/s, rad/s"),
    )


def field_bounds(fields: tuple[ObservationField, ...]) -> np.ndarray:
    """Return the largest absolute value of each number, (D,) float32."""
    return np.concatenate([np.full(f.size, f.bound, dtype=np.float32) for f in fields])


def object_size(max_joints: int) -> int:
    """Return how many numbers `object_fields` has."""
    return _ROOT_SIZE + 2 * max_joints


def observe_state(snapshot: Snapshot, max_joints: int, extra_size: int = 0) -> Array:
    """Return the state vector, (B, D) float32, as `state_fields` has it; the task's own numbers are still zero.

    Raises:
        AssetError: the object has more joints than the vector has slots.
    """
    xp = namespace(snapshot.object_qpos)
    robot = object_size(max_joints) + extra_size
    values = xp.zeros((snapshot.object_qpos.shape[0], robot + _robot_size(snapshot)), dtype=xp.float32)
    _write_object(snapshot, max_joints, values)
    _write_robot(snapshot, values[:, robot:])
    return values


def observe_robot(snapshot: Snapshot, row: int) -> Array:
    """Return the numbers of `robot_fields` alone, of one environment: (1, D) float32."""
    xp = namespace(snapshot.robot_qpos)
    values = xp.zeros((1, _robot_size(snapshot)), dtype=xp.float32)
    _write_robot(snapshot, values, slice(row, row + 1))
    return values


def _write_object(snapshot: Snapshot, max_joints: int, out: Array) -> None:
    """Write the numbers of `object_fields` into the first columns of `out`, (B, D), which are zero so far."""
    joints = snapshot.object_qpos.shape[1]
    if joints > max_joints and (own := int(snapshot.object_joints.max())) > max_joints:
        raise AssetError(
            f"an object with {own} joints does not fit a state vector with max_object_joints = {max_joints}; "
            "raise that value in the task's config"
        )
    joints = min(joints, max_joints)  # a layout may have room for more
    out[:, 0:3] = snapshot.link_position_w[:, 0]
    out[:, 3:7] = snapshot.link_quaternion_w[:, 0]
    out[:, 7:_ROOT_SIZE] = snapshot.root_velocity_w
    out[:, _ROOT_SIZE : _ROOT_SIZE + joints] = snapshot.object_qpos[:, :joints]
    out[:, _ROOT_SIZE + max_joints : _ROOT_SIZE + max_joints + joints] = snapshot.object_qvel[:, :joints]


def _robot_size(snapshot: Snapshot) -> int:
    fingertips, joints = snapshot.fingertip_velocity_w.shape[1], snapshot.robot_qpos.shape[1]
    return 6 * fingertips + 2 * joints


def _write_robot(snapshot: Snapshot, out: Array, rows: slice = slice(None)) -> None:
    """Write the numbers of `robot_fields` into `out`, of all environments or of some rows."""
    xp = namespace(out)
    batch, tips = out.shape[0], snapshot.fingertip_velocity_w.shape[1]
    values = (
        xp.reshape(snapshot.fingertip_position_w[rows], (batch, 3 * tips)),
        xp.reshape(snapshot.fingertip_velocity_w[rows], (batch, 3 * tips)),
        snapshot.robot_qpos[rows, :3],
        snapshot.robot_qvel[rows, :3],
        snapshot.robot_qpos[rows, 3:],
        snapshot.robot_qvel[rows, 3:],
    )
    start = 0
    for value in values:
        out[:, start : start + value.shape[1]] = value
        start += value.shape[1]
