"""`info` of a vector, as Gymnasium has it: arrays over environments, each with a mask of whom it is about."""

from collections.abc import Mapping
from typing import Any

import numpy as np


class ObjectArray(np.ndarray):
    """An array (B,) of names, or of observations, or of None; a type of its own for `ArrayConversion`'s sake."""


def _register_conversion() -> None:
    """Have Gymnasium's `ArrayConversion` (`NumpyToTorch`, ...), which takes numbers only, look inside."""
    try:
        from gymnasium.wrappers.array_conversion import array_conversion
    except ImportError:  # Gymnasium before 1.2 has other wrappers
        return

    def convert(values: ObjectArray, xp: Any, device: Any = None) -> ObjectArray:
        converted = np.full_like(values, None)
        for i, value in enumerate(values):
            converted[i] = value if isinstance(value, str) else array_conversion(value, xp, device)
        return converted

    array_conversion.register(ObjectArray, convert)


_register_conversion()


def with_masks(values: Mapping[str, Any], mask: np.ndarray) -> dict[str, Any]:
    """Arrays (B, ...) and nested mappings of them, each key `k` with `_k`, the (B,) mask, beside it."""
    out: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            out[key] = with_masks(value, mask)
        else:
            out[key] = value.view(ObjectArray) if value.dtype == object else value
        out[f"_{key}"] = mask.copy()
    return out


def only(values: Mapping[str, Any], mask: np.ndarray) -> dict[str, Any]:
    """Copies of the arrays, zero (None for objects) outside the mask."""
    out: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            out[key] = only(value, mask)
        else:
            kept = np.full_like(value, None) if value.dtype == object else np.zeros_like(value)
            kept[mask] = value[mask]
            out[key] = kept
    return out


def stacked(infos: Mapping[int, Mapping[str, Any]], num_envs: int) -> dict[str, Any]:
    """Per-environment mappings of arrays as arrays (B, ...), zero where an environment has none."""
    out: dict[str, Any] = {}
    for env, info in infos.items():
        _write(info, env, num_envs, out)
    return out


def _write(info: Mapping[str, Any], env: int, num_envs: int, out: dict[str, Any]) -> None:
    for key, value in info.items():
        if isinstance(value, Mapping):
            _write(value, env, num_envs, out.setdefault(key, {}))
        else:
            array = np.asarray(value)
            out.setdefault(key, np.zeros((num_envs, *array.shape), array.dtype))[env] = array
