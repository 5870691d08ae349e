"""OpenCabinetDrawer and OpenCabinetDoor: configuration and assembly."""

from dataclasses import dataclass
from functools import partial

from artiskill.assets.articulated_object import JointKind
from artiskill.config import check_inside
from artiskill.tasks import staged_reward
from artiskill.tasks.open_cabinet import hand_pose, proximity
from artiskill.tasks.open_cabinet.goal import make_open_goal
from artiskill.tasks.open_cabinet.initial import InitialStateConfig, sample_initial_state
from artiskill.tasks.open_cabinet.masks import MASK_NAMES, cabinet_masks
from artiskill.tasks.open_cabinet.reward import TABLE, RewardConfig, open_reward_terms
from artiskill.tasks.open_cabinet.state import observe_cabinet_state, state_fields
from artiskill.tasks.open_cabinet.success import FLAG_NAMES, SuccessConfig, open_flags
from artiskill.tasks.task import Task
from artiskill.tasks.task_config import TaskConfig


@dataclass(frozen=True)
class OpenCabinetConfig(TaskConfig):
    """Everything about the task that is a value, beside what every task has.

    Attributes:
        motion: how the target moves: `prismatic` for drawers, `revolute` for doors.
        initial: ranges of initial states.
        success: what counts as open and still.
        reward: dense reward.
    """

    motion: JointKind
    initial: InitialStateConfig
    success: SuccessConfig
    reward: RewardConfig


def make_open_cabinet(config: OpenCabinetConfig) -> Task:
    """Assemble the task; doors and drawers differ only in `config`."""
    robot = config.robot
    check_inside("initial.lift_m", config.initial.lift_m, robot.lift.range_m)
    proximity.load_kernel()
    hand_pose.load_kernel()
    staged_reward.load_kernel()
    return Task(
        name=config.name,
        config=config,
        category="cabinet",
        robot=robot,
        physics=config.physics,
        props=(),
        episode_steps=config.episode_steps,
        hold_steps=config.steps_of(config.success.hold_s),
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
        render=config.render,
        mask_names=MASK_NAMES,
        masks=cabinet_masks,
    )
