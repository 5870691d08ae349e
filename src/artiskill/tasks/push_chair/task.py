"""PushChair: configuration and assembly."""

from dataclasses import dataclass
from functools import partial

from artiskill.config import check_inside
from artiskill.geometry.arrays import Array
from artiskill.scene.props import Prop
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks import staged_reward
from artiskill.tasks.push_chair.goal import PushGoal, make_push_goal
from artiskill.tasks.push_chair.initial import InitialStateConfig, sample_initial_state
from artiskill.tasks.push_chair.reward import TABLE, RewardConfig, push_reward_terms
from artiskill.tasks.standing import (
    MASK_NAMES,
    Stand,
    StandingConfig,
    observe_standing_state,
    robot_mask,
    state_fields,
)
from artiskill.tasks.surface import load_kernel
from artiskill.tasks.task import Task
from artiskill.tasks.task_config import TaskConfig

FLAG_NAMES = ("chair_close_to_target", "chair_standing", "chair_static")
# the target for people to see: a red ball, half in the ground
_TARGET_RGBA = (0.75, 0.03, 0.03, 1.0)


@dataclass(frozen=True)
class PushChairConfig(TaskConfig):
    """Everything about the task that is a value, beside what every task has.

    Attributes:
        initial: ranges of initial states.
        success: what counts as near, standing and still.
        reward: dense reward.
    """

    initial: InitialStateConfig
    success: StandingConfig
    reward: RewardConfig


def push_flags(snapshot: Snapshot, goal: PushGoal, config: StandingConfig) -> dict[str, Array]:
    """The conditions of `FLAG_NAMES`, each (B,) bool, at this instant."""
    stand = Stand(snapshot)
    values = (stand.near(config), stand.upright(config), stand.still(config))
    return dict(zip(FLAG_NAMES, values, strict=True))


def make_push_chair(config: PushChairConfig) -> Task:
    """Assemble the task."""
    robot = config.robot
    check_inside("initial.lift_m", config.initial.lift_m, robot.lift.range_m)
    load_kernel()
    staged_reward.load_kernel()
    return Task(
        name=config.name,
        config=config,
        category="chair",
        robot=robot,
        physics=config.physics,
        props=(Prop("target", "sphere", (config.success.near_m,), "drawn", rgba=_TARGET_RGBA),),
        episode_steps=config.episode_steps,
        hold_steps=config.steps_of(config.success.hold_s),
        targets=lambda obj: (obj.links[0].name,),
        make_goal=make_push_goal,
        sample_initial_state=partial(sample_initial_state, config=config.initial, robot=robot),
        flag_names=FLAG_NAMES,
        flags=partial(push_flags, config=config.success),
        reward_terms=partial(push_reward_terms, config=config.reward, success=config.success),
        reward_weights=config.reward.weights,
        reward_table=TABLE,
        observe_state=partial(observe_standing_state, max_joints=config.max_object_joints),
        state_fields=state_fields(config.max_object_joints, len(robot.mounts)),
        cameras=config.cameras,
        world_camera=config.world_camera,
        render=config.render,
        mask_names=MASK_NAMES,
        masks=robot_mask,
    )
