"""Faces that exist twice, once for each side, as modellers write them who paint the two sides differently."""

import numpy as np


def have_opposite_twins(vertices: np.ndarray, vertex_pose: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Which faces lie back to back with another: same three places, same body, opposite order.

    The back of such a face must not be drawn: its twin is there, with the colour of that side, and at equal depth
    chance would decide between them.

    Args:
        vertices: (V, 3) in the frames of their bodies.
        vertex_pose: (V,) integers, the same for vertices of one body.
        faces: (F, 3) vertices.

    Returns:
        (F,) bool; false for faces without area.
    """
    if len(faces) == 0:
        return np.zeros(0, dtype=np.bool_)
    places = _same_places(vertices, vertex_pose)[faces]  # (F, 3)
    # the smallest first, the order round kept: what follows then says which way round
    start = places.argmin(axis=1)
    turned = np.take_along_axis(places, (start[:, None] + np.arange(3)) % 3, axis=1)
    first, second, third = turned[:, 0], turned[:, 1:].min(axis=1), turned[:, 1:].max(axis=1)
    order = np.lexsort((third, second, first))
    keys = np.column_stack((first, second, third))[order]
    group = np.zeros(len(faces), dtype=np.int64)
    group[order[1:]] = np.cumsum((keys[1:] != keys[:-1]).any(axis=1))
    forward = turned[:, 1] < turned[:, 2]
    count = len(faces)
    both = (np.bincount(group, forward, count) > 0) & (np.bincount(group, ~forward, count) > 0)
    return both[group] & (first != second) & (second != third)


def _same_places(vertices: np.ndarray, vertex_pose: np.ndarray) -> np.ndarray:
    """(V,) a number per place and body, whatever mesh the vertex is of."""
    columns = np.column_stack((vertices + 0.0, vertex_pose))  # + 0: no negative zeros
    order = np.lexsort(columns.T)
    fresh = np.ones(len(columns), dtype=np.bool_)
    fresh[1:] = (columns[order[1:]] != columns[order[:-1]]).any(axis=1)
    numbers = np.empty(len(columns), dtype=np.int64)
    numbers[order] = np.cumsum(fresh) - 1
    return numbers
