"""OpenCabinetDrawer and OpenCabinetDoor: open one drawer or door of a cabinet and leave it still.

Both are one task: they differ in configuration only.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Handle, Joint, JointKind
from artiskill.assets.handles import is_handle_part
from artiskill.config import (
    check_inside,
    check_not_negative,
    check_positive,
    check_range,
    check_value,
    check_vector,
)
from artiskill.errors import AssetError
from artiskill.geometry.arrays import Array, namespace, norm
from artiskill.geometry.rotations import quat_to_matrix
from artiskill.robots.config import RobotConfig
from artiskill.scene.scene import Scene
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import InitialState
from artiskill.tasks import cabinet_measures, staged_reward
from artiskill.tasks.cabinet_measures import (
    CLOSED_M,
    HANDLE_FIELDS,
    HANDLE_SIZE,
    MEASURES,
    NEVER_AJAR,
    Limits,
    describe_handle,
    measure,
    target_motion,
)
from artiskill.tasks.initial_state import check_ranges, polar, robot_qpos
from artiskill.tasks.staged_reward import Ramp, Stage, StageTable
from artiskill.tasks.state_vector import ObservationField, object_size, observe_state, state_fields
from artiskill.tasks.task import Task, TaskConfig

FLAG_NAMES = ("open_enough", "cabinet_static")
MASK_NAMES = ("handle", "link", "robot")
# A plane that every point lies inside of, far away: it pads hulls with fewer planes than their batch's largest.
_NO_PLANE = np.array((0.0, 0.0, 0.0, -1e3))
# The last stage begins a little further than open enough: a link that is opened slowly, and so counts as still,
# would otherwise skip the stage before it.
_SAFELY_OPEN = 1.02
_BEHIND_M = 0.1  # from the grasp pose against the opening direction: past a knob, a door and a finger
_COLUMN = {name: i for i, name in enumerate(MEASURES)}

# Measures:
#   hand_angle        angle to the nearest grasp pose, over pi
#   handle_distance   mean distance of the two fingers' lines to the handle, m
#   depth             of the fingers' mid-line in the handle's hull, m, positive inside; more where a door is ajar
#   finger_gap        the greater of the two distances, over what counts as close; less where a door is ajar
#   opening_speed     velocity of the joint, m/s or rad/s
#   opening           how far it is open: 0 closed, 1 open enough
#   speed             of the target link, over what counts as still
#   pushing_distance  of the hand from where a door is pushed, behind its handle, m; 1 m more while it is closed
#   angular_speed     of the target link, over what counts as still
TABLE = StageTable(
    terms={
        "hand_angle": Ramp("hand_angle", 1.0, 0.0),
        "handle_distance": Ramp("handle_distance", 2.0, 0.0),
        "enclosure": Ramp("depth", -0.01, 0.004),
        "grip": Ramp("finger_gap", 1.0, 0.2),
        "opening_speed": Ramp("opening_speed", -0.1, 0.5),
        "begun": Ramp("opening", 0.0, 0.1),
        "opening": Ramp("opening", 0.0, 1.0),
        "slow": Ramp("speed", 10.0, 0.0),
        "hand_behind": Ramp("pushing_distance", 1.0, 0.0),
    },
    stages=(
        Stage(
            "approach",
            asks=("hand_angle", "handle_distance", "enclosure"),
            leaves=(Ramp("finger_gap", 3.0, 1.0), Ramp("depth", -0.01, 0.0)),
        ),
        Stage(
            "close to the handle",
            asks=("hand_behind", "grip", "opening_speed", "begun", "opening"),
            enters=(Ramp("finger_gap", 1.0, 0.8), Ramp("depth", 0.0, 0.002)),
            leaves=(Ramp("opening", 0.8, 1.0),),
        ),
        Stage(
            "open enough",
            asks=("slow",),
            enters=(Ramp("opening", 1.0, _SAFELY_OPEN),),
            leaves=(Ramp("speed", 3.0, 1.0), Ramp("angular_speed", 3.0, 1.0), Ramp("opening", 1.0, _SAFELY_OPEN)),
        ),
        Stage(
            "open enough and still",
            asks=("slow",),
            enters=(Ramp("speed", 1.0, 0.8), Ramp("angular_speed", 1.0, 0.8), Ramp("opening", _SAFELY_OPEN, 1.04)),
        ),
    ),
)
assert TABLE.measures == MEASURES, "columns of `measure` are those of the table"
assert TABLE.terms["hand_behind"].zero <= CLOSED_M, "no hand is drawn behind a closed door"


@dataclass(frozen=True)
class CabinetInitialConfig:
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


@dataclass(frozen=True)
class CabinetSuccessConfig:
    """Thresholds of the two conditions.

    Attributes:
        open_fraction: of the joint's range.
        max_speed_m_s: of the target link's frame, for it to count as still.
        max_angular_speed_rad_s: likewise.
        hold_s: how long each condition must hold before it counts.
    """

    open_fraction: float
    max_speed_m_s: float
    max_angular_speed_rad_s: float
    hold_s: float

    def __post_init__(self) -> None:
        check_value(self, "open_fraction", 0 < self.open_fraction <= 1, "must lie in (0, 1]")
        check_positive(self, "max_speed_m_s", "max_angular_speed_rad_s")
        check_not_negative(self, "hold_s")


@dataclass(frozen=True)
class CabinetRewardConfig:
    """Weights and stage values.

    Attributes:
        close_distance_m: the hand is close where both finger lines are this near to the handle, and the handle
            lies between them.
        stage_bonus: least reward of each of the four stages, so low that no state earns more than 0.
        weights: term name -> weight; a term that is missing is reported with weight 0.
        ajar: the link comes to count as held while it opens over this range, 0 closed and 1 open enough: who has
            pulled it ajar may let go of the handle, and is drawn behind it. None: it never does.
    """

    close_distance_m: float
    stage_bonus: tuple[float, ...]
    weights: Mapping[str, float] = field(default_factory=dict)
    ajar: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        check_positive(self, "close_distance_m")
        if self.ajar is not None:
            check_range(self, "ajar", lowest=0.0)
            check_value(self, "ajar", self.ajar[1] <= 1, "must not go beyond 1")
        TABLE.check_weights(self.stage_bonus, self.weights)


@dataclass(frozen=True)
class CabinetStateConfig:
    """What the state vector says beyond the paper's.

    Attributes:
        handle: where the target's handle is and how it moves: see `HANDLE_FIELDS`.
    """

    handle: bool = False


@dataclass(frozen=True)
class OpenCabinetConfig(TaskConfig):
    """Everything about the task that is a value, beside what every task has.

    Attributes:
        motion: how the target moves: `prismatic` for drawers, `revolute` for doors.
        initial: ranges of initial states.
        success: what counts as open and still.
        reward: dense reward.
        state: what the state vector says.
    """

    motion: JointKind
    initial: CabinetInitialConfig
    success: CabinetSuccessConfig
    reward: CabinetRewardConfig
    state: CabinetStateConfig = CabinetStateConfig()


@dataclass(frozen=True, eq=False)
class CabinetGoal:
    """What B episodes ask for; P handle points, F hull planes, G grasp poses. Handle data in the link's frame.

    Attributes:
        row: (B,) 0 to B - 1, so that `values[goal.row, goal.link]` is each environment's own entry.
        joint: (B,) index of the target among the object's joints.
        link: (B,) index of its link.
        lower: (B,) closed joint value, m or rad.
        upper: (B,) largest joint value.
        open_qpos: (B,) joint value from which it counts as open.
        turns: (B,) whether the joint is a hinge.
        joint_axis: (B, 3) direction of opening (slides) or axis of turning (hinges).
        joint_origin: (B, 3) point on that axis.
        link_bounds: (B, 2, 3) smallest and largest corner of what is drawn of the link, handle included.
        handle_points: (B, 3, P) surface samples, one per column.
        handle_planes: (B, F, 4) convex hull, outward normal and offset.
        grasp_positions: (B, G, 3) tool-centre points.
        grasp_rotations: (B, G, 3, 3) hand orientations, columns are the hand's axes.
        grasp_width_m: (B,) extent of the handle between the pads.
        pushing_position: (B, 3) tool-centre point behind the handle, where a hand pushes a door open.
    """

    PADDING: ClassVar[Mapping[str, np.ndarray | None]] = {
        "handle_planes": _NO_PLANE,
        "grasp_positions": None,
        "grasp_rotations": None,
    }

    row: Array
    joint: Array
    link: Array
    lower: Array
    upper: Array
    open_qpos: Array
    turns: Array
    joint_axis: Array
    joint_origin: Array
    link_bounds: Array
    handle_points: Array
    handle_planes: Array
    grasp_positions: Array
    grasp_rotations: Array
    grasp_width_m: Array
    pushing_position: Array


def make_cabinet_goal(obj: ArticulatedObject, target: str, open_fraction: float) -> CabinetGoal:
    """Return the goal of opening one link of a cabinet, with B = 1; its first handle is the one that counts.

    Raises:
        UnknownNameError: the object has no such link.
        AssetError: the link has no joint, no handle or no finite limits.
    """
    link_index = obj.link_index(target)
    link, handles = obj.links[link_index], obj.handles_of(target)
    if link.joint is None or not handles:
        lacks = "no joint" if link.joint is None else "no handle"
        raise AssetError(f"object {obj.id!r}: link {target!r} cannot be a target, it has {lacks}")
    lower, upper = link.joint.limits
    if not np.isfinite((lower, upper)).all() or upper <= lower:
        raise AssetError(f"object {obj.id!r}: joint {link.joint.name!r} has the limits ({lower}, {upper})")
    handle = handles[0]
    drawn = np.concatenate([handle.points, *(visual.mesh.vertices for visual in link.visuals)])
    return CabinetGoal(
        row=np.array([0]),
        joint=np.array([obj.jointed_links.index(link_index)]),
        link=np.array([link_index]),
        lower=np.array([lower]),
        upper=np.array([upper]),
        open_qpos=np.array([lower + open_fraction * (upper - lower)]),
        turns=np.array([link.joint.kind == "revolute"]),
        joint_axis=link.joint.axis[None],
        joint_origin=link.joint.origin[None],
        link_bounds=np.stack((drawn.min(axis=0), drawn.max(axis=0)))[None],
        handle_points=np.ascontiguousarray(handle.points.T)[None],
        handle_planes=handle.planes[None],
        grasp_positions=handle.grasp_positions[None],
        grasp_rotations=quat_to_matrix(handle.grasp_quaternions)[None],
        grasp_width_m=np.array([handle.grasp_width_m]),
        pushing_position=_pushing_position(link.joint, handle)[None],
    )


def _pushing_position(joint: Joint, handle: Handle) -> np.ndarray:
    """Return the place behind a link's handle where a hand pushes it open, in the link's frame."""
    grasp = handle.grasp_positions[0]
    way = np.cross(joint.axis, grasp - joint.origin) if joint.kind == "revolute" else joint.axis
    return np.asarray(grasp - _BEHIND_M * way / max(float(norm(way)), 1e-9))  # on the hinge: the grasp


def sample_initial_state(
    obj: ArticulatedObject, rng: np.random.Generator, config: CabinetInitialConfig, robot: RobotConfig
) -> InitialState:
    """Draw a state with all joints closed, and the robot on its circle, facing the cabinet."""
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


def success_flags(snapshot: Snapshot, goal: CabinetGoal, config: CabinetSuccessConfig) -> dict[str, Array]:
    """Return the conditions of `FLAG_NAMES` as they are in this step, each (B,) bool."""
    speed, angular_speed = target_motion(snapshot, goal)
    return {
        "open_enough": snapshot.object_qpos[goal.row, goal.joint] >= goal.open_qpos,
        "cabinet_static": (speed <= config.max_speed_m_s) & (angular_speed <= config.max_angular_speed_rad_s),
    }


def reward_terms(
    snapshot: Snapshot,
    goal: CabinetGoal,
    flags: Mapping[str, Array],
    config: CabinetRewardConfig,
    success: CabinetSuccessConfig,
) -> dict[str, Array]:
    """Return the unweighted terms of `TABLE`, each (B,), given the flags of the same step."""
    slow = success.max_speed_m_s, success.max_angular_speed_rad_s
    measured = measure(snapshot, goal, Limits(config.close_distance_m, *slow, config.ajar or NEVER_AJAR))
    opening, gap, depth = (measured[:, _COLUMN[name]] for name in ("opening", "finger_gap", "depth"))
    still = flags["cabinet_static"] & (opening >= _SAFELY_OPEN)
    is_close = (gap <= 1.0) & (depth > 0)
    stage = namespace(measured).where(flags["open_enough"], 2 + still, is_close)  # (B,) 0 to 3
    return TABLE.evaluate(measured, stage, config.stage_bonus)


def observe(snapshot: Snapshot, goal: CabinetGoal, max_joints: int, state: CabinetStateConfig) -> Array:
    """Return the state vector, (B, D) float32: object, target, robot.

    Raises:
        AssetError: the object has more joints than the vector has slots.
    """
    handle_size = HANDLE_SIZE if state.handle else 0
    values, start = observe_state(snapshot, max_joints, max_joints + handle_size), object_size(max_joints)
    values[goal.row, start + goal.joint] = 1.0
    if handle_size:
        start += max_joints
        values[:, start : start + handle_size] = describe_handle(snapshot, goal)
    return values


def masks(scene: Scene, target: str) -> np.ndarray:
    """Return the masks of the target link's handles, the whole target link, and the robot: (3, G) bool.

    Raises:
        UnknownNameError: the object has no such link.
    """
    target_body = scene.index.object_bodies.start + scene.object.link_index(target)
    robot_bodies = [scene.model.body(name).id for name in scene.robot.bodies]
    body = np.array([body for body, _ in scene.visuals])
    is_handle = np.array([is_handle_part(visual.part) for _, visual in scene.visuals])
    on_target = body == target_body
    return np.stack((on_target & is_handle, on_target, np.isin(body, robot_bodies)))


def describe_progress(snapshot: Snapshot, goal: CabinetGoal) -> str:
    """Return how far the link of one episode is open, of its joint's range."""
    opened = (snapshot.object_qpos[0, goal.joint[0]] - goal.lower[0]) / (goal.upper[0] - goal.lower[0])
    return f"{round(100 * max(0.0, opened))} % open"  # a closed drawer gives a little: no "-0 %"


