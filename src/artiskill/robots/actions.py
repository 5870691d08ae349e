"""What actions mean: [-1, 1] per joint to drive targets, and back."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.errors import ActionError, shown
from artiskill.geometry.arrays import clip
from artiskill.robots.arm_config import load_arm
from artiskill.robots.config import RobotConfig


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
        """Drive targets of actions, which are clipped to [-1, 1]. (..., R) -> (..., R)."""
        return self.center + self.half_range * clip(actions, -1.0, 1.0)

    def to_actions(self, targets: np.ndarray) -> np.ndarray:
        """Actions of drive targets, clipped to [-1, 1]. (..., R) -> (..., R)."""
        return clip((targets - self.center) / self.half_range, -1.0, 1.0)


def action_scale(config: RobotConfig) -> ActionScale:
    """The map of a robot, in the order of `RobotPart.joints`."""
    actions, (lower, upper) = config.actions, load_arm(config.arm).finger.range_m
    trunk = [actions.base_velocity_m_s] * 2 + [actions.yaw_rate_rad_s, actions.lift_velocity_m_s]
    arm = [actions.arm_velocity_rad_s] * len(config.initial.arm_qpos_rad) + [(upper - lower) / 2] * 2
    arm_center = [0.0] * len(config.initial.arm_qpos_rad) + [(upper + lower) / 2] * 2
    count = len(config.mounts)
    return ActionScale(np.array([0.0] * 4 + arm_center * count), np.array(trunk + arm * count))


def check_action(action: object, size: int) -> np.ndarray:
    """An action as a float64 array.

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
    """Actions of a vector of environments as a float64 array.

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
