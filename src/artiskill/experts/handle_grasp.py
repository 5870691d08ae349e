"""Taking hold of a handle: where along it, how the hand is turned, where the base stands, when fingers close.

Everything follows from what is measured in the present step. Where a decision must last, the state itself keeps
it: fingers that close go on closing, a hand that rolls one way comes nearer to that grasp than to any other.
"""

import math
from dataclasses import dataclass, fields
from enum import IntEnum
from functools import cached_property

import numpy as np

from artiskill.config import check_not_negative, check_positive, check_value
from artiskill.experts.frames import Frame, axis_rotation, ramp, rotation_error, yaw_rotation
from artiskill.experts.whole_body import TRUNK
from artiskill.geometry.arrays import arctan2, norm, small_product
from artiskill.robots.config import RobotConfig
from artiskill.robots.kinematics import RobotKinematics
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet import CabinetGoal

_HALF_HAND_M = 0.03  # of the fingers along the handle, with what they may be off; they stay so far from its ends
_AS_DEEP_M = 0.006  # what lies no further from the grasp than this, square to the handle, is as good to grip
_LAST_JOINT_RAD = 2.6  # the joint that rolls the hand goes so far to both sides, if there is a choice
_AHEAD_RAD = 1.2  # a long roll is asked for in parts, lest the hand turns the other way round, into a limit
_X, _Y, _Z = np.eye(3)
_MOST_LEAN_RAD = 0.6
_NEAR_M, _FAR_M = 0.15, 0.6  # distances from the goal: no detour from here on, all of it up to here
_LEAST_HEIGHT_M = 0.3  # of a detour: the forearm stays above the floor
_MOST_BEARING_RAD = 1.0
_SWING = 1  # the arm's joint that swings it sideways, about the vertical, at its rest posture
_MAX_TILT_SINE = 0.7
_MOST_TILTED_RAD = 0.3  # a hand that is tilted so far leans no more
# Costs of a grasp, per radian of the last joint: its way from where it is (so that a hand that has begun to roll
# goes on), and its distance from the middle of its range.
_FAR, _TWISTED = 0.5, 0.3
_NARROWED_M = 0.008  # fingers that are so much less than wide open have begun to close
_THIN_M, _EMPTY_M = 0.004, 0.001  # so much less than half of its width, or nothing, is no handle
_TOUCHING_M, _LOOSE_M = 0.003, 0.012  # beyond its width: what still counts as touching, and then as less and less
_LEAST_FIRM = 0.2
_BEFORE_M = 0.07  # nearer to the handle than this,
_LEFT_M = 0.09  # and further than this from it, a hand does not mind how wide it is open
_AJAR_M, _NARROW_M = 0.008, 0.016  # from this much narrower than wide a hand there begins to back off, and fully
_NEARLY = 1.5  # times as far aside as aligned: near enough for fingers to close, which centre the hand


class CabinetPhase(IntEnum):
    """What the hand is doing; only doors are let go, gone around and pushed."""

    APPROACH = 0
    GRIP = 1
    PULL = 2
    HOLD = 3
    RELEASE = 4
    AROUND = 5
    PUSH = 6


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
    """The default grasp, all angles 0, takes the handle's middle squarely, the hand turned as it was at rest."""

    # place along the handle, -1 to 1: how much of the way from the middle to where the fingers would come too near
    # to an end
    along: float
    roll_rad: float  # of the grasps that the hand can roll to, the one is taken that asks for about this roll
    lean_along_rad: float  # the hand leans so far, turned about the handle's length
    lean_across_rad: float  # likewise, turned about the line between the fingers
    roll_weight: float = (
        1.0  # cost of a radian by which a grasp is not the roll above; by which it is far, it is 0.5
    )

    def __post_init__(self) -> None:
        check_value(self, "along", -1 <= self.along <= 1, "must lie in [-1, 1]")
        check_value(self, "roll_rad", abs(self.roll_rad) <= math.pi, "must lie in [-pi, pi]")
        check_not_negative(self, "roll_weight")
        for name in ("lean_along_rad", "lean_across_rad"):
            rule = f"must lie in [-{_MOST_LEAN_RAD}, {_MOST_LEAN_RAD}]"
            check_value(self, name, abs(getattr(self, name)) <= _MOST_LEAN_RAD, rule)


