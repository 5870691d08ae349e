"""Small kernels that fill parts of rows, written so that the compiler makes vector instructions of them.

That takes loops from 0 over an array of their own: an index that might be negative is one that Numba checks.
"""

from typing import Any

import numpy as np

from artiskill.geometry.kernel import Array, kernel


@kernel
def fill(target: Array, value: Any) -> None:
    """The same everywhere."""
    for i in range(target.shape[0]):
        target[i] = value


@kernel
def copy(source: Array, target: Array) -> None:
    """All of a source to the start of a target."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@kernel
def fill_linear(target: Array, first: int, start: float, growth: float) -> None:
    """Start + column * growth from column `first` on."""
    for i in range(target.shape[0]):
        target[i] = np.float32(start + (first + i) * growth)


@kernel
def invert(source: Array, target: Array) -> None:
    """1 / source."""
    for i in range(source.shape[0]):
        target[i] = np.float32(1.0) / source[i]
