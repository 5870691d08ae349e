"""Products and functions with the same bits on all x86-64 processors of today: results are compared bit by bit.

NumPy chooses its code by processor where it computes `exp`, `power`, `arctan2`, `arccos` and their like, and hands
`@`, `dot`, `vecdot` and `linalg` to BLAS, which does so too: other instructions, other last bits. Sums in a fixed
order and the C library's functions, one number at a time, are the same on all that have AVX2 and FMA. (`+ - * /`,
`sqrt`, `sin`, `cos`, `hypot` and sums over an axis are so in NumPy itself.) Python's own `sum`
compensates for rounding since 3.12; `total` does so in no version.
"""

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from artiskill.geometry.arrays import Array, dot, namespace

_NUMPY = (np.ndarray, np.generic, float, int)  # and single numbers


def total(values: Iterable[Any]) -> Any:
    """Return the sum of numbers or of arrays of one shape, added plainly from first to last; 0.0 of none."""
    found: Any = 0.0
    for value in values:
        found = found + value
    return found


def matmul(a: Array, b: Array) -> Array:
    """Matrix product, (..., N, K) x (..., K, M) -> (..., N, M); K is at least 1, and small."""
    total = a[..., :, :1] * b[..., :1, :]
    for k in range(1, a.shape[-1]):
        total = total + a[..., :, k : k + 1] * b[..., k : k + 1, :]
    return total


def rotate(matrices: Array, vectors: Array) -> Array:
    """Matrices times vectors, (..., N, K) x (..., K) -> (..., N)."""
    return dot(matrices, vectors[..., None, :])


def arccos(values: Array) -> Array:
    """Of values in [-1, 1]."""
    if isinstance(values, _NUMPY):
        return _by_number(math.acos, values)
    return namespace(values).acos(values)


def arcsin(values: Array) -> Array:
    """Of values in [-1, 1]."""
    if isinstance(values, _NUMPY):
        return _by_number(math.asin, values)
    return namespace(values).asin(values)


def arctan2(y: Array, x: Array) -> Array:
    """Angle of the points (x, y), in [-pi, pi]."""
    if isinstance(y, _NUMPY) and isinstance(x, _NUMPY):
        return _by_number(math.atan2, y, x)
    return namespace(y, x).atan2(y, x)


def exp(values: np.ndarray) -> np.ndarray:
    """Of values up to 700: an error beyond."""
    return _by_number(math.exp, values)


def power(values: np.ndarray, exponent: float) -> np.ndarray:
    """Values of at least 0 to the power of a positive number."""
    return _by_number(math.pow, values, exponent)


def _by_number(function: Callable[..., float], *values: Any) -> np.ndarray:
    """A function of `math`, for each element of one array, or of several that are broadcast to one shape."""
    together = [np.asarray(values[0])] if len(values) == 1 else np.broadcast_arrays(*values)
    first = together[0]
    numbers = (array.ravel().tolist() for array in together)
    found = np.fromiter(map(function, *numbers), np.result_type(*values, 0.0), first.size)
    return found.reshape(first.shape)
