"""Disturbances: now and then the robot is pushed off its way for a moment, and the expert has to find back.

A policy that is trained on undisturbed demonstrations never sees what to do beside the way. Noise in bursts shows
it, and leaves most actions what the expert wants. After Laskey et al., "DART: Noise Injection for Robust Imitation
Learning", CoRL 2017, where noise is in every action.
"""

from dataclasses import dataclass

import numpy as np

from artiskill.config import check_not_negative, check_value

_TRUNK = 4  # base x, y and yaw; then the lift
_FINGERS = 2
_LONGEST_STEPS = 8
_CLOSED = -0.99  # an action that asks a finger to go this far closes the hand


@dataclass(frozen=True)
class DisturbanceConfig:
    """When the robot is pushed, and how far.

    Each push moves base, lift and arms in random directions, each by a random share of its most. Fingers are left
    alone: what is held is not let go.

    Attributes:
        gap_steps: fewest and most steps before each push.
        burst_steps: fewest and most steps that a push takes.
        base_m: by which a push moves the base at most, if the expert does not steer against it.
        yaw_rad: likewise, turns the base.
        lift_m: likewise, moves the lift.
        arm_rad: likewise, moves the joints of an arm: the length of the vector of their angles.
        gripping: share of all that while a hand is closed.
    """

    gap_steps: tuple[int, int]
    burst_steps: tuple[int, int]
    base_m: float
    yaw_rad: float
    lift_m: float
    arm_rad: float
    gripping: float = 1.0

    def __post_init__(self) -> None:
        for name, least in (("gap_steps", 0), ("burst_steps", 1)):
            low, high = getattr(self, name)
            check_value(self, name, least <= low <= high, f"must be two rising whole numbers from {least} on")
        most = f"must not exceed {_LONGEST_STEPS}: more is a drift, not a push"
        check_value(self, "burst_steps", self.burst_steps[1] <= _LONGEST_STEPS, most)
        check_not_negative(self, "base_m", "yaw_rad", "lift_m", "arm_rad", "gripping")


class Disturbance:
    """The pushes of one episode.

    Args:
        config: see there.
        half_range: (R,) velocities that an action of 1 asks for, in the control mode `joint`.
        arms: of the robot.
        step_s: duration of a step.
        rng: what draws.
    """

    def __init__(
        self, config: DisturbanceConfig, half_range: np.ndarray, arms: int, step_s: float, rng: np.random.Generator
    ) -> None:
        self._config, self._rng = config, rng
        self._to_action = 1.0 / (half_range * step_s)  # way per step -> action
        self._arms, self._per_arm = arms, (len(half_range) - _TRUNK) // arms
        starts = range(len(half_range) - _FINGERS, _TRUNK, -self._per_arm)
        self._fingers = [start + k for start in starts for k in range(_FINGERS)]
        self._gap = self._whole(config.gap_steps)
        self._shape = np.zeros(0)  # of the present push: shares of the way that its steps make
        self._way = np.zeros(len(half_range))
        self._step = 0

    def next(self, wanted: np.ndarray) -> np.ndarray | None:
        """What to add to the next action (R,), the wanted one, (R,); None for nothing."""
        if self._gap:
            self._gap -= 1
            return None
        if self._step == len(self._shape):
            self._begin()
        offset: np.ndarray = self._shape[self._step] * self._way * self._to_action
        if float(wanted[self._fingers].min()) <= _CLOSED:
            offset *= self._config.gripping
        self._step += 1
        if self._step == len(self._shape):
            self._gap = self._whole(self._config.gap_steps)
        return offset

    def _begin(self) -> None:
        """Draw a push: it swells and ebbs, for what is hit gives way smoothly."""
        config, way = self._config, np.zeros_like(self._way)
        steps = self._whole(config.burst_steps)
        swell = np.sin(np.pi * (np.arange(steps) + 0.5) / steps)
        self._shape, self._step = swell / swell.sum(), 0
        way[:2] = self._direction(2) * config.base_m
        way[2] = self._direction(1)[0] * config.yaw_rad
        way[3] = self._direction(1)[0] * config.lift_m
        joints = self._per_arm - _FINGERS
        for arm in range(self._arms):
            start = _TRUNK + arm * self._per_arm
            way[start : start + joints] = self._direction(joints) * config.arm_rad
        self._way = way

    def _direction(self, size: int) -> np.ndarray:
        """(size,) of random direction, and of length 0 to 1."""
        found = self._rng.standard_normal(size)
        length: float = self._rng.uniform()
        return length * found / max(float(np.linalg.norm(found)), 1e-9)

    def _whole(self, limits: tuple[int, int]) -> int:
        return int(self._rng.integers(limits[0], limits[1] + 1))
