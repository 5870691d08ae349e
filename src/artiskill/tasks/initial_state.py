"""What the initial states of tasks are made of: checked ranges, poses on the ground, a robot at rest."""

import math
from collections.abc import Sequence

import numpy as np

from artiskill.config import check_value
from artiskill.robots.config import RobotConfig


def check_ranges(config: object, **lowest: float) -> None:
    """Raise ConfigError unless each named field is a finite range [low, high] of at least its lowest value."""
    for name, least in lowest.items():
        low, high = getattr(config, name)
        legal = math.isfinite(low) and math.isfinite(high) and least <= low <= high
        limit = "" if least == -math.inf else f" of at least {least:g}"
        check_value(config, name, legal, f"must be a range [low, high]{limit}")


def polar(radius: float, angle: float) -> np.ndarray:
    """Return x and y of polar coordinates, (2,)."""
    return radius * np.array((math.cos(angle), math.sin(angle)))


def upright_pose(position_xy: Sequence[float] | np.ndarray, yaw: float) -> np.ndarray:
    """Return a pose on the ground, turned about the vertical, (7,)."""
    return np.array((position_xy[0], position_xy[1], 0.0, math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))


def robot_qpos(robot: RobotConfig, base_xy: np.ndarray, heading: float, lift_m: float) -> np.ndarray:
    """Return the joint values of a robot with arms and fingers where its configuration has them, (R,)."""
    arm = (*robot.initial.arm_qpos_rad, robot.initial.finger_qpos_m, robot.initial.finger_qpos_m)
    return np.array((*base_xy, math.remainder(heading, math.tau), lift_m, *(arm * len(robot.mounts))))
