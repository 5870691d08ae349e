"""Samplers: which points of a cloud to keep. All leave out the ground and what is not there.

A sampler chooses among bytes, one per point (`point_cloud.classify_pixels`), so that a cloud of 192,000 points
need not be made to keep 1,200. Positions are asked for only where the method needs them.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from artiskill.config import check, from_mapping
from artiskill.errors import check_name, shown
from artiskill.sensors.point_cloud import classify_points
from artiskill.sensors.point_selection import (
    choose_by_mask,
    choose_farthest,
    choose_uniformly,
    first_of_each_voxel,
    points_that_count,
)
from artiskill.sensors.segmentation import MOST_MASKS

PositionsOf = Callable[[np.ndarray], np.ndarray]  # indices (M,) -> (M, 3) float32 world


class Sampler(Protocol):
    """Chooses points; deterministic given its generator."""

    @property
    def num_points(self) -> int:
        """The most points that are chosen."""

    def choose(self, codes: np.ndarray, positions_of: PositionsOf, rng: np.random.Generator) -> np.ndarray:
        """Distinct indices (M,) int32, M <= num_points; see the classes."""


@dataclass(frozen=True)
class ManiskillSampler:
    """The baselines' way: some points of each mask, then masked ones up to a share, then others up to the number.

    A point that is drawn for one mask is not drawn again for another: the points are distinct.

    Attributes:
        num_points: in all.
        masked_points: how many of them lie in some mask, where there are that many.
        points_per_mask: drawn first from each mask (all, if it has fewer).
    """

    num_points: int = 1200
    masked_points: int = 800
    points_per_mask: int = 50

    def __post_init__(self) -> None:
        _check_number(self.num_points)
        check(
            0 <= self.masked_points <= self.num_points,
            f"masked_points must lie in [0, num_points = {self.num_points}], not {self.masked_points}",
        )
        most = self.masked_points // MOST_MASKS
        check(
            0 <= self.points_per_mask <= most,
            f"points_per_mask must lie in [0, masked_points // {MOST_MASKS} = {most}], not {self.points_per_mask}",
        )

    def choose(self, codes: np.ndarray, positions_of: PositionsOf, rng: np.random.Generator) -> np.ndarray:
        """Points in the order of drawing: per mask, other masked ones, unmasked ones."""
        return choose_by_mask(
            codes, self.points_per_mask, self.masked_points, self.num_points, rng.random(self.num_points)
        )


@dataclass(frozen=True)
class UniformSampler:
    """Every point above the ground alike.

    Attributes:
        num_points: in all.
    """

    num_points: int = 1200

    def __post_init__(self) -> None:
        _check_number(self.num_points)

    def choose(self, codes: np.ndarray, positions_of: PositionsOf, rng: np.random.Generator) -> np.ndarray:
        """Points in random order."""
        return choose_uniformly(points_that_count(codes), rng.random(self.num_points))


@dataclass(frozen=True)
class VoxelSampler:
    """One point of each cube of a grid in the world: near surfaces get no more points than far ones.

    Attributes:
        num_points: in all; where more cubes are occupied, a random choice of them.
        voxel_m: side of the cubes.
    """

    num_points: int = 1200
    voxel_m: float = 0.04

    def __post_init__(self) -> None:
        _check_number(self.num_points)
        check(1e-4 <= self.voxel_m <= 10.0, f"voxel_m must lie in [0.0001, 10], not {self.voxel_m}")

    def choose(self, codes: np.ndarray, positions_of: PositionsOf, rng: np.random.Generator) -> np.ndarray:
        """Points in random order; of each cube the first in the order of the pixels."""
        candidates = points_that_count(codes)
        firsts = first_of_each_voxel(positions_of(candidates), self.voxel_m)
        return choose_uniformly(candidates[firsts], rng.random(self.num_points))


@dataclass(frozen=True)
class FarthestSampler:
    """Farthest point sampling (Eldar et al. 1997): each point is the one farthest from all before it.

    The cost is the product of candidates and points, so the candidates are thinned at random first.

    Attributes:
        num_points: in all.
        candidates_per_point: candidates kept for each point.
    """

    num_points: int = 1200
    candidates_per_point: int = 4

    def __post_init__(self) -> None:
        _check_number(self.num_points)
        check(
            1 <= self.candidates_per_point <= 100,
            f"candidates_per_point must lie in [1, 100], not {self.candidates_per_point}",
        )

    def choose(self, codes: np.ndarray, positions_of: PositionsOf, rng: np.random.Generator) -> np.ndarray:
        """Points in the order of the method; the first is random."""
        uniforms = rng.random(self.num_points * self.candidates_per_point)
        candidates = choose_uniformly(points_that_count(codes), uniforms)
        return candidates[choose_farthest(positions_of(candidates), self.num_points)]


SAMPLERS: Mapping[str, type[Any]] = {
    "maniskill": ManiskillSampler,
    "uniform": UniformSampler,
    "voxel": VoxelSampler,
    "fps": FarthestSampler,
}


def make_sampler(method: str, num_points: int, settings: Mapping[str, Any] | None = None) -> Sampler:
    """A sampler by its name.

    Args:
        method: one of `SAMPLERS`.
        num_points: in all. `maniskill` keeps its shares of 800 and 50 in 1,200 unless they are given.
        settings: further fields of the sampler's class.

    Raises:
        UnknownNameError: no such method.
        ConfigError: an unknown or illegal setting.
    """
    check_name("sampling method", method, SAMPLERS)
    check(isinstance(num_points, int | np.integer), f"num_points must be an integer, not {shown(num_points)}")
    values: dict[str, Any] = {"num_points": int(num_points), **(settings or {})}
    if method == "maniskill":
        masked = values.setdefault("masked_points", values["num_points"] * 800 // 1200)
        values.setdefault("points_per_mask", min(50, masked * 50 // 800))
    sampler: Sampler = from_mapping(SAMPLERS[method], values, source=f"sampling method {method!r}")
    return sampler


def downsample(
    xyz_w: np.ndarray, rgb: np.ndarray, seg: np.ndarray, sampler: Sampler, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """Down-sample a cloud that exists already, a recorded one, say.

    Args:
        xyz_w: (N, 3) float32 world, z = 0 the ground.
        rgb: (N, 3) uint8.
        seg: (N, k) bool.
        sampler: as from `make_sampler`.
        rng: draws.

    Returns:
        `xyz` (P, 3), `rgb` (P, 3) and `seg` (P, k), P = `sampler.num_points`; zeros where there are too few.
    """
    codes = np.empty(len(xyz_w), dtype=np.uint8)
    classify_points(xyz_w, seg, codes)
    chosen = sampler.choose(codes, lambda indices: xyz_w[indices], rng)
    cloud = {}
    for name, values in (("xyz", xyz_w), ("rgb", rgb), ("seg", seg)):
        cloud[name] = np.zeros((sampler.num_points, values.shape[1]), dtype=values.dtype)
        cloud[name][: len(chosen)] = values[chosen]
    return cloud


def _check_number(num_points: int) -> None:
    check(1 <= num_points <= 1_000_000, f"num_points must lie in [1, 1000000], not {num_points}")
