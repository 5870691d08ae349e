"""What the state may say of a cabinet's handle, so that one policy can open many cabinets.

The state of the paper has joints and a root: enough for an agent of one cabinet, which learns where the handle is.
Of many cabinets these numbers say where the hand shall go, and in which direction it shall pull. They are in the
frame of the robot's base, for what the robot has to do does not depend on where it stands.
"""

from typing import Any

from artiskill.geometry.arrays import Array, namespace, rotate, total
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.task import ObservationField

_FAR_M, _MOST_OPENING = 20.0, 100.0
HANDLE_FIELDS = (
    ObservationField("grasp position, base frame", 3, _FAR_M, "m"),
    ObservationField("from the hand to the grasp position, base frame", 3, _FAR_M, "m"),
    ObservationField("where the grasp points and where its fingers close, base frame", 6, 1.0, "1"),
    ObservationField("where the hand points and where its fingers close, base frame", 6, 1.0, "1"),
    ObservationField(
        "velocity of the grasp while the joint opens by 1 m/s or rad/s, base frame", 3, _FAR_M, "m/s"
    ),
    ObservationField("how far the target is open: 0 closed, 1 open enough", 1, _MOST_OPENING, "1"),
    ObservationField("extent of the handle between the fingers", 1, _FAR_M, "m"),
)
HANDLE_SIZE = int(total(field.size for field in HANDLE_FIELDS))


def describe_handle(snapshot: Snapshot, goal: Any) -> Array:
    """Return the numbers of `HANDLE_FIELDS`, (B, 23), of the first grasp of each target's handle.

    Args:
        snapshot: of B environments.
        goal: their `CabinetGoal`.
    """
    xp, at = namespace(snapshot.robot_qpos), (goal.row, goal.link)
    origin, rotation = snapshot.link_position_w[at], snapshot.link_rotation_w[at]
    grasp = origin + rotate(rotation, goal.grasp_positions[:, 0])
    forward, across = (rotate(rotation, goal.grasp_rotations[:, 0, :, axis]) for axis in (2, 1))
    axis = rotate(rotation, goal.joint_axis)
    lever = grasp - origin - rotate(rotation, goal.joint_origin)
    velocity = xp.where(goal.turns[:, None], _cross(axis, lever), axis)
    base = xp.concat((snapshot.robot_qpos[:, :2], xp.zeros_like(grasp[:, :1])), axis=1)
    hand = snapshot.tool_rotation_w[:, 0]
    opening = (snapshot.object_qpos[goal.row, goal.joint] - goal.lower) / (goal.open_qpos - goal.lower)
    yaw = snapshot.robot_qpos[:, 2]
    vectors = (grasp - base, grasp - snapshot.tool_position_w[:, 0], forward, across, hand[:, :, 2], hand[:, :, 1])
    turned = [_about_z(vector, yaw) for vector in (*vectors, velocity)]
    return xp.concat((*turned, opening[:, None], goal.grasp_width_m[:, None]), axis=1)


def _about_z(vectors: Array, angle: Array) -> Array:
    """Return vectors (B, 3) in a frame that is turned about z by the angles (B,)."""
    xp = namespace(vectors)
    cosine, sine = xp.cos(angle), xp.sin(angle)
    x, y = vectors[:, 0], vectors[:, 1]
    return xp.stack((cosine * x + sine * y, cosine * y - sine * x, vectors[:, 2]), axis=1)


def _cross(a: Array, b: Array) -> Array:
    """Return the vector product of (B, 3) and (B, 3)."""
    parts = [a[:, i] * b[:, j] - a[:, j] * b[:, i] for i, j in ((1, 2), (2, 0), (0, 1))]
    return namespace(a).stack(parts, axis=1)
