"""PushChair: push a swivel chair to a target on the ground and leave it standing there."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Link
from artiskill.config import check_inside, check_not_negative, check_positive, check_value
from artiskill.geometry.arrays import Array, namespace
from artiskill.robots.config import RobotConfig
from artiskill.scene.object_model import WHEEL_PART
from artiskill.scene.props import Prop
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import InitialState
from artiskill.tasks import free_object, staged_reward
from artiskill.tasks.free_object import (
    MASK_NAMES,
    SAFELY_NEAR,
    FreeObjectStateConfig,
    ObjectPose,
    StandingConfig,
    SurfaceGoal,
    arrival_stages,
    describe_distance,
    fingertip_distance,
    free_object_fields,
    observe_free_object,
    robot_mask,
    surface_samples,
)
from artiskill.tasks.grasp_candidates import seat_of
from artiskill.tasks.initial_state import check_ranges, polar, robot_qpos, upright_pose
from artiskill.tasks.staged_reward import Ramp, Stage, StageTable
from artiskill.tasks.task import Task, TaskConfig

FLAG_NAMES = ("chair_close_to_target", "chair_standing", "chair_static")
_ROLLING_PARTS = {WHEEL_PART, "caster"}
# the target for people to see: a red ball, half in the ground
_TARGET_RGBA = (0.75, 0.03, 0.03, 1.0)

# Measures:
#   hand_distance     mean distance of the fingertips to the chair's surface, m
#   hand_gap          the same, over what counts as close
#   tilt              of the chair, over what counts as tipping
#   target_distance   of the chair's root from the target, in the plane, m
#   approach_speed    of the chair's root towards the target, m/s
#   and how it arrives, `ObjectPose.arrival`
# A chair that is knocked rolls away: in the first stage, too, it shall stay near its target, and slow.
TABLE = StageTable(
    terms={
        "hand_distance": Ramp("hand_distance", 2.0, 0.0),
        "hand_near": Ramp("hand_distance", 0.6, 0.05),
        "upright": Ramp("tilt", 1.0, 0.0),
        "target_distance": Ramp("target_distance", 2.0, 0.0),
        "target_near": Ramp("target_distance", 1.0, 0.15),
        "approach_speed": Ramp("approach_speed", -0.2, 0.4),
        "slow": Ramp("speed", 5.0, 0.0),
    },
    stages=(
        Stage(
            "approach the chair",
            asks=("hand_distance", "hand_near", "upright", "target_distance", "slow"),
            leaves=(Ramp("hand_gap", 2.0, 1.0), Ramp("tilt", 1.2, 1.0)),
        ),
        Stage(
            "push it",
            asks=("target_distance", "target_near", "approach_speed", "upright"),
            enters=(Ramp("hand_gap", 1.0, 0.8), Ramp("tilt", 1.0, 0.8)),
            leaves=(Ramp("near", 1.5, 1.0),),
        ),
        *arrival_stages("brake it", "near, standing and still", asks=("slow", "upright")),
    ),
)


@dataclass(frozen=True)
class ChairInitialConfig:
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


@dataclass(frozen=True)
class ChairRewardConfig:
    """Weights and stage values.

    Attributes:
        close_distance_m: the hands are close where their fingertips' mean distance to the chair is below this.
        tipping_rad: a chair that leans by more than this must be left alone until it stands again.
        stage_bonus: least reward of each of the four stages, so low that no state earns more than 0.
        weights: term name -> weight; a term that is missing is reported with weight 0.
    """

    close_distance_m: float
    tipping_rad: float
    stage_bonus: tuple[float, ...]
    weights: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_positive(self, "close_distance_m", "tipping_rad")
        TABLE.check_weights(self.stage_bonus, self.weights)


@dataclass(frozen=True)
class PushChairConfig(TaskConfig):
    """Everything about the task that is a value, beside what every task has.

    Attributes:
        initial: ranges of initial states.
        success: what counts as near, standing and still.
        reward: dense reward.
        state: what the state vector says.
    """

    initial: ChairInitialConfig
    success: StandingConfig
    reward: ChairRewardConfig
    state: FreeObjectStateConfig


@dataclass(frozen=True, eq=False)
class ChairGoal(SurfaceGoal):
    """What B episodes ask for: the target lies at the origin; what differs is the chair's surface.

    Controllers read what is said here of its seat, as `Seat` has it; rewards and success do not.

    Attributes:
        seat_link: (B,) index of the link that the seat belongs to.
        seat_position: (B, 3) of a place in it, in that link's frame.
        seat_rotation: (B, 3, 3) of its axes there.
        seat_outline: (B, 2, D) how far the chair reaches out from there: where fingertips meet it, and a hand.
    """

    seat_link: Array
    seat_position: Array
    seat_rotation: Array
    seat_outline: Array


def make_chair_goal(obj: ArticulatedObject, target: str) -> ChairGoal:
    """Return the goal of pushing a chair, with B = 1; `target` is its root."""
    points, link = surface_samples(obj)
    seat = seat_of(obj)
    return ChairGoal(
        np.array([0]),
        points[None],
        link[None],
        np.array([seat.link]),
        seat.position[None],
        seat.rotation[None],
        seat.outline[None],
    )


def sample_initial_state(
    obj: ArticulatedObject, rng: np.random.Generator, config: ChairInitialConfig, robot: RobotConfig
) -> InitialState:
    """Draw the chair around the target, the robot behind it facing it, all joints at rest."""
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
    """Return whether a link is a caster or a wheel."""
    parts = {shape.part for shape in link.collisions} | {visual.part for visual in link.visuals}
    return not parts.isdisjoint(_ROLLING_PARTS)


def success_flags(snapshot: Snapshot, goal: ChairGoal, config: StandingConfig) -> dict[str, Array]:
    """Return the conditions of `FLAG_NAMES` as they are in this step, each (B,) bool."""
    pose = ObjectPose(snapshot)
    values = (pose.near(config), pose.upright(config), pose.still(config))
    return dict(zip(FLAG_NAMES, values, strict=True))


def reward_terms(
    snapshot: Snapshot,
    goal: ChairGoal,
    flags: Mapping[str, Array],
    config: ChairRewardConfig,
    success: StandingConfig,
) -> dict[str, Array]:
    """Return the unweighted terms of `TABLE`, each (B,), given the flags of the same step."""
    xp = namespace(snapshot.object_qpos)
    pose = ObjectPose(snapshot)
    hands = fingertip_distance(snapshot, goal)
    tilt, arrival = pose.tilt_rad / config.tipping_rad, pose.arrival(success)
    solved = flags["chair_standing"] & flags["chair_static"] & (arrival["near"] <= SAFELY_NEAR)
    pushing = (hands <= config.close_distance_m) & (tilt <= 1.0)
    stage = xp.where(flags["chair_close_to_target"] & (tilt <= 1.0), 2 + solved, pushing)  # (B,) 0 to 3
    measures = {
        "hand_distance": hands,
        "hand_gap": hands / config.close_distance_m,
        "tilt": tilt,
        "target_distance": pose.distance_m,
        "approach_speed": pose.approach_speed_m_s,
        **arrival,
    }
    return TABLE.evaluate(measures, stage, config.stage_bonus)


def make_push_chair(config: PushChairConfig) -> Task:
    """Assemble the task."""
    robot = config.robot
    check_inside("initial.lift_m", config.initial.lift_m, robot.lift.range_m)
    free_object.load_kernel()
    staged_reward.load_kernel()
    return Task(
        config=config,
        category="chair",
        props=(Prop("target", "sphere", (config.success.near_m,), "drawn", rgba=_TARGET_RGBA),),
        hold_steps=config.steps_of(config.success.hold_s),
        targets=lambda obj: (obj.links[0].name,),
        make_goal=make_chair_goal,
        sample_initial_state=partial(sample_initial_state, config=config.initial, robot=robot),
        flag_names=FLAG_NAMES,
        flags=partial(success_flags, config=config.success),
        reward_terms=partial(reward_terms, config=config.reward, success=config.success),
        reward_weights=config.reward.weights,
        reward_table=TABLE,
        observe_state=partial(observe_free_object, max_joints=config.max_object_joints, state=config.state),
        state_fields=free_object_fields(config.max_object_joints, len(robot.mounts), state=config.state),
        mask_names=MASK_NAMES,
        masks=robot_mask,
        describe_progress=describe_distance,
    )
