"""How all kernels are compiled."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numba import njit

Array = np.ndarray
Point = tuple[float, float, float]

F = TypeVar("F", bound=Callable[..., object])


def kernel(function: F) -> F:
    """Compile on first use, keep on disk, release the GIL.

    No `fastmath`: sums keep their order, so that every machine gives the same pixels. Division by zero gives an
    infinity, as in NumPy; whoever divides must be ready for it.
    """
    compiled: F = njit(cache=True, nogil=True, error_model="numpy")(function)
    return compiled
