"""Where an episode of PushChair starts: ranges, and a draw from them."""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Link
from artiskill.config import check_not_negative, check_value
from artiskill.robots.config import RobotConfig
from artiskill.scene.object_model import WHEEL_PART
from artiskill.sim.states import InitialState
from artiskill.tasks.ranges import check_ranges, polar, robot_qpos, upright_pose

_ROLLING_PARTS = {WHEEL_PART, "caster"}


@dataclass(frozen=True)
class InitialStateConfig:
    """Ranges that a level draws from, all uniform.

    Attributes:
        chair_distance_m: of the chair's root from the target.
        chair_turn_rad: the chair's back faces the target, turned by up to +- this.
        robot_distance_m: of the robot's base from the chair.
        robot_direction_rad: the robot stands beyond the chair as seen from the target, up to +- this aside.
        heading_noise_rad: the robot faces the chair up to +- this.
        lift_m: height of the lift.
        joint_friction: range of the dry friction of each joint of seat and column (N, N m).
        joint_damping: range of their damping (N s/m, N m s/rad).
        wheel_friction: the same for casters and wheels.
        wheel_damping: the same for casters and wheels.
        settle_steps: physics steps before the first observation, in which the chair comes to rest on its wheels.
    """

    chair_distance_m: tuple[float, float]
    chair_turn_rad: float
    robot_distance_m: tuple[float, float]
    robot_direction_rad: float
    heading_noise_rad: float
    lift_m: float
    joint_friction: tuple[float, float]
    joint_damping: tuple[float, float]
    wheel_friction: tuple[float, float]
    wheel_damping: tuple[float, float]
    settle_steps: int

    def __post_init__(self) -> None:
        check_not_negative(self, "chair_turn_rad", "robot_direction_rad", "heading_noise_rad", "lift_m")
        check_ranges(
            self,
            **dict.fromkeys(("chair_distance_m", "robot_distance_m", "joint_friction", "joint_damping"), 0.0),
            **dict.fromkeys(("wheel_friction", "wheel_damping"), 0.0),
        )
        check_value(self, "settle_steps", self.settle_steps >= 0, "must be at least 0")


def sample_initial_state(
    obj: ArticulatedObject, rng: np.random.Generator, config: InitialStateConfig, robot: RobotConfig
) -> InitialState:
    """The chair around the target, the robot behind it facing it, all joints at rest."""
    direction = rng.uniform(-math.pi, math.pi)
    chair = polar(rng.uniform(*config.chair_distance_m), direction)
    # a chair faces -x, so its back faces the target when its x axis points there
    yaw = direction + math.pi + rng.uniform(-config.chair_turn_rad, config.chair_turn_rad)
    beyond = direction + rng.uniform(-config.robot_direction_rad, config.robot_direction_rad)
    base = chair + polar(rng.uniform(*config.robot_distance_m), beyond)
    heading = beyond + math.pi + rng.uniform(-config.heading_noise_rad, config.heading_noise_rad)
    links = [obj.links[i] for i in obj.jointed_links]
    rolls = np.array([_rolls(link) for link in links], dtype=bool)
    friction = np.where(
        rolls, rng.uniform(*config.wheel_friction, len(links)), rng.uniform(*config.joint_friction, len(links))
    )
    damping = np.where(
        rolls, rng.uniform(*config.wheel_damping, len(links)), rng.uniform(*config.joint_damping, len(links))
    )
    return InitialState(
        robot_qpos=robot_qpos(robot, base, heading, config.lift_m),
        object_qpos=obj.rest_qpos,
        joint_friction=friction,
        joint_damping=damping,
        root_pose_w=upright_pose(chair, yaw),
        settle_steps=config.settle_steps,
    )


def _rolls(link: Link) -> bool:
    """Whether a link is a caster or a wheel."""
    parts = {shape.part for shape in link.collisions} | {visual.part for visual in link.visuals}
    return not parts.isdisjoint(_ROLLING_PARTS)
