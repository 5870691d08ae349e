"""MoveBucket: lift a bucket with a ball in it with two hands, carry it over a platform, hold it still."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.config import check, check_inside, check_not_negative, check_positive, check_value
from artiskill.geometry.arrays import Array, amin, dot, namespace, norm, rotate
from artiskill.robots.config import RobotConfig
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
from artiskill.tasks.grasp_candidates import body_outline
from artiskill.tasks.initial_state import check_ranges, polar, robot_qpos, upright_pose
from artiskill.tasks.staged_reward import Ramp, Stage, StageTable
from artiskill.tasks.task import Task, TaskConfig

FLAG_NAMES = ("balls_in_bucket", "bucket_above_platform", "bucket_standing", "bucket_static")
_BALL = "ball"
_OPPOSITE = -0.5  # cosine below which two hands hold a bucket between them
_PLATFORM_RGBA, _BALL_RGBA = (0.35, 0.24, 0.14, 1.0), (0.05, 0.25, 0.65, 1.0)

# Measures:
#   hand_distance     mean distance of the fingertips to the bucket's surface, m
#   hand_gap          the same, over what counts as close
#   opposite          cosine of the angle between the two hands, seen from its middle in the plane: -1 if opposite
#   hand_level        difference of the two hands' heights in the bucket's frame, m
#   tilt              of the bucket, over what counts as tipping
#   rise              of the bucket's middle above where it started, over what counts as lifted
#   rising_speed      of the bucket's root, m/s upwards
#   ball_depth        of the ball's centre in the box around the bucket's body, m; negative outside
#   target_distance   of the bucket's root from the platform's centre, in the plane, m
#   approach_speed    of the bucket's root towards it, m/s
#   and how it arrives, `ObjectPose.arrival`
TABLE = StageTable(
    terms={
        "hand_distance": Ramp("hand_distance", 2.0, 0.0),
        "hand_near": Ramp("hand_distance", 0.6, 0.05),
        "grip": Ramp("hand_distance", 0.12, 0.01),
        "opposite": Ramp("opposite", 1.0, -1.0),
        "hand_level": Ramp("hand_level", 0.6, 0.0),
        "upright": Ramp("tilt", 1.0, 0.0),
        "begun": Ramp("rise", 0.0, 0.25),
        "rise": Ramp("rise", 0.0, 1.0),
        "rising_speed": Ramp("rising_speed", -0.1, 0.3),
        "target_distance": Ramp("target_distance", 2.0, 0.0),
        "approach_speed": Ramp("approach_speed", -0.2, 0.4),
        "slow": Ramp("speed", 5.0, 0.0),
    },
    stages=(
        Stage(
            "approach the bucket",
            asks=("hand_distance", "hand_near", "opposite", "hand_level", "upright"),
            leaves=(
                Ramp("opposite", 0.0, _OPPOSITE),
                Ramp("hand_gap", 2.0, 1.0),
                Ramp("tilt", 1.2, 1.0),
                Ramp("ball_depth", -0.1, 0.0),
            ),
        ),
        Stage(
            "lift it",
            asks=("grip", "opposite", "hand_level", "upright", "begun", "rise", "rising_speed"),
            enters=(
                Ramp("opposite", _OPPOSITE, -0.7),
                Ramp("hand_gap", 1.0, 0.8),
                Ramp("tilt", 1.0, 0.8),
                Ramp("ball_depth", 0.0, 0.05),
            ),
            leaves=(Ramp("rise", 0.8, 1.0),),
        ),
        Stage(
            "carry it",
            asks=("opposite", "upright", "target_distance", "approach_speed"),
            enters=(Ramp("rise", 1.0, 1.1),),
            leaves=(Ramp("near", 1.3, 1.0),),
        ),
        *arrival_stages("hold it above the platform", "above it, upright and still", asks=("slow", "upright")),
    ),
)


@dataclass(frozen=True)
class BucketPropsConfig:
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
        """Return both, for a scene."""
        half = (self.platform_half_m, self.platform_half_m, self.platform_height_m / 2)
        place = (0.0, 0.0, self.platform_height_m / 2)
        return (
            Prop("platform", "box", half, "fixed", place, _PLATFORM_RGBA, friction=self.friction),
            Prop(
                *(_BALL, "sphere", (self.ball_radius_m,), "free"),
                rgba=_BALL_RGBA,
                density_kg_m3=self.ball_density_kg_m3,
                friction=self.friction,
            ),
        )


@dataclass(frozen=True)
class BucketInitialConfig:
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


@dataclass(frozen=True)
class BucketRewardConfig:
    """Weights and stage values.

    Attributes:
        close_distance_m: the hands are close where their fingertips' mean distance to the bucket is below this.
        tipping_rad: a bucket that leans by more than this counts as in the first stage.
        lifted_m: how far its middle must rise to count as lifted.
        stage_bonus: least reward of each of the five stages, so low that no state earns more than 0.
        weights: term name -> weight; a term that is missing is reported with weight 0.
    """

    close_distance_m: float
    tipping_rad: float
    lifted_m: float
    stage_bonus: tuple[float, ...]
    weights: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_positive(self, "close_distance_m", "tipping_rad", "lifted_m")
        TABLE.check_weights(self.stage_bonus, self.weights)


@dataclass(frozen=True)
class MoveBucketConfig(TaskConfig):
    """Everything about the task that is a value, beside what every task has.

    Attributes:
        props: platform and ball.
        initial: ranges of initial states.
        success: what counts as above the platform, standing and still.
        reward: dense reward.
        state: what the state vector says.
    """

    props: BucketPropsConfig
    initial: BucketInitialConfig
    success: StandingConfig
    reward: BucketRewardConfig
    state: FreeObjectStateConfig


@dataclass(frozen=True, eq=False)
class BucketGoal(SurfaceGoal):
    """What B episodes ask for: the platform lies at the origin; what differs is the bucket's shape.

    Attributes:
        box: (B, 2, 3) smallest and largest corner of the bucket's body, without its bail, in its own frame.
        start_height: (B,) of the box's middle above the ground while the bucket stands there, m.
        outline_height: (B, Z) heights in the root's frame at which its outline is known, m.
        outline: (B, Z, D) how far the body reaches out from the root's z axis there, m; D directions evenly around
            the axis, from the root's +x on. Controllers read both; rewards and success do not.
    """

    box: Array
    start_height: Array
    outline_height: Array
    outline: Array


def make_bucket_goal(obj: ArticulatedObject, target: str) -> BucketGoal:
    """Return the goal of moving a bucket, with B = 1; `target` is its root."""
    points, link = surface_samples(obj)
    box = body_box(obj)
    heights, outline = body_outline(obj, float(box[0, 2]), float(box[1, 2]))
    middle = box[:, 2].mean()
    return BucketGoal(
        np.array([0]), points[None], link[None], box[None], middle[None], heights[None], outline[None]
    )


def body_box(obj: ArticulatedObject) -> np.ndarray:
    """Return the smallest and largest corner of what is drawn of an object's root, in its frame: (2, 3)."""
    corners = np.stack([visual.mesh.bounds for visual in obj.links[0].visuals])
    return np.stack((corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)))


