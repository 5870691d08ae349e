"""Taking hold of a handle: where along it, how the hand is turned, where the base stands, when fingers close."""

import math
from dataclasses import dataclass, fields, replace
from enum import Enum

import numpy as np

from artiskill.config import check_positive, check_value
from artiskill.experts.frames import Frame, axis_rotation, rotation_error, yaw_rotation
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet import CabinetGoal

_HALF_HAND_M = 0.03  # of the fingers along the handle, with what they may be off; they stay so far from its ends
_AS_DEEP_M = 0.006  # what lies no further from the grasp than this, square to the handle, is as good to grip
_LAST_JOINT_RAD = (
    2.6  # the joint that rolls the hand goes so far to both sides for a grasp that is not the nearest
)
_AHEAD_RAD = 1.2  # a long roll is asked for in parts, lest the hand turns the other way round, into a limit
_X, _Y, _Z = np.eye(3)
_MOST_LEAN_RAD = 0.6
_NEAR_M, _FAR_M = (
    0.15,
    0.6,
)  # distances from where the hand heads for: no detour from here on, all of it up to here
_LEAST_HEIGHT_M = 0.3  # of a detour: the forearm stays above the floor
_MOST_BEARING_RAD = 1.0
_SWING = 1  # the arm's joint that swings it sideways, about the vertical, at its rest posture
_MAX_TILT_SINE = 0.7


class CabinetPhase(Enum):
    """What the hand is doing; only doors are let go, gone around and pushed."""

    APPROACH = "approach"
    REACH = "reach"
    GRIP = "grip"
    PULL = "pull"
    RELEASE = "release"
    AROUND = "around"
    PUSH = "push"
    HOLD = "hold"


@dataclass(frozen=True)
class StanceConfig:
    """The default stance, all values 0, is the rest posture, straight in front of the hand's goal."""

    # until a door is let go, the base stands turned so far from where the hand points, and the arm swings back as
    # far
    bearing_rad: float
    via_side_m: float  # the hand makes a detour to its left on its way to the handle, this far at first
    via_up_m: float  # likewise, upwards

    def __post_init__(self) -> None:
        rule = f"must lie in [-{_MOST_BEARING_RAD}, {_MOST_BEARING_RAD}]"
        check_value(self, "bearing_rad", abs(self.bearing_rad) <= _MOST_BEARING_RAD, rule)
        for name in ("via_side_m", "via_up_m"):
            check_value(self, name, math.isfinite(getattr(self, name)), "must be finite")


@dataclass(frozen=True)
class GraspConfig:
    """The default grasp, all values 0, takes the handle's middle squarely, the hand turned as little as can be."""

    # place along the handle, -1 to 1: how much of the way from the middle to where the fingers would come too near
    # to an end
    along: float
    roll_rad: float  # of the grasps that the hand can roll to, the one is taken that asks for about this roll
    lean_along_rad: float  # the hand leans so far, turned about the handle's length
    lean_across_rad: float  # likewise, turned about the line between the fingers

    def __post_init__(self) -> None:
        check_value(self, "along", -1 <= self.along <= 1, "must lie in [-1, 1]")
        check_value(self, "roll_rad", abs(self.roll_rad) <= math.pi, "must lie in [-pi, pi]")
        for name in ("lean_along_rad", "lean_across_rad"):
            rule = f"must lie in [-{_MOST_LEAN_RAD}, {_MOST_LEAN_RAD}]"
            check_value(self, name, abs(getattr(self, name)) <= _MOST_LEAN_RAD, rule)


@dataclass(frozen=True)
class GripConfig:
    """When the hand goes on from one phase to the next."""

    standoff_m: float  # the hand stops this far in front of the grasp before it reaches around the handle
    aligned_m: float  # sideways error below which the hand reaches in
    aligned_rad: float  # orientation error below which the hand reaches in
    # distance to the grasp below which the fingers close; along the handle, where it matters less, three times as
    # much
    grasp_m: float
    blocked_steps: int  # after so many steps of reaching in, the fingers close where they are, if
    blocked_m: float  # the hand is at least this near: a panel or moulding behind the handle is in its way
    # after so many steps of reaching in, the hand tries again, tilted half as much: what leans forward of it has
    # met something above the handle
    patience_steps: int
    slip_m: float  # distance to the grasp above which a grip counts as lost
    grip_steps: int  # environment steps that the fingers get to close
    # of each finger: those that shut at once shoot into a thin bar, and stick in it. At 0.1, so 5 mm a step, the
    # servo still pushes with all its force
    close_speed_m_s: float
    finger_clearance_m: float  # opening beyond the handle's width, each finger
    arm_reach_m: float  # horizontal distance from the shoulder to the tool in the robot's rest posture

    def __post_init__(self) -> None:
        check_positive(self, *(field.name for field in fields(self)))