def make_open_cabinet(config: OpenCabinetConfig) -> Task:
    """Assemble the task; doors and drawers differ only in `config`."""
    robot, joints = config.robot, config.max_object_joints
    check_inside("initial.lift_m", config.initial.lift_m, robot.lift.range_m)
    cabinet_measures.load_kernels()
    staged_reward.load_kernel()
    one_hot = ObservationField("target joint, one-hot", joints, 1.0, "1")
    described = HANDLE_FIELDS if config.state.handle else ()
    return Task(
        config=config,
        category="cabinet",
        props=(),
        hold_steps=config.steps_of(config.success.hold_s),
        targets=lambda obj: obj.target_links(config.motion),
        make_goal=partial(make_cabinet_goal, open_fraction=config.success.open_fraction),
        sample_initial_state=partial(sample_initial_state, config=config.initial, robot=robot),
        flag_names=FLAG_NAMES,
        flags=partial(success_flags, config=config.success),
        reward_terms=partial(reward_terms, config=config.reward, success=config.success),
        reward_weights=config.reward.weights,
        reward_table=TABLE,
        observe_state=partial(observe, max_joints=joints, state=config.state),
        state_fields=state_fields(joints, len(robot.mounts), (one_hot, *described)),
        mask_names=MASK_NAMES,
        masks=masks,
        describe_progress=describe_progress,
    )
