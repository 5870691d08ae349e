"""How an observation is stored in a training set, and taken out again; acting takes the same way.

Points are rounded to half precision and everything else is kept, so a policy sees the same numbers in training and
when it acts. NumPy only.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from artiskill.errors import ConfigError

REAL = np.uint8(128)  # bit of a point's code that says that it is no padding; bit k says that it is in mask k
MOST_MASKS = 7
_CLOUD = ("xyz", "rgb", "seg")


class ObservationArrays(NamedTuple):
    """What a network sees of B clouds, see `artiskill.learning.batch.Observation`; the arrays are NumPy's."""

    points: np.ndarray  # (B, N, 3) float32, metres
    colors: np.ndarray  # (B, N, 3) float32 in [0, 1]
    masks: np.ndarray  # (B, N, K) float32, 0 or 1
    valid: np.ndarray  # (B, N) bool
    agent: np.ndarray  # (B, S) float32


@dataclass(frozen=True)
class ObservationLayout:
    """The bytes of one observation, a record.

    | field | shape, type | |
    |---|---|---|
    | `points` | (N, 3) float16 | metres |
    | `colors` | (N, 3) uint8 | |
    | `codes` | (N,) uint8 | bit k: in mask k; bit 7: no padding |
    | `agent` | (S,) float32 | as observed |
    """

    points: int  # N
    masks: int  # K
    agent: int  # S

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """Type of a record."""
        n = self.points
        fields = [("points", "<f2", (n, 3)), ("colors", "u1", (n, 3)), ("codes", "u1", (n,))]
        return np.dtype([*fields, ("agent", "<f4", (self.agent,))])

    def encode(self, xyz: np.ndarray, rgb: np.ndarray, seg: np.ndarray, agent: np.ndarray) -> np.ndarray:
        """Return records (B,) of B observations; rows of zeros in `xyz` are padding.

        Args:
            xyz: (B, N, 3) float32, metres.
            rgb: (B, N, 3) uint8.
            seg: (B, N, K) bool.
            agent: (B, S) float32.

        Raises:
            ConfigError: another shape, or numbers that are not finite or too large for half precision.
        """
        self._check_shapes(xyz, rgb, seg, agent)
        records = np.empty(len(xyz), dtype=self.dtype)
        with np.errstate(over="ignore"):  # of half precision: it is checked right away
            records["points"] = xyz
        if not (np.isfinite(records["points"]).all() and np.isfinite(agent).all()):
            largest = float(np.finfo(np.float16).max)
            raise ConfigError(f"an observation has numbers that are not finite, or coordinates beyond {largest} m")
        records["colors"], records["agent"] = rgb, agent
        bits = np.left_shift(np.uint8(1), np.arange(self.masks, dtype=np.uint8))
        codes = (seg * bits).sum(axis=-1, dtype=np.uint8)
        records["codes"] = codes | np.where(xyz.any(axis=-1), REAL, np.uint8(0))
        return records

    def decode(self, records: np.ndarray) -> ObservationArrays:
        """Return what a network sees of records (B,)."""
        codes = records["codes"]
        masks = np.empty((*codes.shape, self.masks), dtype=np.float32)
        for mask in range(self.masks):
            masks[..., mask] = (codes >> np.uint8(mask)) & np.uint8(1)
        return ObservationArrays(
            points=records["points"].astype(np.float32),
            colors=records["colors"].astype(np.float32) / np.float32(255.0),
            masks=masks,
            valid=codes >= REAL,
            agent=records["agent"].astype(np.float32),
        )

    def observe(self, observation: Mapping[str, Any]) -> ObservationArrays:
        """Return what a network sees of an environment's observation, as if it came from a training set.

        Args:
            observation: of mode `pointcloud`, down-sampled to N points: of one environment, or a batch of B.

        Returns:
            Arrays of B rows; of one row for one environment.

        Raises:
            ConfigError: another shape, or numbers that are not finite.
        """
        try:
            cloud = observation["pointcloud"]
            arrays = [np.asarray(cloud[name]) for name in _CLOUD] + [np.asarray(observation["agent"])]
        except (KeyError, TypeError, IndexError) as error:
            raise ConfigError("an observation of obs_mode pointcloud was expected") from error
        if arrays[0].ndim == 2:
            arrays = [array[None] for array in arrays]
        return self.decode(self.encode(*arrays))

    def _check_shapes(self, *arrays: np.ndarray) -> None:
        count, n = len(arrays[0]), self.points
        wanted = [(count, n, 3), (count, n, 3), (count, n, self.masks), (count, self.agent)]
        found = [array.shape for array in arrays]
        if found != wanted:
            raise ConfigError(f"xyz, rgb, seg and agent have the shapes {found}; {wanted} were expected")