@dataclass(frozen=True, eq=False)
class Posture:
    """Where base and lift stand for a wanted pose of the hand, and how the arm is bent.

    Attributes:
        arm: (7,) its joints.
        tool_offset: (3,) of the tool from the base, in the base's frame, the lift being at 0.
        bearing_rad: yaw of the base from where the hand points.
    """

    arm: np.ndarray
    tool_offset: np.ndarray
    bearing_rad: float = 0.0

    def turned(self, bearing_rad: float, shoulder: np.ndarray) -> "Posture":
        """Return the posture with the base turned, and the arm swung back about the vertical through the shoulder.

        Args:
            bearing_rad: by so much.
            shoulder: (3,) of the arm's mount in the base's frame; its height does not matter.
        """
        arm, offset = self.arm.copy(), self.tool_offset.copy()
        arm[_SWING] -= bearing_rad
        lever = (offset - shoulder)[:2]
        offset[:2] += yaw_rotation(-bearing_rad)[:2, :2] @ lever - lever
        return Posture(arm, offset, bearing_rad)

    def joints(self, wanted: Frame) -> np.ndarray:
        """Base x, y and yaw, lift and arm from which the hand has a wanted pose, (11,)."""
        yaw = float(np.arctan2(wanted.forward[1], wanted.forward[0])) + self.bearing_rad
        base = wanted.position[:2] - (yaw_rotation(yaw) @ self.tool_offset)[:2]
        lift = max(0.0, wanted.position[2] - self.tool_offset[2])
        return np.concatenate((base, (yaw, lift), self.arm))


def approach_point(config: StanceConfig, goal: Frame, position: np.ndarray) -> np.ndarray:
    """Return where a hand goes on its way from a position to a goal, (3,): the detour fades as it comes near."""
    if not config.via_side_m and not config.via_up_m:
        return goal.position
    distance = math.dist(goal.position, position)
    share = min(max((distance - _NEAR_M) / (_FAR_M - _NEAR_M), 0.0), 1.0)
    x, y, _ = goal.forward
    left = np.array((-y, x, 0.0)) / max(math.hypot(x, y), 0.1)
    point = goal.position + share * (config.via_side_m * left + np.array((0.0, 0.0, config.via_up_m)))
    point[2] = max(point[2], min(_LEAST_HEIGHT_M, goal.position[2]))
    return point


@dataclass(frozen=True, eq=False)
class ChosenGrasp:
    """The grasp of one episode.

    Attributes:
        config: see there.
        shift: (3,) from the handle's middle to where it is gripped, in the link's frame.
        number: of the orientation; None for the one that is nearest to the hand at each instant.
        last_joint_rad: where the joint that rolls the hand will be.
    """

    config: GraspConfig
    shift: np.ndarray
    number: int | None = None
    last_joint_rad: float = 0.0

    @property
    def is_default(self) -> bool:
        """Whether it is `default_grasp()`."""
        leans = self.config.lean_along_rad or self.config.lean_across_rad
        return not (leans or self.shift.any()) and self.number is None

    def on(self, goal: CabinetGoal) -> CabinetGoal:
        """Return the goal with its grasps where the handle is gripped."""
        if not self.shift.any():
            return goal
        return replace(goal, grasp_positions=goal.grasp_positions + self.shift)

    def frame(self, snapshot: Snapshot, goal: CabinetGoal, last_joint: int) -> Frame:
        """Return the grasp pose in the world (B = 1); `goal` as `on` returns it, `last_joint` rolls the hand."""
        position, candidates = _grasps(snapshot, goal)
        if self.number is None:
            likeness = np.einsum("gij,ij->g", candidates, snapshot.tool_rotation_w[0, 0])
            return Frame(position, candidates[int(np.argmax(likeness))])
        rotation = candidates[self.number]
        left = self.last_joint_rad - float(snapshot.robot_qpos[0, last_joint])
        if abs(left) > _AHEAD_RAD + math.pi / 4:
            rotation = rotation @ axis_rotation(_Z, math.copysign(_AHEAD_RAD, left) - left)
        return Frame(position, rotation)

    def leaning(self, frame: Frame) -> Frame:
        """Return a pose whose hand leans as the configuration says."""
        config, rotation = self.config, frame.rotation
        if config.lean_along_rad:
            rotation = rotation @ axis_rotation(_X, config.lean_along_rad)
        if config.lean_across_rad:
            rotation = rotation @ axis_rotation(_Y, config.lean_across_rad)
        return frame if rotation is frame.rotation else Frame(frame.position, rotation)


def default_grasp() -> ChosenGrasp:
    """In the handle's middle, squarely, with the hand as little turned as can be."""
    return ChosenGrasp(GraspConfig(along=0.0, roll_rad=0.0, lean_along_rad=0.0, lean_across_rad=0.0), np.zeros(3))


