"""OpenCabinetDrawer and OpenCabinetDoor: configuration and assembly."""

from dataclasses import dataclass
from functools import partial

from artiskill.assets.articulated_object import JointKind
from artiskill.config import check, check_inside
from artiskill.robots.config import load_robot
from artiskill.scene.physics import PhysicsConfig
from artiskill.sensors.framing import WorldCameraConfig
from artiskill.sensors.panorama import CamerasConfig
from artiskill.tasks import staged_reward
from artiskill.tasks.open_cabinet.goal import make_open_goal
from artiskill.tasks.open_cabinet.initial import InitialStateConfig, sample_initial_state
from artiskill.tasks.open_cabinet.masks import MASK_NAMES, cabinet_masks
from artiskill.tasks.open_cabinet.proximity import load_kernel
from artiskill.tasks.open_cabinet.reward import TABLE, RewardConfig, open_reward_terms
from artiskill.tasks.open_cabinet.state import observe_cabinet_state, state_fields
from artiskill.tasks.open_cabinet.success import FLAG_NAMES, SuccessConfig, open_flags
from artiskill.tasks.task import Task


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
        cameras: on the robot's base.
        world_camera: for people.
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
    cameras: CamerasConfig
    world_camera: WorldCameraConfig

    def __post_init__(self) -> None:
        check(self.episode_steps >= 1, f"episode_steps must be at least 1, not {self.episode_steps}")
        check(self.max_object_joints >= 1, f"max_object_joints must be at least 1, not {self.max_object_joints}")


def make_open_cabinet(config: OpenCabinetConfig) -> Task:
    """Assemble the task; doors and drawers differ only in `config`."""
    robot = load_robot(config.robot)
    check_inside("initial.lift_m", config.initial.lift_m, robot.lift.range_m)
    load_kernel()
    staged_reward.load_kernel()
    return Task(
        name=config.name,
        config=config,
        category="cabinet",
        robot=robot,
        physics=config.physics,
        props=(),
        episode_steps=config.episode_steps,
        hold_steps=max(1, round(config.success.hold_s / config.physics.step_s)),
        targets=lambda obj: obj.target_links(config.motion),
        make_goal=partial(make_open_goal, open_fraction=config.success.open_fraction),
        sample_initial_state=partial(sample_initial_state, config=config.initial, robot=robot),
        flag_names=FLAG_NAMES,
        flags=partial(open_flags, config=config.success),
        reward_terms=partial(open_reward_terms, config=config.reward, success=config.success),
        reward_weights=config.reward.weights,
        reward_table=TABLE,
        observe_state=partial(observe_cabinet_state, max_joints=config.max_object_joints),
        state_fields=state_fields(config.max_object_joints, arms=len(robot.mounts)),
        cameras=config.cameras,
        world_camera=config.world_camera,
        mask_names=MASK_NAMES,
        masks=cabinet_masks,
    )
