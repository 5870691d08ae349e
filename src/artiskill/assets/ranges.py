"""Ranges and weights in the configurations of generators, and what is legal there."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from artiskill.config import check
from artiskill.errors import shown

Range = tuple[float, float]  # smallest and largest, both possible


def check_ranges(config: Any, where: str, zero: bool = False) -> None:
    """Refuse a dataclass in which a field of type Range is not ordered and positive.

    Args:
        config: the dataclass; a field that may be None and is so is left out.
        where: begins the message.
        zero: whether 0 is legal too.

    Raises:
        ConfigError: naming the field.
    """
    rule = "of at least 0" if zero else "above 0"
    for field in fields(config):
        value = getattr(config, field.name)
        if field.type in (Range, "Range", Range | None) and value is not None:
            low, high = value
            legal = (low >= 0 if zero else low > 0) and low <= high
            text = f"{where}: {field.name} must be two numbers {rule}, the smaller first, not {[low, high]}"
            check(legal, text)


def check_weights(weights: Mapping[str, float], legal: tuple[str, ...], where: str) -> None:
    """Refuse weights of unknown names, negative ones, and weights that are all 0.

    Raises:
        ConfigError: naming what is wrong.
    """
    for name, weight in weights.items():
        check(name in legal, f"{where}: unknown name {name!r}; legal: {', '.join(legal)}")
        check(weight >= 0, f"{where}: the weight of {name!r} must be at least 0, not {shown(weight)}")
    check(any(weights.values()), f"{where}: at least one weight must be above 0")
