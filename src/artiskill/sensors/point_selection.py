"""Kernels that choose points. Randomness comes in as uniform numbers in [0, 1), one per point at most."""

import math

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.segmentation import COUNTS, MOST_MASKS

# multipliers of Teschner et al. (2003) for hashing cells of a grid
_HASH_X, _HASH_Y, _HASH_Z = 73856093, 19349663, 83492791


@kernel
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


@kernel
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


@kernel
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


@kernel
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


@kernel
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


@kernel
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