def choose_grasp(config: GraspConfig, snapshot: Snapshot, goal: CabinetGoal, last_joint: int) -> ChosenGrasp:
    """Return the grasp of an episode at its first state (B = 1); `last_joint` rolls the hand."""
    shift = np.zeros(3) if not config.along else _shift(goal, config.along)
    if not config.roll_rad:
        return ChosenGrasp(config, shift)
    tool = snapshot.tool_rotation_w[0, 0]
    now = float(snapshot.robot_qpos[0, last_joint])
    _, candidates = _grasps(snapshot, goal)
    best, found = math.inf, ChosenGrasp(config, shift)
    for number, candidate in enumerate(candidates):
        relative = tool.T @ candidate
        roll = math.atan2(relative[1, 0], relative[0, 0])
        for turn in (roll, roll - math.copysign(2 * math.pi, roll)):
            off = abs(turn - config.roll_rad)
            if abs(now + turn) <= _LAST_JOINT_RAD and off < best:
                best, found = off, ChosenGrasp(config, shift, number, now + turn)
    return found


def _grasps(snapshot: Snapshot, goal: CabinetGoal) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) and all orientations (G, 3, 3) in the world."""
    link = int(goal.link[0])
    rotation = snapshot.link_rotation_w[0, link]
    position = snapshot.link_position_w[0, link] + rotation @ goal.grasp_positions[0, 0]
    return position, rotation @ goal.grasp_rotations[0]


def _shift(goal: CabinetGoal, share: float) -> np.ndarray:
    """Return a shift along the handle, (3,), as far as it can be gripped as deep and high as in the middle."""
    axes = goal.grasp_rotations[0, 0]
    along, across, forward = axes.T @ goal.handle_points[0] - (axes.T @ goal.grasp_positions[0, 0])[:, None]
    is_like = np.abs(across) < goal.grasp_width_m[0] / 2 + _AS_DEEP_M
    front = forward[is_like & (np.abs(along) < _HALF_HAND_M)].min(initial=math.inf)
    is_like &= forward < front + _AS_DEEP_M
    end = np.abs(along[is_like & (along * share > 0)]).max(initial=0.0)
    found: np.ndarray = axes[:, 0] * (share * max(0.0, end - _HALF_HAND_M))
    return found


def tilted(frame: Frame, share: float, rest_height_m: float, config: GripConfig) -> Frame:
    """Return a pose whose hand comes from above, for heights below the lift's lowest reach.

    Args:
        frame: the pose, not pointing straight up or down.
        share: of the tilt of an arm that keeps its shape.
        rest_height_m: of the tool over the lift, the arm being at rest.
        config: values.
    """
    drop = share * np.clip((rest_height_m - frame.position[2]) / config.arm_reach_m, 0.0, _MAX_TILT_SINE)
    if drop <= 0:
        return frame
    x, y, _ = frame.forward
    return Frame(frame.position, axis_rotation(np.array((-y, x, 0.0)), float(np.arcsin(drop))) @ frame.rotation)


def after_approach(tool: Frame, grasp: Frame, config: GripConfig) -> CabinetPhase:
    """Return whether the hand stands before the handle."""
    error, angle = _errors(tool, grasp)
    aligned = float(np.hypot(error[0], error[1])) < config.aligned_m and angle < config.aligned_rad
    near = error[2] < 2 * config.standoff_m
    return CabinetPhase.REACH if aligned and near else CabinetPhase.APPROACH


def after_reach(tool: Frame, grasp: Frame, steps: int, patience_steps: int, config: GripConfig) -> CabinetPhase:
    """Return the phase after so many steps of reaching in: the fingers close, it goes on, or it tries again."""
    error, angle = _errors(tool, grasp)
    along, across, forward = np.abs(error)
    lost = across > 3 * config.aligned_m or angle > 3 * config.aligned_rad
    if lost or steps >= patience_steps:
        return CabinetPhase.APPROACH
    near = across < config.grasp_m and along < 3 * config.grasp_m
    blocked = steps >= config.blocked_steps and forward < config.blocked_m
    return CabinetPhase.GRIP if near and (forward < config.grasp_m or blocked) else CabinetPhase.REACH


def has_slipped(tool: Frame, grasp: Frame, config: GripConfig) -> bool:
    """Return whether a closed hand holds the handle no more."""
    error, _ = _errors(tool, grasp)
    return float(np.linalg.norm(error[1:])) > config.slip_m


def _errors(tool: Frame, grasp: Frame) -> tuple[np.ndarray, float]:
    """Return the error in the hand's frame, (3,), x along the handle and z forward; and that of rotation."""
    error = tool.rotation.T @ (grasp.position - tool.position)
    return error, float(np.linalg.norm(rotation_error(tool.rotation, grasp.rotation)))
