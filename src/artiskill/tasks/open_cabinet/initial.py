"""Where an episode of the cabinet tasks starts: ranges, and a draw from them."""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.config import check_not_negative, check_value, check_vector
from artiskill.robots.config import RobotConfig
from artiskill.sim.states import InitialState


@dataclass(frozen=True)
class InitialStateConfig:
    """Ranges that a level draws from, all uniform.

    Attributes:
        robot_circle_center_m: (x, y) of the circle that the base starts on; the robot faces its centre.
        robot_circle_radius_m: range.
        robot_circle_angle_rad: range, counter-clockwise from +x.
        heading_noise_rad: the heading differs by up to +- this.
        lift_m: height of the lift.
        joint_friction: range of each object joint's dry friction (N, N m).
        joint_damping: range of each object joint's damping (N s/m, N m s/rad).
    """

    robot_circle_center_m: tuple[float, float]
    robot_circle_radius_m: tuple[float, float]
    robot_circle_angle_rad: tuple[float, float]
    heading_noise_rad: float
    lift_m: float
    joint_friction: tuple[float, float]
    joint_damping: tuple[float, float]

    def __post_init__(self) -> None:
        check_vector(self, "robot_circle_center_m", size=2)
        check_not_negative(self, "heading_noise_rad", "lift_m")
        for name, lowest in (
            ("robot_circle_radius_m", 0.0),
            ("robot_circle_angle_rad", -math.inf),
            ("joint_friction", 0.0),
            ("joint_damping", 0.0),
        ):
            low, high = getattr(self, name)
            legal = math.isfinite(low) and math.isfinite(high) and lowest <= low <= high
            least = "" if lowest == -math.inf else f" of at least {lowest:g}"
            check_value(self, name, legal, f"must be a range [low, high]{least}")


def sample_initial_state(
    obj: ArticulatedObject, rng: np.random.Generator, config: InitialStateConfig, robot: RobotConfig
) -> InitialState:
    """All joints closed, the robot on its circle facing the cabinet."""
    radius = rng.uniform(*config.robot_circle_radius_m)
    angle = rng.uniform(*config.robot_circle_angle_rad)
    noise = rng.uniform(-config.heading_noise_rad, config.heading_noise_rad)
    center = np.asarray(config.robot_circle_center_m)
    base = center + radius * np.array((math.cos(angle), math.sin(angle)))
    heading = math.remainder(angle + math.pi + noise, 2 * math.pi)
    joints = [link.joint for link in obj.links if link.joint is not None]
    arm = (*robot.initial.arm_qpos_rad, robot.initial.finger_qpos_m, robot.initial.finger_qpos_m)
    return InitialState(
        robot_qpos=np.array((*base, heading, config.lift_m, *(arm * len(robot.mounts)))),
        object_qpos=np.array([j.limits[0] if math.isfinite(j.limits[0]) else 0.0 for j in joints]),
        joint_friction=rng.uniform(*config.joint_friction, size=len(joints)),
        joint_damping=rng.uniform(*config.joint_damping, size=len(joints)),
    )
