"""MoveBucket: configuration and assembly."""

from dataclasses import dataclass
from functools import partial

from artiskill.config import check, check_inside, check_positive
from artiskill.scene.props import Prop
from artiskill.tasks import staged_reward
from artiskill.tasks.move_bucket.goal import make_bucket_goal
from artiskill.tasks.move_bucket.initial import InitialStateConfig, sample_initial_state
from artiskill.tasks.move_bucket.reward import TABLE, RewardConfig, bucket_reward_terms
from artiskill.tasks.move_bucket.success import FLAG_NAMES, bucket_flags
from artiskill.tasks.standing import MASK_NAMES, StandingConfig, observe_standing_state, robot_mask, state_fields
from artiskill.tasks.surface import load_kernel
from artiskill.tasks.task import Task
from artiskill.tasks.task_config import TaskConfig

BALL = "ball"
_PLATFORM_RGBA, _BALL_RGBA = (0.35, 0.24, 0.14, 1.0), (0.05, 0.25, 0.65, 1.0)


@dataclass(frozen=True)
class PropsConfig:
    """Platform and ball.

    Attributes:
        platform_half_m: half the width of the square platform.
        platform_height_m: of its top above the ground.
        ball_radius_m: of the ball in the bucket.
        ball_density_kg_m3: of the ball.
        friction: sliding friction of both.
    """

    platform_half_m: float
    platform_height_m: float
    ball_radius_m: float
    ball_density_kg_m3: float
    friction: float

    def __post_init__(self) -> None:
        check_positive(self, "platform_half_m", "platform_height_m", "ball_radius_m", "ball_density_kg_m3")
        check_positive(self, "friction")

    def props(self) -> tuple[Prop, ...]:
        """Both, for a scene."""
        half = (self.platform_half_m, self.platform_half_m, self.platform_height_m / 2)
        place = (0.0, 0.0, self.platform_height_m / 2)
        return (
            Prop("platform", "box", half, "fixed", place, _PLATFORM_RGBA, friction=self.friction),
            Prop(
                *(BALL, "sphere", (self.ball_radius_m,), "free"),
                rgba=_BALL_RGBA,
                density_kg_m3=self.ball_density_kg_m3,
                friction=self.friction,
            ),
        )


@dataclass(frozen=True)
class MoveBucketConfig(TaskConfig):
    """Everything about the task that is a value, beside what every task has.

    Attributes:
        props: platform and ball.
        initial: ranges of initial states.
        success: what counts as above the platform, standing and still.
        reward: dense reward.
    """

    props: PropsConfig
    initial: InitialStateConfig
    success: StandingConfig
    reward: RewardConfig


def make_move_bucket(config: MoveBucketConfig) -> Task:
    """Assemble the task.

    Raises:
        ConfigError: the robot has not two arms, or starts where its lift cannot be.
    """
    robot = config.robot
    check(len(robot.mounts) == 2, f"MoveBucket needs a robot with two arms; {robot.name} has {len(robot.mounts)}")
    check_inside("initial.lift_m", config.initial.lift_m, robot.lift.range_m)
    load_kernel()
    staged_reward.load_kernel()
    return Task(
        name=config.name,
        config=config,
        category="bucket",
        robot=robot,
        physics=config.physics,
        props=config.props.props(),
        episode_steps=config.episode_steps,
        hold_steps=config.steps_of(config.success.hold_s),
        targets=lambda obj: (obj.links[0].name,),
        make_goal=make_bucket_goal,
        sample_initial_state=partial(
            sample_initial_state, config=config.initial, robot=robot, ball_radius_m=config.props.ball_radius_m
        ),
        flag_names=FLAG_NAMES,
        flags=partial(bucket_flags, config=config.success),
        reward_terms=partial(bucket_reward_terms, config=config.reward, success=config.success),
        reward_weights=config.reward.weights,
        reward_table=TABLE,
        observe_state=partial(observe_standing_state, max_joints=config.max_object_joints),
        state_fields=state_fields(config.max_object_joints, len(robot.mounts), (BALL,)),
        cameras=config.cameras,
        world_camera=config.world_camera,
        render=config.render,
        mask_names=MASK_NAMES,
        masks=robot_mask,
    )
