"""Where an episode of the cabinet tasks starts: ranges, and a draw from them."""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.config import check_not_negative, check_vector
from artiskill.robots.config import RobotConfig
from artiskill.sim.states import InitialState
from artiskill.tasks.ranges import check_ranges, polar, robot_qpos


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
        check_ranges(
            self,
            robot_circle_radius_m=0.0,
            robot_circle_angle_rad=-math.inf,
            joint_friction=0.0,
            joint_damping=0.0,
        )


def sample_initial_state(
    obj: ArticulatedObject, rng: np.random.Generator, config: InitialStateConfig, robot: RobotConfig
) -> InitialState:
    """All joints closed, the robot on its circle facing the cabinet."""
    radius = rng.uniform(*config.robot_circle_radius_m)
    angle = rng.uniform(*config.robot_circle_angle_rad)
    noise = rng.uniform(-config.heading_noise_rad, config.heading_noise_rad)
    base = np.asarray(config.robot_circle_center_m) + polar(radius, angle)
    return InitialState(
        robot_qpos=robot_qpos(robot, base, angle + math.pi + noise, config.lift_m),
        object_qpos=obj.rest_qpos,
        joint_friction=rng.uniform(*config.joint_friction, size=len(obj.joints)),
        joint_damping=rng.uniform(*config.joint_damping, size=len(obj.joints)),
    )
