"""Statistics of a LeRobotDataset's features: of each episode, and of all together."""

from collections.abc import Sequence
from typing import Any

import numpy as np

_QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
_PICTURES, _STRIDE = 20, 4  # of an episode's pictures so many, and of their rows and columns every so-many-th

Stats = dict[str, np.ndarray]


def stats_of(values: np.ndarray) -> Stats:
    """Of a feature's values in an episode: pictures, or numbers."""
    return pictures_stats(values) if values.ndim == 4 else numbers_stats(values)


def numbers_stats(values: np.ndarray) -> Stats:
    """Of (T,), per number of (T, n), or per channel of the points (T, N, n); each (1,), (n,) or (1, n)."""
    rows = values.reshape(len(values), 1) if values.ndim == 1 else values
    keep = (1,) * (rows.ndim - 2)
    flat = rows.reshape(-1, rows.shape[-1]).astype(np.float64)
    return _of_rows(flat, len(values), (*keep, rows.shape[-1]))


def pictures_stats(pictures: np.ndarray) -> Stats:
    """Per channel of (T, H, W, 3) uint8, as shares of 255; (3, 1, 1) each."""
    chosen = np.unique(np.linspace(0, len(pictures) - 1, min(_PICTURES, len(pictures))).astype(int))
    sample = pictures[chosen, ::_STRIDE, ::_STRIDE]
    return _of_rows(sample.reshape(-1, sample.shape[-1]) / 255.0, len(chosen), (sample.shape[-1], 1, 1))


def add_up(episodes: Sequence[dict[str, Stats]]) -> dict[str, Any]:
    """Of all episodes, plain values; quantiles are means of the episodes' quantiles, as LeRobot has them."""
    found: dict[str, Any] = {}
    for key in episodes[0]:
        each = {name: np.stack([one[key][name] for one in episodes]) for name in episodes[0][key]}
        weight = each["count"].reshape(-1, *(1,) * (each["mean"].ndim - 1)) / each["count"].sum()
        mean = (weight * each["mean"]).sum(axis=0)
        variance = (weight * (each["std"] ** 2 + (each["mean"] - mean) ** 2)).sum(axis=0)
        total = {
            "min": each["min"].min(axis=0),
            "max": each["max"].max(axis=0),
            "mean": mean,
            "std": np.sqrt(variance),
            "count": each["count"].sum(axis=0),
        }
        total |= {name: (weight * each[name]).sum(axis=0) for name in _QUANTILES}
        found[key] = {name: value.tolist() for name, value in total.items()}
    return found


def _of_rows(rows: np.ndarray, count: int, shape: tuple[int, ...]) -> Stats:
    stats = {
        "min": rows.min(axis=0),
        "max": rows.max(axis=0),
        "mean": rows.mean(axis=0),
        "std": rows.std(axis=0),
    }
    quantiles = np.quantile(rows, list(_QUANTILES.values()), axis=0)
    stats |= dict(zip(_QUANTILES, quantiles, strict=True))
    return {name: value.reshape(shape) for name, value in stats.items()} | {"count": np.array([count])}
