"""How actions become drive targets: what their numbers mean, the two control modes, and what is refused."""

from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

from artiskill.errors import ActionError, shown
from artiskill.geometry.arrays import clip
from artiskill.robots.arm_config import load_arm
from artiskill.robots.config import RobotConfig
from artiskill.robots.operational_space import (
    OperationalSpace,
    hand_jacobians,
    load_kernels,
    operational_half_range,
)
from artiskill.sim.snapshot import Snapshot

JOINT, OPERATIONAL = "joint", "operational_space"
CONTROL_MODES: tuple[str, ...] = (JOINT, OPERATIONAL)


class Control:
    """Converts actions in [-1, 1] to drive targets and back, in one of `CONTROL_MODES`; both ways clip.

    Both modes have as many numbers: base x, y, yaw and lift, then nine per arm. In `joint` these are seven joint
    velocities and two finger positions; in `operational_space` the hand's twist in its own frame (linear, then
    angular), the rate of the arm's null motion, and the same two finger positions.

    Args:
        robot: who acts.
        mode: one of `CONTROL_MODES`.
    """

    def __init__(self, robot: RobotConfig, mode: str) -> None:
        self.mode = mode
        self.joint_scale = action_scale(robot)
        self.scale = self.joint_scale
        self._space: OperationalSpace | None = None
        if mode == OPERATIONAL:
            load_kernels()
            self._space = OperationalSpace(robot)
            self.scale = _operational_scale(robot, self.joint_scale)

    @property
    def size(self) -> int:
        """How many numbers an action has."""
        return int(self.scale.center.size)

    @property
    def space(self) -> gym.spaces.Box:
        """The space of actions."""
        return gym.spaces.Box(-1.0, 1.0, (self.size,), np.float32)

    def to_targets(self, actions: np.ndarray, snapshot: Snapshot) -> np.ndarray:
        """Return drive targets of actions, (B, A) -> (B, A), clipped to the range of `joint_scale`."""
        values = self.scale.to_targets(actions)
        if self._space is None:
            return values
        joint = self._space.to_joint(values, jacobians(snapshot))
        scale = self.joint_scale
        return clip(joint, scale.center - scale.half_range, scale.center + scale.half_range)

    def of_joint_action(self, action: np.ndarray, snapshot: Snapshot) -> np.ndarray:
        """Return the action (A,) of this mode with the drive targets of a `joint` action (R,); B = 1."""
        if self._space is None:
            return action
        actions: np.ndarray = self.to_actions(self.joint_scale.to_targets(action[None]), snapshot)
        return actions[0]

    def to_actions(self, targets: np.ndarray, snapshot: Snapshot) -> np.ndarray:
        """Return the actions that give drive targets, (B, A) -> (B, A), clipped to [-1, 1]."""
        if self._space is not None:
            targets = self._space.to_operational(targets, jacobians(snapshot))
        return self.scale.to_actions(targets)


@dataclass(frozen=True, eq=False)
class ActionScale:
    """Affine map from actions (..., R) in [-1, 1] to drive targets (..., R).

    Targets are velocities (m/s, rad/s; the base's in its own frame) and, for fingers, positions (m).

    Attributes:
        center: (R,) target of action 0.
        half_range: (R,) target difference of action 1.
    """

    center: np.ndarray
    half_range: np.ndarray

    def to_targets(self, actions: np.ndarray) -> np.ndarray:
        """Return drive targets of actions, which are clipped to [-1, 1]. (..., R) -> (..., R)."""
        return self.center + self.half_range * clip(actions, -1.0, 1.0)

    def to_actions(self, targets: np.ndarray) -> np.ndarray:
        """Return actions of drive targets, clipped to [-1, 1]. (..., R) -> (..., R)."""
        return clip((targets - self.center) / self.half_range, -1.0, 1.0)


def action_scale(config: RobotConfig) -> ActionScale:
    """Return the map of a robot, in the order of `RobotPart.joints`."""
    actions, (lower, upper) = config.actions, load_arm(config.arm).finger.range_m
    trunk = [actions.base_velocity_m_s] * 2 + [actions.yaw_rate_rad_s, actions.lift_velocity_m_s]
    arm = [actions.arm_velocity_rad_s] * len(config.initial.arm_qpos_rad) + [(upper - lower) / 2] * 2
    arm_center = [0.0] * len(config.initial.arm_qpos_rad) + [(upper + lower) / 2] * 2
    count = len(config.mounts)
    return ActionScale(np.array([0.0] * 4 + arm_center * count), np.array(trunk + arm * count))


def _operational_scale(robot: RobotConfig, joint: ActionScale) -> ActionScale:
    half_range, arm = joint.half_range.copy(), operational_half_range(robot)
    per_arm = (half_range.size - 4) // len(robot.mounts)
    for start in range(4, half_range.size, per_arm):
        half_range[start : start + arm.size] = arm
    return ActionScale(joint.center, half_range)


def jacobians(snapshot: Snapshot) -> np.ndarray:
    """Return the `hand_jacobians` of a snapshot, (B, A, 6, 7)."""
    return hand_jacobians(
        snapshot.robot_joint_anchor_w,
        snapshot.robot_joint_axis_w,
        snapshot.tool_position_w,
        snapshot.tool_rotation_w,
    )


def check_action(action: object, size: int) -> np.ndarray:
    """Return an action as a float64 array.

    Raises:
        ActionError: it is not `size` finite numbers.
    """
    array = _real_numbers(action, f"an action is {size} real numbers")
    if array.shape != (size,):
        raise ActionError(f"an action has shape ({size},), not {array.shape}")
    if not np.isfinite(array).all():
        bad = np.flatnonzero(~np.isfinite(array)).tolist()
        raise ActionError(f"an action has finite numbers; entries {bad} are {array[bad].tolist()}")
    return array


def check_actions(actions: object, num_envs: int, size: int) -> np.ndarray:
    """Return actions of a vector of environments as a float64 array.

    Raises:
        ActionError: they are not `num_envs` rows of `size` finite numbers.
    """
    array = _real_numbers(actions, f"actions are real numbers of shape ({num_envs}, {size})")
    if array.shape != (num_envs, size):
        raise ActionError(f"actions have shape ({num_envs}, {size}), not {array.shape}")
    finite = np.isfinite(array).all(axis=1)
    if not finite.all():
        raise ActionError(
            f"actions have finite numbers; not so those of environments {np.flatnonzero(~finite).tolist()}"
        )
    return array


def _real_numbers(given: Any, rule: str) -> np.ndarray:
    try:
        is_complex = np.iscomplexobj(given)  # NumPy would drop the imaginary parts with no more than a warning
        array = np.zeros(0) if is_complex else np.asarray(given, dtype=np.float64)
    except Exception as error:  # what a foreign type raises when it is no array cannot be listed
        raise ActionError(f"{rule}, not {shown(given)}") from error
    if is_complex:
        raise ActionError(f"{rule}, not complex ones")
    return array
