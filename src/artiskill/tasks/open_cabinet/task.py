"""OpenCabinetDrawer and OpenCabinetDoor: configuration, initial states and assembly."""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, JointKind
from artiskill.config import check
from artiskill.robots.config import RobotConfig, load_robot
from artiskill.scene.physics import PhysicsConfig
from artiskill.sim.states import InitialState
from artiskill.tasks.open_cabinet.goal import make_open_goal
from artiskill.tasks.open_cabinet.proximity import load_kernel
from artiskill.tasks.open_cabinet.reward import RewardConfig, open_reward_terms
from artiskill.tasks.open_cabinet.state import observe_cabinet_state, state_fields
from artiskill.tasks.open_cabinet.success import SuccessConfig, open_flags
from artiskill.tasks.task import Task


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
        for name in ("robot_circle_radius_m", "robot_circle_angle_rad", "joint_friction", "joint_damping"):
            values = getattr(self, name)
            check(
                values[0] <= values[1],
                f"initial.{name} must be a range [low, high], not {list(values)}",
            )


@dataclass(frozen=True)
class OpenCabinetConfig:
    """Everything about the task that is a value.

    Attributes:
        name: of the task.
        robot: name of the robot.
        motion: how the target moves: `prismatic` for drawers, `revolute` for doors.
        episode_steps: environment steps until the episode is cut off.
        max_object_joints: joint slots of the state vector.
        physics: rates, solver, contacts.
        initial: ranges of initial states.
        success: what counts as open and still.
        reward: dense reward.
    """

    name: str
    robot: str
    motion: JointKind
    episode_steps: int
    max_object_joints: int
    physics: PhysicsConfig
    initial: InitialStateConfig
    success: SuccessConfig
    reward: RewardConfig

    def __post_init__(self) -> None:
        check(self.episode_steps >= 1, f"episode_steps must be at least 1, not {self.episode_steps}")
        check(self.max_object_joints >= 1, f"max_object_joints must be at least 1, not {self.max_object_joints}")


def make_open_cabinet(config: OpenCabinetConfig) -> Task:
    """Assemble the task; doors and drawers differ only in `config`."""
    robot = load_robot(config.robot)
    load_kernel()
    return Task(
        name=config.name,
        config=config,
        category="cabinet",
        robot=robot,
        physics=config.physics,
        episode_steps=config.episode_steps,
        hold_steps=max(1, round(config.success.hold_s / config.physics.step_s)),
        targets=lambda obj: obj.target_links(config.motion),
        make_goal=partial(make_open_goal, open_fraction=config.success.open_fraction),
        sample_initial_state=partial(_sample_initial_state, config=config.initial, robot=robot),
        flags=partial(open_flags, config=config.success),
        reward_terms=partial(open_reward_terms, config=config.reward),
        reward_weights=config.reward.weights,
        observe_state=partial(observe_cabinet_state, max_joints=config.max_object_joints),
        state_fields=state_fields(config.max_object_joints, arms=len(robot.mounts)),
    )


def _sample_initial_state(
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