@dataclass(frozen=True)
class GripConfig:
    """How the hand comes to a handle, and when its fingers close.

    A funnel leads the hand in: the further it is off, sideways or turned, the more of the standoff it keeps.
    """

    standoff_m: float  # the hand stops this far in front of the grasp while it is off
    aligned_m: float  # sideways error up to which it reaches in; along the handle, where it matters less, thrice
    astray_m: float  # sideways error from which it keeps all of the standoff
    aligned_rad: float  # orientation error up to which it reaches in
    astray_rad: float  # likewise, from which it keeps all of the standoff
    grasp_m: float  # distance to the grasp, forward, below which the fingers close
    # likewise for a hand that stands still: a panel or moulding behind the handle is in its way
    blocked_m: float
    still_m_s: float  # a hand that is slower stands still
    slip_m: float  # distance to the grasp above which the handle is not between the fingers
    # of each finger: those that shut at once shoot into a thin bar, and stick in it. At 0.1, so 5 mm a step, the
    # servo still pushes with all its force
    close_speed_m_s: float
    finger_clearance_m: float  # opening beyond the handle's width, each finger
    arm_reach_m: float  # horizontal distance from the shoulder to the tool in the robot's rest posture

    def __post_init__(self) -> None:
        check_positive(self, *(field.name for field in fields(self)))
        for low, high in (("aligned_m", "astray_m"), ("aligned_rad", "astray_rad")):
            check_value(self, high, getattr(self, high) > getattr(self, low), f"must exceed {low}")


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
        offset[:2] += small_product(yaw_rotation(-bearing_rad)[:2, :2], lever) - lever
        return Posture(arm, offset, bearing_rad)

    def joints(self, wanted: Frame) -> np.ndarray:
        """Base x, y and yaw, lift and arm from which the hand has a wanted pose, (11,)."""
        yaw = float(arctan2(wanted.forward[1], wanted.forward[0])) + self.bearing_rad
        base = wanted.position[:2] - small_product(yaw_rotation(yaw), self.tool_offset)[:2]
        lift = max(0.0, wanted.position[2] - self.tool_offset[2])
        return np.concatenate((base, (yaw, lift), self.arm))


def rest_posture(robot: RobotConfig) -> Posture:
    """Return the posture of the first arm that episodes begin in."""
    arm = np.asarray(robot.initial.arm_qpos_rad)
    qpos = np.concatenate((np.zeros(TRUNK), np.tile([*arm, 0.0, 0.0], len(robot.mounts))))
    return Posture(arm, RobotKinematics(robot).tools(qpos[None])[0][0, 0])


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


def grasp_pose(
    config: GraspConfig, snapshot: Snapshot, goal: CabinetGoal, last_joint: int, rest_rad: float
) -> Frame:
    """Return the pose of a hand that grips the handle (B = 1).

    Args:
        config: where and how it is gripped.
        snapshot: of this step.
        goal: what is asked for.
        last_joint: the joint that rolls the hand.
        rest_rad: where that joint is in the arm's posture.
    """
    link = int(goal.link[0])
    rotation, point = snapshot.link_rotation_w[0, link], goal.grasp_positions[0, 0]
    if config.along:
        point = point + _shift(goal, config.along)
    position = snapshot.link_position_w[0, link] + small_product(rotation, point)
    candidates = small_product(rotation, goal.grasp_rotations[0])
    now = float(snapshot.robot_qpos[0, last_joint])
    tool = snapshot.tool_rotation_w[0, 0]
    return Frame(position, nearest_roll(candidates, tool, now, rest_rad + config.roll_rad, config.roll_weight))


