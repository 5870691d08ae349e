"""Kernels from the two buffers of a view to depth, world positions and ids."""

from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.backdrop import FLOOR, NOTHING, Backdrop
from artiskill.sensors.lighting import View
from artiskill.sensors.row_fill import fill, fill_linear, invert

Single = tuple[np.float32, np.float32, np.float32]


class Channels(NamedTuple):
    """Images of K views; one that was not asked for has no elements.

    `rgb` (K, H, W, 3) uint8, `depth` (K, H, W) float32, `position_w` (K, H, W, 3) float32, `geom`, `body` and
    `part` (K, H, W) int32.
    """

    rgb: Array
    depth: Array
    position_w: Array
    geom: Array
    body: Array
    part: Array


@kernel
def resolve_depth(
    first: int, backdrop: Backdrop, drawn: Array, inverse_depth: Array, triangle: Array, depth: Array
) -> None:
    """Depth along the optical axis in metres, 0 where nothing is, of some rows.

    Args:
        first: row of the view.
        backdrop: of the view.
        drawn: (H, 2) columns of each row where the buffers have values.
        inverse_depth: (H, W) buffer.
        triangle: (H, W) buffer.
        depth: (R, W) float32 written.
    """
    width = depth.shape[1]
    for i in range(depth.shape[0]):
        row = first + i
        begin, end = drawn[row, 0], drawn[row, 1]
        if begin > 0:
            backdrop_depth(backdrop, row, 0, begin, depth[i])
        drawn_depth(inverse_depth[row, begin:end], triangle[row, begin:end], depth[i, begin:end])
        if end < width:
            backdrop_depth(backdrop, row, end, width, depth[i])


@kernel
def drawn_depth(inverse_depth: Array, triangle: Array, depth: Array) -> None:
    """Depth of pixels whose values are in the buffers, all (N,)."""
    for i in range(depth.shape[0]):
        z = np.float32(1.0) / inverse_depth[i]
        depth[i] = z if triangle[i] != NOTHING else np.float32(0.0)


@kernel
def backdrop_depth(backdrop: Backdrop, row: int, first: int, last: int, depth: Array) -> None:
    """Depth of the backdrop in the columns first .. last - 1 of a row; `depth` (W,) is written."""
    a = min(max(backdrop.floor[row, 0], first), last)
    b = max(min(backdrop.floor[row, 1], last), a)
    w_row = backdrop.corner + row * backdrop.per_row
    fill(depth[first:a], np.float32(0.0))
    fill(depth[b:last], np.float32(0.0))
    if backdrop.per_column == 0.0:  # a level camera
        fill(depth[a:b], np.float32(1.0) / np.float32(w_row))
    else:
        fill_linear(depth[a:b], a, w_row, backdrop.per_column)
        invert(depth[a:b], depth[a:b])


@kernel
def resolve_position(depth: Array, view: View, position_w: Array) -> None:
    """World position of what each pixel sees, metres, 0 where nothing is; double precision once per row."""
    r, per_px = view.rotation, 1.0 / view.lens[0]
    eye = (np.float32(view.position[0]), np.float32(view.position[1]), np.float32(view.position[2]))
    step = (np.float32(r[0, 0] * per_px), np.float32(r[1, 0] * per_px), np.float32(r[2, 0] * per_px))
    right = (0.5 - view.lens[1]) * per_px
    for row in range(depth.shape[0]):
        up = (view.lens[2] - 0.5 - row) * per_px
        ray = (
            np.float32(r[0, 0] * right + r[0, 1] * up - r[0, 2]),
            np.float32(r[1, 0] * right + r[1, 1] * up - r[1, 2]),
            np.float32(r[2, 0] * right + r[2, 1] * up - r[2, 2]),
        )
        row_of_positions(depth[row], eye, ray, step, position_w[row].reshape(-1))


@kernel
def row_of_positions(depth: Array, eye: Single, ray: Single, step: Single, position_w: Array) -> None:
    """Positions (3 W,) of a row: a flat loop, which the compiler turns into vector instructions.

    `eye` is where all rays begin, `ray` the direction of column 0 of length 1 along the optical axis, `step` what
    one column adds to it.
    """
    for column in range(depth.shape[0]):
        z, x = depth[column], np.float32(column)
        seen = np.float32(1.0) if z > np.float32(0.0) else np.float32(0.0)
        position_w[3 * column] = z * (ray[0] + x * step[0]) + seen * eye[0]
        position_w[3 * column + 1] = z * (ray[1] + x * step[1]) + seen * eye[1]
        position_w[3 * column + 2] = z * (ray[2] + x * step[2]) + seen * eye[2]


@kernel
def resolve_ids(
    backdrop: Backdrop, drawn: Array, triangle: Array, face_geom: Array, table: Array, ids: Array
) -> None:
    """An id per pixel; `NOTHING` and `FLOOR` stand for themselves.

    Args:
        backdrop: of the view.
        drawn: (H, 2) columns of each row where the buffer has values.
        triangle: (H, W) buffer.
        face_geom: (F,) visual of each face.
        table: (G,) id of each visual.
        ids: (H, W) int32 written.
    """
    floor = backdrop.floor
    for row in range(ids.shape[0]):
        begin, end = drawn[row, 0], drawn[row, 1]
        if end - begin < ids.shape[1]:
            fill(ids[row, : floor[row, 0]], NOTHING)
            fill(ids[row, floor[row, 0] : floor[row, 1]], FLOOR)
            fill(ids[row, floor[row, 1] :], NOTHING)
        drawn_ids(triangle[row, begin:end], face_geom, table, ids[row, begin:end])


@kernel
def drawn_ids(triangle: Array, face_geom: Array, table: Array, ids: Array) -> None:
    """Ids of pixels whose values are in the buffer, all (N,)."""
    for i in range(ids.shape[0]):
        t = triangle[i]
        ids[i] = table[face_geom[t]] if t >= 0 else t
