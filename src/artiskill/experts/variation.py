"""Manners: values of an expert's configuration that differ from episode to episode, and so do demonstrations.

What may vary is a number of the expert's own configuration, drawn anew for every episode. Experts know nothing of
it.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from artiskill.config import CONFIG_DIR, check, from_mapping, load_config, to_mapping
from artiskill.errors import UnknownNameError
from artiskill.experts.disturbance import DisturbanceConfig

T = TypeVar("T")
_WORD = re.compile(r"(?<!^)(?=[A-Z])")


@dataclass(frozen=True)
class VariationConfig:
    """How the episodes of a task differ in the way that the expert goes about them.

    Attributes:
        ranges: dotted key of the expert's configuration -> lowest and highest value, drawn uniformly; whole
            numbers are rounded. A number in a list is `carry_m.0`.
        disturbance: what pushes the robot off its way.
    """

    ranges: dict[str, tuple[float, float]]
    disturbance: DisturbanceConfig

    def __post_init__(self) -> None:
        for key, (low, high) in self.ranges.items():
            legal = -math.inf < low <= high < math.inf
            check(legal, f"ranges: {key} must have a lower and a higher number, not {[low, high]}")


def load_variation(task: str) -> VariationConfig:
    """The variation of a task that comes with the package.

    Raises:
        ConfigError: the task has none.
    """
    stem = _WORD.sub("_", task).lower()
    return load_config(VariationConfig, CONFIG_DIR / "experts" / "variation" / f"{stem}.yaml")


def varied(config: T, ranges: Mapping[str, tuple[float, float]], rng: np.random.Generator) -> T:
    """A configuration with some of its values drawn, one after the other, from their ranges.

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
    """A mapping as it is, a list by number, anything else as nothing."""
    if isinstance(values, list):
        return {str(k): value for k, value in enumerate(values)}
    return values if isinstance(values, dict) else {}