def leaning(frame: Frame, config: GraspConfig, tilt_rad: float) -> Frame:
    """Return a pose whose hand leans; one that is tilted, for something low, has less room to."""
    share = ramp(tilt_rad, _MOST_TILTED_RAD, 0.0)
    if not share or not (config.lean_along_rad or config.lean_across_rad):
        return frame
    lean = small_product(
        axis_rotation(_X, share * config.lean_along_rad), axis_rotation(_Y, share * config.lean_across_rad)
    )
    return Frame(frame.position, small_product(frame.rotation, lean))


def nearest_roll(
    candidates: np.ndarray, tool: np.ndarray, now_rad: float, wanted_rad: float, weight: float = 1.0
) -> np.ndarray:
    """Return the best of some rotations of the hand, (3, 3), or a part of the way there if that is long.

    Args:
        candidates: (G, 3, 3) of the hand.
        tool: (3, 3) the hand as it is.
        now_rad: where the joint is that rolls the hand.
        wanted_rad: where it should be.
        weight: cost of a radian from there.
    """
    best, chosen, turn = math.inf, candidates[0], 0.0
    relative = small_product(tool.T, candidates)
    for number, roll in enumerate(
        arctan2(relative[:, 1, 0] - relative[:, 0, 1], relative[:, 0, 0] + relative[:, 1, 1]).tolist()
    ):
        for left in (roll, roll - math.copysign(2 * math.pi, roll)):
            end = now_rad + left
            cost = weight * abs(end - wanted_rad) + _FAR * abs(left) + _TWISTED * abs(end)
            cost += 100 * max(0.0, abs(end) - _LAST_JOINT_RAD)
            if cost < best:
                best, chosen, turn = cost, candidates[number], left
    if abs(turn) > _AHEAD_RAD + math.pi / 4:
        chosen = small_product(chosen, axis_rotation(_Z, math.copysign(_AHEAD_RAD, turn) - turn))
    return chosen


def _shift(goal: CabinetGoal, share: float) -> np.ndarray:
    """Return a shift along the handle, (3,), as far as it can be gripped as deep and high as in the middle."""
    axes = goal.grasp_rotations[0, 0]
    along, across, forward = (
        small_product(axes.T, goal.handle_points[0]) - small_product(axes.T, goal.grasp_positions[0, 0])[:, None]
    )
    is_like = np.abs(across) < goal.grasp_width_m[0] / 2 + _AS_DEEP_M
    front = forward[is_like & (np.abs(along) < _HALF_HAND_M)].min(initial=math.inf)
    is_like &= forward < front + _AS_DEEP_M
    end = np.abs(along[is_like & (along * share > 0)]).max(initial=0.0)
    found: np.ndarray = axes[:, 0] * (share * max(0.0, end - _HALF_HAND_M))
    return found


def tilt_of(height_m: float, rest_height_m: float, config: GripConfig) -> float:
    """Return by how much a hand comes from above, for heights below the lift's lowest reach.

    Args:
        height_m: of the tool.
        rest_height_m: of the tool over the lift, the arm being at rest.
        config: values.
    """
    return math.asin(min(max((rest_height_m - height_m) / config.arm_reach_m, 0.0), _MAX_TILT_SINE))


def tilted(frame: Frame, tilt_rad: float) -> Frame:
    """Return a pose whose hand, which does not point straight up or down, comes from above."""
    if not tilt_rad:
        return frame
    x, y, _ = frame.forward
    return Frame(frame.position, small_product(axis_rotation(np.array((-y, x, 0.0)), tilt_rad), frame.rotation))


