"""Poses of the hands of PushChair's expert: as the base sees them, and as they grip."""

import math

import numpy as np

from artiskill.experts.frames import Frame, yaw_rotation
from artiskill.experts.push_chair_plan import LEFT
from artiskill.sim.snapshot import Snapshot


def seen_from_base(snapshot: Snapshot, hand: int) -> Frame:
    """Pose of a hand in the base's frame."""
    x, y, yaw = snapshot.robot_qpos[0, :3]
    turn = yaw_rotation(-yaw)
    position = snapshot.tool_position_w[0, hand] - np.array((x, y, 0.0))
    return Frame(turn @ position, turn @ snapshot.tool_rotation_w[0, hand])


def back_to_world(snapshot: Snapshot, frame: Frame) -> Frame:
    """The pose whose place in the base's frame is given."""
    x, y, yaw = snapshot.robot_qpos[0, :3]
    turn = yaw_rotation(yaw)
    return Frame(np.array((x, y, 0.0)) + turn @ frame.position, turn @ frame.rotation)


def hand_rotation(yaw_rad: float, pitch_rad: float, hand: int) -> np.ndarray:
    """(3, 3) of a hand that points somewhat upwards and closes sideways, its last joint far from its limits."""
    cos, sin = math.cos(pitch_rad), math.sin(pitch_rad)
    forward = np.array((math.cos(yaw_rad) * cos, math.sin(yaw_rad) * cos, sin))
    y = np.array((-math.sin(yaw_rad), math.cos(yaw_rad), 0.0)) * (1.0 if hand == LEFT else -1.0)
    return np.stack((np.cross(y, forward), y, forward), axis=-1)
