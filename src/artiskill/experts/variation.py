"""What makes demonstrations differ from episode to episode: the expert's values vary, and it is pushed.

Any number of the expert's configuration may vary; experts know nothing of it. And now and then the robot is pushed
off its way for a moment, and the expert has to find back: a policy that is trained on undisturbed demonstrations
never sees what to do beside the way. Pushes come in bursts and leave most actions what the expert wants. After
Laskey et al., "DART: Noise Injection for Robust Imitation Learning", CoRL 2017, where noise is in every action.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from artiskill.config import (
    check,
    check_not_negative,
    check_value,
    from_mapping,
    load_config,
    to_mapping,
)
from artiskill.errors import ConfigError, UnknownNameError
from artiskill.geometry.arrays import norm
from artiskill.tasks.registry import task_spec

T = TypeVar("T")
_TRUNK = 4  # base x, y and yaw; then the lift
_FINGERS = 2
_LONGEST_STEPS = 8
_CLOSED = -0.99  # an action that asks a finger to go this far closes the hand


@dataclass(frozen=True)
class DisturbanceConfig:
    """When the robot is pushed, and how far.

    Each push moves base, lift and arms in random directions, each by a random share of its most. Fingers are left
    alone: what is held is not let go.
    """

    gap_steps: tuple[int, int]  # fewest and most steps before each push
    burst_steps: tuple[int, int]  # fewest and most steps that a push takes
    base_m: float  # by which a push moves the base at most, if the expert does not steer against it
    yaw_rad: float  # likewise, turns the base
    lift_m: float  # likewise, moves the lift
    arm_rad: float  # likewise, moves the joints of an arm: the length of the vector of their angles
    gripping: float = 1.0  # share of all that while a hand is closed

    def __post_init__(self) -> None:
        for name, least in (("gap_steps", 0), ("burst_steps", 1)):
            low, high = getattr(self, name)
            check_value(self, name, least <= low <= high, f"must be two rising whole numbers from {least} on")
        most = f"must not exceed {_LONGEST_STEPS}: more is a drift, not a push"
        check_value(self, "burst_steps", self.burst_steps[1] <= _LONGEST_STEPS, most)
        check_not_negative(self, "base_m", "yaw_rad", "lift_m", "arm_rad", "gripping")


@dataclass(frozen=True)
class VariationConfig:
    """How the episodes of a task differ in the way that the expert goes about them."""

    # dotted key of the expert's configuration -> lowest and highest value, drawn uniformly; whole numbers are
    # rounded. A number in a list is `carry_m.0`
    ranges: dict[str, tuple[float, float]]
    disturbance: DisturbanceConfig  # what pushes the robot off its way

    def __post_init__(self) -> None:
        for key, (low, high) in self.ranges.items():
            legal = -math.inf < low <= high < math.inf
            check(legal, f"ranges: {key} must have a lower and a higher number, not {[low, high]}")


def load_variation(task: str) -> VariationConfig:
    """Read the variation of a task, as it was registered.

    Raises:
        UnknownNameError: there is no such task.
        ConfigError: the task has none.
    """
    file = task_spec(task).variation_file
    if file is None:
        raise ConfigError(
            f"{task} has no variation file, which says how demonstrations vary: register it with variation_file= "
            "or like=, or collect with --plain (variety=False)"
        )
    return load_config(VariationConfig, Path(file))


def varied(config: T, ranges: Mapping[str, tuple[float, float]], rng: np.random.Generator) -> T:
    """Return a configuration with some of its values drawn, one after the other, from their ranges.

    Args:
        config: a dataclass; it stays as it is.
        ranges: as in `VariationConfig`.
        rng: what draws.

    Raises:
        UnknownNameError: a key that leads to no number.
        ConfigError: a value that the configuration refuses.
    """
    values = to_mapping(config)
    for key, (low, high) in ranges.items():
        drawn = float(rng.uniform(low, high))
        place, last = _place(values, key)
        place[last] = round(drawn) if isinstance(place[last], int) else drawn
    return from_mapping(type(config), values, "a varied expert")


def _place(values: dict[str, Any], key: str) -> tuple[Any, Any]:
    """Mapping or list that holds the number of a dotted key, and where in it the number is."""
    place: Any = values
    parts = key.split(".")
    for part in parts[:-1]:
        place = _keyed(place).get(part)
    found = _keyed(place)
    last = parts[-1]
    if not isinstance(found.get(last), int | float) or isinstance(found[last], bool):
        raise UnknownNameError("key of a varied expert", key, numbers_of(values))
    return place, int(last) if isinstance(place, list) else last


def numbers_of(values: Any, prefix: str = "") -> list[str]:
    """Dotted keys of all numbers in plain values."""
    found = []
    for key, value in _keyed(values).items():
        if isinstance(value, dict | list):
            found += numbers_of(value, f"{prefix}{key}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            found.append(f"{prefix}{key}")
    return found


def _keyed(values: Any) -> dict[str, Any]:
    """Return a mapping as it is, a list by number, anything else as nothing."""
    if isinstance(values, list):
        return {str(k): value for k, value in enumerate(values)}
    return values if isinstance(values, dict) else {}


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
        """Return what to add to the next action (R,), the wanted one, (R,); None for nothing."""
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
        """Return (size,): of random direction, and of length 0 to 1."""
        found = self._rng.standard_normal(size)
        length: float = self._rng.uniform()
        return length * found / max(float(norm(found)), 1e-9)

    def _whole(self, limits: tuple[int, int]) -> int:
        return int(self._rng.integers(limits[0], limits[1] + 1))