@dataclass(frozen=True, eq=False)
class HandAtHandle:
    """How a hand stands to its grasp, as far as the fingers' business goes.

    Attributes:
        config: values.
        error_m: (3,) from the tool's centre to the grasp in the hand's frame: along the handle, across, forward.
        turn_rad: angle to the grasp's orientation.
        speed_m_s: of the fingertips, forward.
        opening_m: between the fingers.
        width_m: of the handle between the fingers.
        wide_m: of the opening that goes around it.
    """

    config: GripConfig
    error_m: np.ndarray
    turn_rad: float
    speed_m_s: float
    opening_m: float
    width_m: float
    wide_m: float

    @cached_property
    def is_around(self) -> bool:
        """Whether the handle is between the fingers, or just before them."""
        along, across, forward = np.abs(self.error_m).tolist()
        slip = self.config.slip_m
        return bool(math.hypot(across, forward) < slip and across < 2 / 3 * slip and along < 4 / 3 * slip)

    @property
    def has_narrowed(self) -> bool:
        """Whether the fingers have begun to close."""
        return self.opening_m < self.wide_m - _NARROWED_M

    @property
    def is_filled(self) -> bool:
        """Whether the fingers are so far apart that the handle can be between them."""
        return self.opening_m > max(self.width_m / 2 - _THIN_M, _EMPTY_M)

    @property
    def holds(self) -> bool:
        """Whether the fingers close on the handle."""
        return self.is_around and self.has_narrowed and self.is_filled

    @property
    def firmness(self) -> float:
        """How firmly they hold it: 1 where they touch it on both sides; never 0, lest they wait for ever."""
        gap = self.opening_m - self.width_m
        return min(max(1.0 - (gap - _TOUCHING_M) / _LOOSE_M, _LEAST_FIRM), 1.0)

    @property
    def may_close(self) -> bool:
        """Whether it is time to begin to close the fingers."""
        along, across, forward = np.abs(self.error_m).tolist()
        config = self.config
        if self.has_narrowed:
            return False
        is_in = forward < config.grasp_m or (forward < config.blocked_m and abs(self.speed_m_s) < config.still_m_s)
        near = across < _NEARLY * config.aligned_m and along < 3 * _NEARLY * config.aligned_m
        return is_in and near and self.turn_rad < (config.aligned_rad + config.astray_rad) / 2

    @property
    def standoff(self) -> float:
        """Share of the standoff that the hand keeps: 0 when it is aligned and open, 1 when it is astray."""
        along, across, forward = self.error_m.tolist()
        config = self.config
        aside = ramp(math.hypot(along / 3, across), config.aligned_m, config.astray_m)
        turned = ramp(self.turn_rad, config.aligned_rad, config.astray_rad)
        # fingers that are too narrow would run into the handle
        narrow = ramp(self.wide_m - self.opening_m, _AJAR_M, _NARROW_M) * ramp(abs(forward), _LEFT_M, _BEFORE_M)
        return max(aside, turned, narrow)


def hand_at_handle(
    snapshot: Snapshot, grasp: Frame, width_m: float, first_finger: int, most_m: float, config: GripConfig
) -> HandAtHandle:
    """Return how the first arm's hand stands to a grasp (B = 1).

    Args:
        snapshot: of this step.
        grasp: where the hand is to be.
        width_m: of the handle.
        first_finger: the joint of the hand's first finger.
        most_m: the widest opening of the hand.
        config: values.
    """
    tool, fingers = snapshot.tool_rotation_w[0, 0], slice(first_finger, first_finger + 2)
    return HandAtHandle(
        config=config,
        error_m=small_product(tool.T, grasp.position - snapshot.tool_position_w[0, 0]),
        turn_rad=float(norm(rotation_error(tool, grasp.rotation))),
        speed_m_s=float(small_product(snapshot.fingertip_velocity_w[0, :2].mean(axis=0), tool[:, 2])),
        opening_m=float(snapshot.robot_qpos[0, fingers].sum()),
        width_m=width_m,
        wide_m=min(most_m, width_m + 2 * config.finger_clearance_m),
    )
