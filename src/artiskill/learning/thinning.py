"""Fewer points than a training file has, as if the sensor had been asked for so few.

The rows of a sampled cloud stand in the order of drawing, so the first ones are a sample, too. Drawing anew from a
sample by `maniskill` would draw the points of small masks twice as often as the sensor does: they are a larger
share of the sample than of the cloud.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from artiskill.config import check
from artiskill.demos.training_file import Sampling
from artiskill.learning.observation import REAL
from artiskill.sensors.observations.sampling import ManiskillSampler, Sampler, downsample, make_sampler
from artiskill.tasks.levels import RngStream, level_generator

_SHARES = ("masked_points", "points_per_mask")  # settings that are numbers of points


def thinned_sampling(sampling: Sampling | None, num_points: int) -> Sampling:
    """Return the sampling of so many points that is like another one; None for the full cloud's.

    Raises:
        ConfigError: the other one has fewer points, or they are no legal number.
    """
    if sampling is None:
        return Sampling(num_points)
    had = sampling.num_points
    check(
        num_points <= had, f"the training files have {had} points each: choose at most so many, not {num_points}"
    )
    settings = {
        name: value * num_points // had if name in _SHARES else value for name, value in sampling.settings.items()
    }
    return Sampling(num_points, sampling.method, sampling.frame, settings)


class Thinner:
    """Keeps some points of each cloud of a training file.

    Args:
        source: sampling of the file; None for full clouds.
        num_points: that are kept.

    Attributes:
        sampling: of the result, as an environment is to be given it.

    Raises:
        ConfigError: see `thinned_sampling`.
    """

    def __init__(self, source: Sampling | None, num_points: int) -> None:
        self._source = source
        self.sampling = thinned_sampling(source, num_points)
        self._sampler = _sampler_of(self.sampling)
        self._had = None if source is None else _sampler_of(source)

    def thin(self, clouds: Mapping[str, np.ndarray], level: int, first_step: int) -> dict[str, np.ndarray]:
        """Return fewer points of the clouds of consecutive steps.

        Args:
            clouds: `xyz` (F, P, 3), `rgb` (F, P, 3) and `seg` (F, P, K).
            level: of the episode.
            first_step: of the episode, from 0; that of the first cloud.

        Returns:
            The same with `num_points` rows each; rows of zeros at the end where there are too few.
        """
        if self._had is not None and self._had.num_points == self.sampling.num_points:
            return dict(clouds)
        frames = len(clouds["xyz"])
        made = {
            name: np.zeros((frames, self.sampling.num_points, values.shape[2]), dtype=values.dtype)
            for name, values in clouds.items()
        }
        codes = None if self._had is None else _codes(clouds)
        for row in range(frames):
            if codes is None:  # bit for bit what the environment gives
                rng = level_generator(level, RngStream.POINTS, first_step + row)
                xyz, rgb, seg = (clouds[name][row] for name in ("xyz", "rgb", "seg"))
                for name, values in downsample(xyz, rgb, seg, self._sampler, rng).items():
                    made[name][row] = values
            else:
                chosen = self._choose(codes[row], level, first_step + row)
                for name, values in clouds.items():
                    made[name][row, : len(chosen)] = values[row, chosen]
        return made

    def _choose(self, codes: np.ndarray, level: int, step: int) -> np.ndarray:
        had, wanted = self._had, self._sampler
        if not (isinstance(had, ManiskillSampler) and isinstance(wanted, ManiskillSampler)):
            return np.flatnonzero(codes)[: wanted.num_points]
        if np.count_nonzero(codes > REAL) < had.masked_points:  # every masked point that was seen is there
            rng = level_generator(level, RngStream.POINTS, step)
            return wanted.choose(codes, _no_positions, rng)
        return choose_first_drawn(codes, had, wanted)


def choose_first_drawn(codes: np.ndarray, had: ManiskillSampler, wanted: ManiskillSampler) -> np.ndarray:
    """Return indices of the points that were drawn first: of each mask, of all masks together, and of the rest.

    Args:
        codes: (P,) uint8 in the order of drawing; bit k: in mask k, `REAL`: no padding.
        had: how they were drawn; there are `masked_points` masked ones.
        wanted: how many are to be kept.
    """
    masked = np.flatnonzero(codes > REAL)
    first: list[np.ndarray] = []
    start = 0
    for mask in range(7):
        outside = np.flatnonzero((codes[masked[start : start + had.points_per_mask]] >> mask) & 1 == 0)
        size = int(outside[0]) if len(outside) else min(had.points_per_mask, len(masked) - start)
        first.append(masked[start : start + min(size, wanted.points_per_mask)])
        start += size
    kept = np.concatenate(first)
    others = masked[start:][: wanted.masked_points - len(kept)]
    unmasked = np.flatnonzero(codes == REAL)[: wanted.num_points - len(kept) - len(others)]
    return np.concatenate([kept, others, unmasked])


def _codes(clouds: Mapping[str, np.ndarray]) -> np.ndarray:
    bits = np.left_shift(np.uint8(1), np.arange(clouds["seg"].shape[-1], dtype=np.uint8))
    codes = (clouds["seg"] * bits).sum(axis=-1, dtype=np.uint8)
    return np.where(clouds["xyz"].any(axis=-1), codes | REAL, np.uint8(0))


def _sampler_of(sampling: Sampling) -> Sampler:
    return make_sampler(sampling.method, sampling.num_points, sampling.all_settings)


def _no_positions(indices: np.ndarray) -> np.ndarray:
    raise AssertionError("this method asks for no positions")


def sampling_values(sampling: Sampling) -> dict[str, Any]:
    """Return a sampling as a manifest stores it, all settings resolved."""
    return {
        "num_points": sampling.num_points,
        "method": sampling.method,
        "frame": sampling.frame,
        "settings": sampling.all_settings,
    }
