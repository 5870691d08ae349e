"""Named arrays side by side in one row, as a file's datasets keep them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Columns:
    """Which columns of a matrix are which array.

    Attributes:
        parts: names and shapes, in order.
    """

    parts: tuple[tuple[str, tuple[int, ...]], ...] = ()

    @classmethod
    def of(cls, arrays: Mapping[str, np.ndarray]) -> "Columns":
        """The columns of these arrays, raveled and side by side."""
        return cls(tuple((name, tuple(value.shape)) for name, value in arrays.items()))

    @classmethod
    def from_list(cls, given: Any) -> "Columns":
        """What `to_list` gave."""
        return cls(tuple((str(name), tuple(int(n) for n in shape)) for name, shape in given))

    def to_list(self) -> list[list[Any]]:
        """Plain values, ready for JSON."""
        return [[name, list(shape)] for name, shape in self.parts]

    @property
    def width(self) -> int:
        """How many columns there are."""
        return sum(math.prod(shape) for _, shape in self.parts)

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Name -> its columns."""
        found, start = {}, 0
        for name, shape in self.parts:
            found[name] = slice(start, start + math.prod(shape))
            start += math.prod(shape)
        return found

    def split(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """The arrays in rows (..., width), each (..., *its shape)."""
        return {name: rows[..., self.slices[name]].reshape(*rows.shape[:-1], *shape) for name, shape in self.parts}


def joined(arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    """All arrays raveled and side by side, (width,) float64."""
    return np.concatenate([np.asarray(value, dtype=np.float64).ravel() for value in arrays.values()])
