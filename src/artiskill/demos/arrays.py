"""Whether the arrays of a trajectory are of the form that they must have: what readers rely on."""

from collections.abc import Mapping
from typing import Any

import numpy as np

Form = tuple[tuple[int, ...], Any]  # shape and type of an array


def check_forms(arrays: Mapping[str, Any], wanted: Mapping[str, Form]) -> None:
    """Compare arrays, or datasets of a file, with the shapes and types that they must have.

    Raises:
        ValueError: one is another.
    """
    for name, (shape, dtype) in wanted.items():
        found = arrays[name]
        if found.shape != shape or found.dtype != np.dtype(dtype):
            raise ValueError(f"{name} are {found.dtype} {found.shape}, not {np.dtype(dtype)} {shape}")


def check_finite(arrays: Mapping[str, np.ndarray]) -> None:
    """See whether all numbers are finite.

    Raises:
        ValueError: some are not.
    """
    for name, values in arrays.items():
        if not np.isfinite(values).all():
            raise ValueError(f"{name} have numbers that are not finite")