def sample_initial_state(
    obj: ArticulatedObject,
    rng: np.random.Generator,
    config: BucketInitialConfig,
    robot: RobotConfig,
    ball_radius_m: float,
) -> InitialState:
    """Draw the bucket beside the platform, the ball at its rim, the robot on the other side, facing the bucket."""
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


def success_flags(snapshot: Snapshot, goal: BucketGoal, config: StandingConfig) -> dict[str, Array]:
    """Return the conditions of `FLAG_NAMES` as they are in this step, each (B,) bool.

    A bucket that is held in the air above the platform counts, as one that stands on it does.
    """
    pose = ObjectPose(snapshot)
    values = (ball_depth_m(snapshot, goal) >= 0.0, pose.near(config), pose.upright(config), pose.still(config))
    return dict(zip(FLAG_NAMES, values, strict=True))


def ball_depth_m(snapshot: Snapshot, goal: BucketGoal) -> Array:
    """Return how deep the centres of all free props lie in the box around the bucket's body, (B,).

    Of the ball nearest to getting out, distance to the nearest side of the box; negative outside, where it is how
    far the ball is beyond the side that it is furthest beyond.
    """
    xp = namespace(snapshot.prop_position_w)
    from_root = snapshot.prop_position_w - snapshot.link_position_w[:, :1]
    to_root = xp.matrix_transpose(snapshot.link_rotation_w[:, :1])
    local = rotate(to_root, from_root)  # (B, K, 3)
    return amin(amin(xp.minimum(local - goal.box[:, :1], goal.box[:, 1:] - local)))


