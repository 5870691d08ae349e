"""The state vector: what its numbers are, and how they are read from snapshots.

The paper's has the object's root and joints, numbers of the task, and the robot, in the world's frame. Tasks can
have others: `along_base_axes` helps to say what the robot's base sees.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from artiskill.errors import AssetError
from artiskill.geometry.arrays import Array, namespace
from artiskill.sim.snapshot import Snapshot

# Values are clipped to their field's bounds, so that spaces are finite. Nothing in a sane episode reaches them:
# the base's range is 10 m, and drives turn no joint faster than 3.14 rad/s.
FAR_M, FAST, _ANGLE_RAD = 20.0, 100.0, 100.0  # FAST: m/s and rad/s
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
    return (
        ObservationField("fingertip positions, world frame", 6 * arms, FAR_M, "m"),
        ObservationField("fingertip velocities, world frame", 6 * arms, FAST, "m/s"),
        ObservationField("base position x, y", 2, FAR_M, "m"),
        ObservationField("base yaw", 1, _ANGLE_RAD, "rad"),
        ObservationField("base velocity x, y, world frame", 2, FAST, "m/s"),
        ObservationField("base yaw rate", 1, FAST, "rad/s"),
        *joint_fields(arms),
    )


def joint_fields(arms: int) -> tuple[ObservationField, ...]:
    """Return the part of the robot's joints above its base."""
    joints = 1 + 9 * arms
    return (
        ObservationField("lift, arm and finger positions", joints, _ANGLE_RAD, "m, rad"),
        ObservationField("lift, arm and finger velocities", joints, FAST, "m/s, rad/s"),
    )


def object_fields(max_joints: int) -> tuple[ObservationField, ...]:
    """Return the object's part: its root, then its joints padded with zeros to a fixed number."""
    return (
        ObservationField("object root position, world frame", 3, FAR_M, "m"),
        ObservationField("object root orientation (w, x, y, z)", 4, 1.0, "1"),
        ObservationField("object root linear velocity, world frame", 3, FAST, "m/s"),
        ObservationField("object root angular velocity, world frame", 3, FAST, "rad/s"),
        ObservationField("object joint positions", max_joints, _ANGLE_RAD, "m, rad"),
        ObservationField("object joint velocities", max_joints, FAST, "m/s, rad/s"),
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
    joints = snapshot.object_qpos.shape[1]
    if joints > max_joints and (own := int(snapshot.object_joints.max())) > max_joints:
        raise AssetError(
            f"an object with {own} joints does not fit a state vector with max_object_joints = {max_joints}; "
            "raise that value in the task's config"
        )
    joints = min(joints, max_joints)  # a layout may have room for more
    xp, qpos = namespace(snapshot.object_qpos), snapshot.object_qpos
    zeros = xp.zeros((qpos.shape[0], max_joints + extra_size), dtype=qpos.dtype, device=qpos.device)
    free = max_joints - joints
    values = (
        snapshot.link_position_w[:, 0],
        snapshot.link_quaternion_w[:, 0],
        snapshot.root_velocity_w,
        snapshot.object_qpos[:, :joints],
        zeros[:, :free],
        snapshot.object_qvel[:, :joints],
        zeros[:, : free + extra_size],
        *_robot_values(snapshot),
    )
    return side_by_side(values)


def base_position(snapshot: Snapshot) -> Array:
    """Return where the robot's base stands on the ground, (B, 3) in the world."""
    xp, qpos = namespace(snapshot.robot_qpos), snapshot.robot_qpos
    return xp.concat((qpos[:, :2], xp.zeros_like(qpos[:, :1])), axis=1)


def along_base_axes(snapshot: Snapshot, vectors_w: Array) -> Array:
    """Return the components (B, 3 V) of vectors (B, V, 3) along the axes of the robot's base, vector by vector."""
    xp, yaw = namespace(vectors_w), snapshot.robot_qpos[:, 2, None]
    cosine, sine = xp.cos(yaw), xp.sin(yaw)
    x, y = vectors_w[:, :, 0], vectors_w[:, :, 1]
    turned = xp.stack((cosine * x + sine * y, cosine * y - sine * x, vectors_w[:, :, 2]), axis=2)
    return xp.reshape(turned, (-1, 3 * vectors_w.shape[1]))


def observe_robot(snapshot: Snapshot, row: int) -> Array:
    """Return the numbers of `robot_fields` alone, of one environment: (1, D) float32."""
    return side_by_side(_robot_values(snapshot, slice(row, row + 1)))


def _robot_values(snapshot: Snapshot, rows: slice = slice(None)) -> tuple[Array, ...]:
    """Return the numbers of `robot_fields`, (B, n) each, of all environments or of some rows."""
    qpos, qvel, tips = snapshot.robot_qpos[rows], snapshot.robot_qvel[rows], snapshot.fingertip_velocity_w.shape[1]
    return (
        snapshot.fingertip_position_w[rows].reshape(-1, 3 * tips),
        snapshot.fingertip_velocity_w[rows].reshape(-1, 3 * tips),
        qpos[:, :3],
        qvel[:, :3],
        qpos[:, 3:],
        qvel[:, 3:],
    )


def side_by_side(values: Sequence[Array]) -> Array:
    """Return arrays (B, n) side by side, in single precision: one call, as a dozen take three times as long."""
    xp = namespace(values[0])
    if xp is np:
        return np.concatenate(values, axis=1, dtype=np.float32, casting="same_kind")
    return xp.astype(xp.concat(values, axis=1), xp.float32)
