"""Which of the many ways to take hold of a handle: where along it, which way round, and leaning how far."""

import math
from dataclasses import dataclass, replace

import numpy as np

from artiskill.config import check_value
from artiskill.experts.frames import Frame, axis_rotation
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


@dataclass(frozen=True)
class GraspConfig:
    """The usual grasp, all values 0, takes the handle's middle squarely, with the hand as little turned as can be.

    Attributes:
        along: place along the handle, -1 to 1: how much of the way from the middle to where the fingers would come
            too near to an end.
        roll_rad: of the grasps that the hand can roll to, the one is taken that asks for about this roll.
        lean_along_rad: the hand leans so far, turned about the handle's length.
        lean_across_rad: likewise, turned about the line between the fingers.
    """

    along: float
    roll_rad: float
    lean_along_rad: float
    lean_across_rad: float

    def __post_init__(self) -> None:
        check_value(self, "along", -1 <= self.along <= 1, "must lie in [-1, 1]")
        check_value(self, "roll_rad", abs(self.roll_rad) <= math.pi, "must lie in [-pi, pi]")
        for name in ("lean_along_rad", "lean_across_rad"):
            rule = f"must lie in [-{_MOST_LEAN_RAD}, {_MOST_LEAN_RAD}]"
            check_value(self, name, abs(getattr(self, name)) <= _MOST_LEAN_RAD, rule)


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
    def is_usual(self) -> bool:
        """Whether it is `usual_grasp()`."""
        leans = self.config.lean_along_rad or self.config.lean_across_rad
        return not (leans or self.shift.any()) and self.number is None

    def on(self, goal: CabinetGoal) -> CabinetGoal:
        """The goal with its grasps where the handle is gripped."""
        if not self.shift.any():
            return goal
        return replace(goal, grasp_positions=goal.grasp_positions + self.shift)

    def frame(self, snapshot: Snapshot, goal: CabinetGoal, last_joint: int) -> Frame:
        """The grasp pose in the world (B = 1); `goal` as `on` returns it, `last_joint` rolls the hand."""
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
        """A pose whose hand leans as the configuration says."""
        config, rotation = self.config, frame.rotation
        if config.lean_along_rad:
            rotation = rotation @ axis_rotation(_X, config.lean_along_rad)
        if config.lean_across_rad:
            rotation = rotation @ axis_rotation(_Y, config.lean_across_rad)
        return frame if rotation is frame.rotation else Frame(frame.position, rotation)


def usual_grasp() -> ChosenGrasp:
    """In the handle's middle, squarely, with the hand as little turned as can be."""
    return ChosenGrasp(GraspConfig(along=0.0, roll_rad=0.0, lean_along_rad=0.0, lean_across_rad=0.0), np.zeros(3))


def choose_grasp(config: GraspConfig, snapshot: Snapshot, goal: CabinetGoal, last_joint: int) -> ChosenGrasp:
    """The grasp of an episode at its first state (B = 1); `last_joint` rolls the hand."""
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
    """(3,) along the handle, as far as there is something to grip that is as deep and as high as the middle is."""
    axes = goal.grasp_rotations[0, 0]
    along, across, forward = axes.T @ goal.handle_points[0] - (axes.T @ goal.grasp_positions[0, 0])[:, None]
    is_like = np.abs(across) < goal.grasp_width_m[0] / 2 + _AS_DEEP_M
    front = forward[is_like & (np.abs(along) < _HALF_HAND_M)].min(initial=math.inf)
    is_like &= forward < front + _AS_DEEP_M
    end = np.abs(along[is_like & (along * share > 0)]).max(initial=0.0)
    found: np.ndarray = axes[:, 0] * (share * max(0.0, end - _HALF_HAND_M))
    return found
