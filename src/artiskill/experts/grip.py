"""Taking hold of a handle: how to come near, and when the fingers may close."""

from dataclasses import dataclass, fields
from enum import Enum

import numpy as np

from artiskill.config import check_positive
from artiskill.experts.frames import Frame, axis_rotation, rotation_error

_MAX_TILT_SINE = 0.7


class Phase(Enum):
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
class GripConfig:
    """When the hand goes on from one phase to the next.

    Attributes:
        standoff_m: the hand stops this far in front of the grasp before it reaches around the handle.
        aligned_m: sideways error below which the hand reaches in.
        aligned_rad: orientation error below which the hand reaches in.
        grasp_m: distance to the grasp below which the fingers close; along the handle, where it matters less,
            three times as much.
        blocked_steps: after so many steps of reaching in, the fingers close where they are, if
        blocked_m: the hand is at least this near: a panel or moulding behind the handle is in its way.
        patience_steps: after so many steps of reaching in, the hand tries again, tilted half as much: what leans
            forward of it has met something above the handle.
        slip_m: distance to the grasp above which a grip counts as lost.
        grip_steps: environment steps that the fingers get to close.
        close_speed_m_s: of each finger: those that shut at once shoot into a thin bar, and stick in it. At 0.1, so
            5 mm a step, the servo still pushes with all its force.
        finger_clearance_m: opening beyond the handle's width, each finger.
        arm_reach_m: horizontal distance from the shoulder to the tool in the robot's rest posture.
    """

    standoff_m: float
    aligned_m: float
    aligned_rad: float
    grasp_m: float
    blocked_steps: int
    blocked_m: float
    patience_steps: int
    slip_m: float
    grip_steps: int
    close_speed_m_s: float
    finger_clearance_m: float
    arm_reach_m: float

    def __post_init__(self) -> None:
        check_positive(self, *(field.name for field in fields(self)))


def tilted(frame: Frame, share: float, rest_height_m: float, config: GripConfig) -> Frame:
    """A pose whose hand comes from above: the shoulder swings it down to heights below the lift's lowest reach.

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


def after_approach(tool: Frame, grasp: Frame, config: GripConfig) -> Phase:
    """Whether the hand stands before the handle."""
    error, angle = _errors(tool, grasp)
    aligned = float(np.hypot(error[0], error[1])) < config.aligned_m and angle < config.aligned_rad
    near = error[2] < 2 * config.standoff_m
    return Phase.REACH if aligned and near else Phase.APPROACH


def after_reach(tool: Frame, grasp: Frame, steps: int, patience_steps: int, config: GripConfig) -> Phase:
    """Whether the handle lies between the fingers, after so many steps of reaching in; how many there may be."""
    error, angle = _errors(tool, grasp)
    along, across, forward = np.abs(error)
    lost = across > 3 * config.aligned_m or angle > 3 * config.aligned_rad
    if lost or steps >= patience_steps:
        return Phase.APPROACH
    near = across < config.grasp_m and along < 3 * config.grasp_m
    blocked = steps >= config.blocked_steps and forward < config.blocked_m
    return Phase.GRIP if near and (forward < config.grasp_m or blocked) else Phase.REACH


def has_slipped(tool: Frame, grasp: Frame, config: GripConfig) -> bool:
    """Whether a closed hand holds the handle no more."""
    error, _ = _errors(tool, grasp)
    return float(np.linalg.norm(error[1:])) > config.slip_m


def _errors(tool: Frame, grasp: Frame) -> tuple[np.ndarray, float]:
    """(3,) in the hand's frame, x along the handle and z forward; and the angle between the orientations."""
    error = tool.rotation.T @ (grasp.position - tool.position)
    return error, float(np.linalg.norm(rotation_error(tool.rotation, grasp.rotation)))
