"""One array code for NumPy and torch: which namespace an array belongs to, and small helpers on top."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from array_api_compat import array_namespace

Array = Any  # a NumPy array or a torch tensor: whatever follows the Array API


def namespace(*arrays: Array) -> Any:
    """The Array API functions for these arrays: `numpy` itself (2.0 and later follow it), or a wrapper of torch.

    NumPy is looked at first: a step of one environment asks some thirty times, and the general look-up costs more
    than the functions that it returns.
    """
    if isinstance(arrays[0], np.ndarray):
        return np
    return array_namespace(*arrays)


def clip(values: Array, low: float, high: float) -> Array:
    """Values limited to [low, high]; on small NumPy arrays much faster than `clip`."""
    xp = namespace(values)
    if xp is np:
        return np.minimum(np.maximum(values, low), high)
    return xp.clip(values, low, high)


def amin(values: Array) -> Array:
    """Minimum over the last axis. (..., n) -> (...)."""
    xp = namespace(values)
    # `numpy.min` goes through three Python functions, which shows after a physics step: it leaves the caches cold
    return np.minimum.reduce(values, axis=-1) if xp is np else xp.min(values, axis=-1)


def amax(values: Array) -> Array:
    """Maximum over the last axis. (..., n) -> (...)."""
    xp = namespace(values)
    return np.maximum.reduce(values, axis=-1) if xp is np else xp.max(values, axis=-1)


def dot(a: Array, b: Array) -> Array:
    """Scalar product over the last axis, with broadcasting: (..., n) -> (...); no BLAS, see `geometry.exact`."""
    xp = namespace(a)
    return np.add.reduce(a * b, axis=-1) if xp is np else xp.sum(a * b, axis=-1)


def norm(vectors: Array) -> Array:
    """Euclidean length over the last axis. (..., n) -> (...)."""
    return namespace(vectors).sqrt(dot(vectors, vectors))


def columns(values: Sequence[Array]) -> Array:
    """Arrays (B,) as the columns of one (B, n); much faster than `stack` on small arrays."""
    xp, first = namespace(values[0]), values[0]
    table = xp.empty((first.shape[0], len(values)), dtype=first.dtype)
    for i, column in enumerate(values):
        table[:, i] = column
    return table
