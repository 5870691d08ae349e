"""One array code for NumPy and torch: which namespace an array belongs to, and small helpers on top."""

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


def clamp(values: Array, low: float, high: float) -> Array:
    """Values limited to [low, high]; on small NumPy arrays much faster than `clip`."""
    xp = namespace(values)
    if xp is np:
        return np.minimum(np.maximum(values, low), high)
    return xp.clip(values, low, high)


def norm(vectors: Array) -> Array:
    """Euclidean length over the last axis. (..., n) -> (...)."""
    xp = namespace(vectors)
    return xp.sqrt(xp.vecdot(vectors, vectors))
