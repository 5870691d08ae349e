"""Samplers: which points of a cloud to keep. All leave out the ground and what is not there.

A sampler chooses among bytes, one per point (`point_cloud.classify_pixels`), so that a cloud of 192,000 points
need not be made to keep 1,200. Positions are asked for only where the method needs them.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from artiskill.config import check, from_mapping
from artiskill.errors import check_name, shown
from artiskill.geometry.kernel import Array, allocating_kernel, kernel
from artiskill.sensors.observations.point_cloud import COUNTS, MOST_MASKS, classify_points

# multipliers of Teschner et al. (2003) for hashing cells of a grid
_HASH_X, _HASH_Y, _HASH_Z = 73856093, 19349663, 83492791


@allocating_kernel
def choose_by_mask(codes: Array, per_mask: int, masked_total: int, total: int, uniforms: Array) -> Array:
    """Some points of each mask, then masked ones up to `masked_total`, then unmasked ones up to `total`.

    Args:
        codes: (N,) uint8, see `classify_pixels`; not changed.
        per_mask: points of each mask, fewer where it has fewer that are not chosen yet.
        masked_total: up to so many masked points.
        total: up to so many points.
        uniforms: (total,).

    Returns:
        (M,) int32 distinct indices.
    """
    candidates = points_that_count(codes)
    masked, unmasked, occurring = split_by_mask(codes, candidates)
    free = np.ones(masked.shape[0], dtype=np.bool_)
    chosen = np.empty(total, dtype=np.int32)
    count = 0
    members = np.empty(masked.shape[0], dtype=np.int32)  # places in `masked`
    for mask in range(MOST_MASKS + 1):
        # the last round is for all masks together
        bits = (1 << mask) if mask < MOST_MASKS else int(COUNTS) - 1
        if not bits & occurring:
            continue
        size = 0
        for i in range(masked.shape[0]):
            if free[i] and codes[masked[i]] & bits:
                members[size] = i
                size += 1
        wanted = per_mask if mask < MOST_MASKS else masked_total - count
        for _ in range(min(wanted, size)):
            place = int(uniforms[count] * size)
            size -= 1
            free[members[place]] = False
            chosen[count] = masked[members[place]]
            members[place] = members[size]
            count += 1
    others = choose_uniformly(unmasked, uniforms[count:])
    chosen[count : count + others.shape[0]] = others
    return chosen[: count + others.shape[0]]


@allocating_kernel
def points_that_count(codes: Array) -> Array:
    """Indices (M,) int32 of the bytes that are not 0. Eight at a time: most of a picture is ground."""
    found = np.empty(codes.shape[0], dtype=np.int32)
    words = codes[: codes.shape[0] // 8 * 8].view(np.uint64)
    count = 0
    for word in range(words.shape[0]):
        if words[word]:
            for i in range(8 * word, 8 * word + 8):
                if codes[i]:
                    found[count] = i
                    count += 1
    for i in range(8 * words.shape[0], codes.shape[0]):
        if codes[i]:
            found[count] = i
            count += 1
    return found[:count]


@allocating_kernel
def split_by_mask(codes: Array, candidates: Array) -> tuple[Array, Array, int]:
    """The candidates in some mask, the others, both int32, and the bits of all masks that occur."""
    masked, unmasked = np.empty_like(candidates), np.empty_like(candidates)
    in_mask, outside, occurring = 0, 0, 0
    for i in range(candidates.shape[0]):
        bits = int(codes[candidates[i]] & (COUNTS - 1))
        occurring |= bits
        if bits:
            masked[in_mask] = candidates[i]
            in_mask += 1
        else:
            unmasked[outside] = candidates[i]
            outside += 1
    return masked[:in_mask], unmasked[:outside], occurring


@allocating_kernel
def choose_uniformly(candidates: Array, uniforms: Array) -> Array:
    """As many of the candidates as there are uniform numbers, or all, in random order (Fisher and Yates)."""
    pool = candidates.copy()
    size = pool.shape[0]
    count = min(size, uniforms.shape[0])
    chosen = np.empty(count, dtype=np.int32)
    for i in range(count):
        place = int(uniforms[i] * size)
        size -= 1
        chosen[i] = pool[place]
        pool[place] = pool[size]
    return chosen


@allocating_kernel
def choose_by_share(codes: Array, shares: Array, uniforms: Array) -> Array:
    """Fixed numbers of points of each mask, and of those in none.

    A point in several masks counts as of the first.

    Args:
        codes: (N,) uint8, see `classify_pixels`; not changed.
        shares: (k + 1,) points of each mask, then of those in no mask; fewer where there are fewer.
        uniforms: (the sum of `shares`,).

    Returns:
        (M,) int32 distinct indices, mask after mask.
    """
    candidates = points_that_count(codes)
    masks = shares.shape[0] - 1
    group = np.empty(candidates.shape[0], dtype=np.int64)
    for i in range(candidates.shape[0]):
        group[i] = masks
        for mask in range(masks - 1, -1, -1):
            if codes[candidates[i]] & (1 << mask):
                group[i] = mask
    chosen = np.empty(uniforms.shape[0], dtype=np.int32)
    count, drawn = 0, 0
    for wanted in range(masks + 1):
        share = shares[wanted]
        found = choose_uniformly(candidates[group == wanted], uniforms[drawn : drawn + share])
        chosen[count : count + found.shape[0]] = found
        count += found.shape[0]
        drawn += share
    return chosen[:count]


@allocating_kernel
def first_of_each_voxel(xyz: Array, voxel_m: float) -> Array:
    """Indices (M,) int32 of the first point in each occupied cube of a grid, by a hash table."""
    slots = 1024
    while slots < 2 * xyz.shape[0]:
        slots *= 2
    owner = np.full(slots, -1, dtype=np.int32)
    cells = np.empty((xyz.shape[0], 3), dtype=np.int64)  # of the firsts
    firsts = np.empty(xyz.shape[0], dtype=np.int32)
    count = 0
    for i in range(xyz.shape[0]):
        x, y, z = cell_of(xyz[i, 0], voxel_m), cell_of(xyz[i, 1], voxel_m), cell_of(xyz[i, 2], voxel_m)
        slot = ((x * _HASH_X) ^ (y * _HASH_Y) ^ (z * _HASH_Z)) & (slots - 1)
        while owner[slot] >= 0:
            other = cells[owner[slot]]
            if other[0] == x and other[1] == y and other[2] == z:
                break
            slot = (slot + 1) & (slots - 1)
        if owner[slot] < 0:
            owner[slot] = count
            cells[count, 0], cells[count, 1], cells[count, 2] = x, y, z
            firsts[count] = i
            count += 1
    return firsts[:count]


@kernel
def cell_of(coordinate: float, voxel_m: float) -> int:
    """Which cell of a grid a coordinate lies in."""
    return math.floor(np.float64(coordinate) / voxel_m)


@allocating_kernel
def choose_farthest(xyz: Array, count: int) -> Array:
    """Indices (M,) int32 of farthest point sampling, from point 0; M is the lesser of `count` and the points."""
    size = xyz.shape[0]
    count = min(count, size)
    chosen = np.empty(count, dtype=np.int32)
    nearest = np.full(size, np.float32(np.inf))  # squared distance to the chosen ones; -1: chosen
    # floats that are not negative have the order of their bits, whose maximum vector instructions can find
    bits = nearest.view(np.int32)
    x_all, y_all, z_all = xyz[:, 0].copy(), xyz[:, 1].copy(), xyz[:, 2].copy()
    latest = 0
    for i in range(count):
        chosen[i] = latest
        x, y, z = x_all[latest], y_all[latest], z_all[latest]
        nearest[latest] = np.float32(-1.0)
        for j in range(size):
            dx, dy, dz = x_all[j] - x, y_all[j] - y, z_all[j] - z
            gap = dx * dx + dy * dy + dz * dz
            nearest[j] = gap if gap < nearest[j] else nearest[j]
        farthest = np.int32(-(2**31))
        for j in range(size):
            farthest = max(farthest, bits[j])
        latest = 0
        while latest < size - 1 and bits[latest] != farthest:
            latest += 1
    return chosen


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


@dataclass(frozen=True)
class ShareSampler:
    """Fixed numbers of points of each mask, the first that a point is in, and of those in none.

    Attributes:
        num_points: in all.
        shares: points of each mask, then of those in no mask; their sum is `num_points`.
    """

    num_points: int
    shares: tuple[int, ...]

    def __post_init__(self) -> None:
        _check_number(self.num_points)
        most = MOST_MASKS + 1
        check(
            1 <= len(self.shares) <= most and min(self.shares) >= 0,
            f"shares needs 1 to {most} numbers of at least 0, not {list(self.shares)}",
        )
        total = int(math.fsum(self.shares))
        check(total == self.num_points, f"the sum of shares must be num_points = {self.num_points}, not {total}")

    def choose(self, codes: np.ndarray, positions_of: PositionsOf, rng: np.random.Generator) -> np.ndarray:
        """Points mask after mask, in random order."""
        return choose_by_share(codes, np.array(self.shares, dtype=np.int64), rng.random(self.num_points))


SAMPLERS: Mapping[str, type[Any]] = {
    "maniskill": ManiskillSampler,
    "shares": ShareSampler,
    "uniform": UniformSampler,
    "voxel": VoxelSampler,
    "fps": FarthestSampler,
}


def make_sampler(method: str, num_points: int, settings: Mapping[str, Any] | None = None) -> Sampler:
    """A sampler by its name.

    Args:
        method: one of `SAMPLERS`.
        num_points: in all. `maniskill` keeps its shares of 800 and 50 in 1,200 unless they are given; `shares`
            without any regards no mask.
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
    elif method == "shares":
        values.setdefault("shares", (values["num_points"],))
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
