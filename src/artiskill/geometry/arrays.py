"""Array functions that run on NumPy and on torch, and give the same bits on every x86-64 processor of today.

NumPy chooses its code by processor where it computes `exp`, `power`, `arctan2`, `arccos` and their like, and hands
`@`, `dot`, `vecdot` and `linalg` to BLAS, which does so too: other instructions, other last bits. Sums in a fixed
order and the C library's functions, one number at a time, are the same on all that have AVX2 and FMA. (`+ - * /`,
`sqrt`, `sin`, `cos`, `hypot` and sums over an axis are so in NumPy itself.) Python's own `sum` compensates for
rounding since 3.12; `total` does so in no version.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from array_api_compat import array_namespace

Array = Any  # a NumPy array or a torch tensor: whatever follows the Array API

_NUMPY = (np.ndarray, np.generic, float, int)  # and single numbers


def namespace(*arrays: Array) -> Any:
    """Return the Array API functions for these arrays: `numpy` itself (since 2.0), or a wrapper of torch.

    NumPy is looked at first: a step of one environment asks some thirty times, and the general look-up costs more
    than the functions that it returns.
    """
    if isinstance(arrays[0], np.ndarray):
        return np
    return array_namespace(*arrays)


def clip(values: Array, low: float, high: float) -> Array:
    """Limit values to [low, high]; on small NumPy arrays much faster than `numpy.clip`."""
    xp = namespace(values)
    if xp is np:
        return np.minimum(np.maximum(values, low), high)
    return xp.clip(values, low, high)


def amin(values: Array) -> Array:
    """Return the minimum over the last axis. (..., n) -> (...)."""
    xp = namespace(values)
    # `numpy.min` goes through three Python functions, which shows after a physics step: it leaves the caches cold
    return np.minimum.reduce(values, axis=-1) if xp is np else xp.min(values, axis=-1)


def amax(values: Array) -> Array:
    """Return the maximum over the last axis. (..., n) -> (...)."""
    xp = namespace(values)
    return np.maximum.reduce(values, axis=-1) if xp is np else xp.max(values, axis=-1)


def dot(a: Array, b: Array) -> Array:
    """Return the scalar product over the last axis, with broadcasting: (..., n) -> (...)."""
    xp = namespace(a)
    return np.add.reduce(a * b, axis=-1) if xp is np else xp.sum(a * b, axis=-1)


def norm(vectors: Array) -> Array:
    """Return the Euclidean length over the last axis. (..., n) -> (...)."""
    return namespace(vectors).sqrt(dot(vectors, vectors))


def columns(values: Sequence[Array]) -> Array:
    """Return arrays (B,) as the columns of one (B, n); much faster than `stack` on small arrays."""
    xp, first = namespace(values[0]), values[0]
    table = xp.empty((first.shape[0], len(values)), dtype=first.dtype)
    for i, column in enumerate(values):
        table[:, i] = column
    return table


def total(values: Iterable[Any]) -> Any:
    """Return the sum of numbers or of arrays of one shape, added plainly from first to last; 0.0 of none."""
    found: Any = 0.0
    for value in values:
        found = found + value
    return found


def matmul(a: Array, b: Array) -> Array:
    """Return the matrix product, (..., N, K) x (..., K, M) -> (..., N, M); K is at least 1, and small."""
    found = a[..., :, :1] * b[..., :1, :]
    for k in range(1, a.shape[-1]):
        found = found + a[..., :, k : k + 1] * b[..., k : k + 1, :]
    return found


def small_product(a: np.ndarray, b: np.ndarray) -> Any:
    """Return what `a @ b` is of small arrays of NumPy, each of one dimension or more.

    `matmul` is for arrays of any library; this is one call of `einsum`, which asks BLAS only if it is to optimise.
    """
    rows, columns = "...ij" if a.ndim > 1 else "j", "...jk" if b.ndim > 1 else "j"
    outer = "..." * (a.ndim > 1 or b.ndim > 1)
    return np.einsum(f"{rows},{columns}->{outer}{'i' * (a.ndim > 1)}{'k' * (b.ndim > 1)}", a, b)


def rotate(matrices: Array, vectors: Array) -> Array:
    """Return matrices times vectors, (..., N, K) x (..., K) -> (..., N)."""
    return dot(matrices, vectors[..., None, :])


def arccos(values: Array) -> Array:
    """Return the angle in [0, pi] whose cosine is given, in [-1, 1]."""
    if isinstance(values, _NUMPY):
        return _by_number(math.acos, values)
    return namespace(values).acos(values)


def arcsin(values: Array) -> Array:
    """Return the angle in [-pi / 2, pi / 2] whose sine is given, in [-1, 1]."""
    if isinstance(values, _NUMPY):
        return _by_number(math.asin, values)
    return namespace(values).asin(values)


def arctan2(y: Array, x: Array) -> Array:
    """Return the angle of the points (x, y), in [-pi, pi]."""
    if isinstance(y, _NUMPY) and isinstance(x, _NUMPY):
        return _by_number(math.atan2, y, x)
    return namespace(y, x).atan2(y, x)


def exp(values: np.ndarray) -> np.ndarray:
    """Return e to the power of values up to 700; larger ones are an error."""
    return _by_number(math.exp, values)


def power(values: np.ndarray, exponent: float) -> np.ndarray:
    """Return values of at least 0 to the power of a positive number."""
    return _by_number(math.pow, values, exponent)


def _by_number(function: Callable[..., float], *values: Any) -> np.ndarray:
    """Call a function of `math` for each element of one array, or of several that are broadcast to one shape."""
    together = [np.asarray(values[0])] if len(values) == 1 else np.broadcast_arrays(*values)
    first, kind = together[0], np.result_type(*values, 0.0)
    if first.size == 1:  # one environment's: half the time
        return np.array(function(*(array.item() for array in together)), kind).reshape(first.shape)
    numbers = (array.ravel().tolist() for array in together)
    return np.fromiter(map(function, *numbers), kind, first.size).reshape(first.shape)
