"""How actions become drive targets: the two action interfaces of an environment."""

from typing import Any

import gymnasium as gym
import numpy as np

from artiskill.geometry.arrays import clip
from artiskill.robots.actions import ActionScale, action_scale, check_action
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
    """Actions in [-1, 1] to drive targets and back, in one of `CONTROL_MODES`; both ways clip to what is legal.

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

    def check(self, action: Any) -> np.ndarray:
        """An action as (A,) float64.

        Raises:
            ActionError: not as many finite numbers.
        """
        return check_action(action, self.size)

    def to_targets(self, actions: np.ndarray, snapshot: Snapshot) -> np.ndarray:
        """Drive targets of actions, (B, A) -> (B, A), which are clipped to what the drives are asked at most."""
        values = self.scale.to_targets(actions)
        if self._space is None:
            return values
        joint = self._space.to_joint(values, jacobians(snapshot))
        scale = self.joint_scale
        return clip(joint, scale.center - scale.half_range, scale.center + scale.half_range)

    def of_joint_action(self, action: np.ndarray, snapshot: Snapshot) -> np.ndarray:
        """The action (A,) of this mode that asks for what a `joint` action (R,) does; the instant has B = 1."""
        if self._space is None:
            return action
        actions: np.ndarray = self.to_actions(self.joint_scale.to_targets(action[None]), snapshot)
        return actions[0]

    def to_actions(self, targets: np.ndarray, snapshot: Snapshot) -> np.ndarray:
        """The actions that ask for drive targets, (B, A) -> (B, A), clipped to [-1, 1]."""
        if self._space is not None:
            targets = self._space.to_operational(targets, jacobians(snapshot))
        return self.scale.to_actions(targets)


def jacobians(snapshot: Snapshot) -> np.ndarray:
    """`hand_jacobians` of an instant, (B, A, 6, 7)."""
    return hand_jacobians(
        snapshot.robot_joint_anchor_w,
        snapshot.robot_joint_axis_w,
        snapshot.tool_position_w,
        snapshot.tool_rotation_w,
    )


def _operational_scale(robot: RobotConfig, joint: ActionScale) -> ActionScale:
    half_range, arm = joint.half_range.copy(), operational_half_range(robot)
    per_arm = (half_range.size - 4) // len(robot.mounts)
    for start in range(4, half_range.size, per_arm):
        half_range[start : start + arm.size] = arm
    return ActionScale(joint.center, half_range)
