"""Where an episode of MoveBucket starts: ranges, and a draw from them."""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.config import check_not_negative, check_value
from artiskill.geometry.arrays import rotate
from artiskill.robots.config import RobotConfig
from artiskill.sim.states import InitialState
from artiskill.tasks.move_bucket.goal import body_box
from artiskill.tasks.ranges import check_ranges, polar, robot_qpos, upright_pose


@dataclass(frozen=True)
class InitialStateConfig:
    """Ranges that a level draws from, all uniform.

    Attributes:
        bucket_distance_m: of the bucket's root from the platform's centre.
        robot_distance_m: of the robot's base from the bucket.
        robot_direction_rad: the robot stands beyond the bucket as seen from the platform, up to +- this aside.
        heading_noise_rad: the robot faces the bucket up to +- this.
        lift_m: height of the lift.
        bail_margin: share of the bail's range that is cut off at either end.
        joint_friction: range of the bail's dry friction, N m.
        joint_damping: range of its damping, N m s/rad.
        settle_steps: physics steps before the first observation, in which the ball begins to fall.
    """

    bucket_distance_m: tuple[float, float]
    robot_distance_m: tuple[float, float]
    robot_direction_rad: float
    heading_noise_rad: float
    lift_m: float
    bail_margin: float
    joint_friction: tuple[float, float]
    joint_damping: tuple[float, float]
    settle_steps: int

    def __post_init__(self) -> None:
        check_not_negative(self, "robot_direction_rad", "heading_noise_rad", "lift_m")
        check_value(self, "bail_margin", 0 <= self.bail_margin < 0.5, "must lie in [0, 0.5)")
        names = ("bucket_distance_m", "robot_distance_m", "joint_friction", "joint_damping")
        check_ranges(self, **dict.fromkeys(names, 0.0))
        check_value(self, "settle_steps", self.settle_steps >= 0, "must be at least 0")


def sample_initial_state(
    obj: ArticulatedObject,
    rng: np.random.Generator,
    config: InitialStateConfig,
    robot: RobotConfig,
    ball_radius_m: float,
) -> InitialState:
    """The bucket beside the platform, the ball at its rim, the robot on the other side, facing the bucket."""
    direction = rng.uniform(-math.pi, math.pi)
    bucket = polar(rng.uniform(*config.bucket_distance_m), direction)
    yaw = rng.uniform(-math.pi, math.pi)
    beyond = direction + rng.uniform(-config.robot_direction_rad, config.robot_direction_rad)
    base = bucket + polar(rng.uniform(*config.robot_distance_m), beyond)
    heading = beyond + math.pi + rng.uniform(-config.heading_noise_rad, config.heading_noise_rad)
    joints = obj.joints
    own = np.array([joint.limits for joint in joints]).reshape(-1, 2)
    limits = own + config.bail_margin * np.diff(own, axis=1) * np.array((1.0, -1.0))
    middle, rim = body_box(obj).mean(axis=0), body_box(obj)[1, 2]
    turn = np.array(((math.cos(yaw), -math.sin(yaw)), (math.sin(yaw), math.cos(yaw))))
    return InitialState(
        robot_qpos=robot_qpos(robot, base, heading, config.lift_m),
        object_qpos=limits[:, 0].copy(),
        joint_friction=rng.uniform(*config.joint_friction, size=len(joints)),
        joint_damping=rng.uniform(*config.joint_damping, size=len(joints)),
        object_limits=limits,
        root_pose_w=upright_pose(bucket, yaw),
        prop_positions_w=np.array(((*(bucket + rotate(turn, middle[:2])), rim - ball_radius_m),)),
        settle_steps=config.settle_steps,
    )