def reward_terms(
    snapshot: Snapshot,
    goal: BucketGoal,
    flags: Mapping[str, Array],
    config: BucketRewardConfig,
    success: StandingConfig,
) -> dict[str, Array]:
    """Return the unweighted terms of `TABLE`, each (B,), given the flags of the same step.

    Without the ball, or tipped over, a bucket is in the first stage wherever it is.
    """
    xp = namespace(snapshot.object_qpos)
    pose = ObjectPose(snapshot)
    centre = bucket_centre_w(snapshot, goal)
    hands = fingertip_distance(snapshot, goal)
    opposite, level = hand_placement(snapshot, centre)
    tilt, arrival = pose.tilt_rad / config.tipping_rad, pose.arrival(success)
    rise = (centre[:, 2] - goal.start_height) / config.lifted_m
    measures = {
        "hand_distance": hands,
        "hand_gap": hands / config.close_distance_m,
        "opposite": opposite,
        "hand_level": level,
        "tilt": tilt,
        "rise": rise,
        "rising_speed": snapshot.root_velocity_w[:, 2],
        "ball_depth": ball_depth_m(snapshot, goal),
        "target_distance": pose.distance_m,
        "approach_speed": pose.approach_speed_m_s,
        **arrival,
    }
    solved = flags["bucket_standing"] & flags["bucket_static"] & (arrival["near"] <= SAFELY_NEAR)
    held = ((hands <= config.close_distance_m) & (opposite <= _OPPOSITE)) * (1 + (rise >= 1.0))  # (B,) 0 to 2
    stage = xp.where(flags["bucket_above_platform"], 3 + solved, held)
    stage = xp.where(flags["balls_in_bucket"] & (tilt <= 1.0), stage, xp.zeros_like(stage))
    return TABLE.evaluate(measures, stage, config.stage_bonus)


def bucket_centre_w(snapshot: Snapshot, goal: BucketGoal) -> Array:
    """Return the middle of the bucket's box, in the world: (B, 3)."""
    xp = namespace(snapshot.link_position_w)
    middle = xp.mean(goal.box, axis=1)
    return rotate(snapshot.link_rotation_w[:, 0], middle) + snapshot.link_position_w[:, 0]


def hand_placement(snapshot: Snapshot, centre_w: Array) -> tuple[Array, Array]:
    """Return how the two hands lie about the bucket's middle.

    Returns:
        (B,) cosine of the angle between them, seen from the middle in the plane, and (B,) difference of their
        heights in the bucket's frame, in metres.
    """
    xp = namespace(centre_w)
    from_centre = snapshot.tool_position_w - centre_w[:, None]  # (B, 2, 3)
    plane = from_centre[..., :2]
    lengths = norm(plane)  # (B, 2)
    least_length = xp.asarray(1e-6, dtype=lengths.dtype)
    cosine = dot(plane[:, 0], plane[:, 1]) / xp.maximum(lengths[:, 0] * lengths[:, 1], least_length)
    up = snapshot.link_rotation_w[:, 0, :, 2]
    return cosine, xp.abs(dot(from_centre[:, 0] - from_centre[:, 1], up))


def make_move_bucket(config: MoveBucketConfig) -> Task:
    """Assemble the task.

    Raises:
        ConfigError: the robot has not two arms, or starts where its lift cannot be.
    """
    robot = config.robot
    check(len(robot.mounts) == 2, f"MoveBucket needs a robot with two arms; {robot.name} has {len(robot.mounts)}")
    check_inside("initial.lift_m", config.initial.lift_m, robot.lift.range_m)
    free_object.load_kernel()
    staged_reward.load_kernel()
    return Task(
        config=config,
        category="bucket",
        props=config.props.props(),
        hold_steps=config.steps_of(config.success.hold_s),
        targets=lambda obj: (obj.links[0].name,),
        make_goal=make_bucket_goal,
        sample_initial_state=partial(
            sample_initial_state, config=config.initial, robot=robot, ball_radius_m=config.props.ball_radius_m
        ),
        flag_names=FLAG_NAMES,
        flags=partial(success_flags, config=config.success),
        reward_terms=partial(reward_terms, config=config.reward, success=config.success),
        reward_weights=config.reward.weights,
        reward_table=TABLE,
        observe_state=partial(observe_free_object, max_joints=config.max_object_joints, state=config.state),
        state_fields=free_object_fields(config.max_object_joints, len(robot.mounts), (_BALL,), config.state),
        mask_names=MASK_NAMES,
        masks=robot_mask,
        describe_progress=describe_distance,
    )
