"""Kernels for what stands behind all triangles: the floor, an interval of every row, and beyond it nothing.

Most of what a robot sees is floor. So buffers are filled with it only where something is drawn over it; elsewhere
it is known without looking: `drawn` holds for each row the columns whose values are there.
"""

from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, allocating_kernel, kernel, structure_kernel
from artiskill.sensors.camera import View
from artiskill.sensors.drawing.buffers import ViewBuffers
from artiskill.sensors.drawing.scene_tables import SceneTables
from artiskill.sensors.drawing.simd import LANES, clamp_index, fill, fill_linear, invert

NOTHING = -1
FLOOR = -2

# least and greatest x, least and greatest y on the screen
Box = tuple[float, float, float, float]
Single = tuple[np.float32, np.float32, np.float32]


class Backdrop(NamedTuple):
    """The floor z = 0 as a camera sees it; its inverse depth is linear over the screen.

    `corner`, `per_column` and `per_row` give that inverse depth, `farthest` is its value where the camera's sight
    ends, and `floor` (H, 2) int64 are the columns of each row that show the floor, first and end.
    """

    corner: float
    per_column: float
    per_row: float
    farthest: np.float32
    floor: Array


@structure_kernel
def find_backdrop(view: View, has_floor: bool, buffers: ViewBuffers) -> Backdrop:
    """Return the backdrop of a view; its `floor` and numbers are written into the view's buffers, too."""
    lens, rotation, floor, width = view.lens, view.rotation, buffers.floor, buffers.triangle.shape[1]
    focal, height_m = lens[0], view.position[2]
    farthest, nearest = np.float32(1.0 / lens[4]), np.float32(1.0 / lens[3])
    scale = 0.0  # from below the floor is not seen
    if has_floor and height_m > 0.0:
        scale = 1.0 / (height_m * focal)
    per_column, per_row = -rotation[2, 0] * scale, rotation[2, 1] * scale
    corner = (0.5 - lens[1]) * per_column + (0.5 - lens[2]) * per_row + rotation[2, 2] * focal * scale
    for row in range(floor.shape[0]):
        w_row = corner + row * per_row
        first = columns_up_to(farthest, w_row, per_column, width)
        last = columns_up_to(nearest, w_row, per_column, width)
        # the inverse depth may grow or fall with the column
        floor[row, 0], floor[row, 1] = min(first, last), max(first, last)
        if per_column == 0.0:
            floor[row, 0], floor[row, 1] = 0, width if farthest < np.float32(w_row) <= nearest else 0
    numbers = buffers.backdrop
    numbers[0], numbers[1], numbers[2], numbers[3] = corner, per_column, per_row, farthest
    return Backdrop(corner, per_column, per_row, farthest, floor)


@structure_kernel
def backdrop_of(buffers: ViewBuffers) -> Backdrop:
    """Return the backdrop that was found for a view."""
    numbers = buffers.backdrop
    return Backdrop(numbers[0], numbers[1], numbers[2], np.float32(numbers[3]), buffers.floor)


@kernel
def columns_up_to(limit: np.floating, w_row: float, per_column: float, width: int) -> int:
    """Return where in a row the inverse depth passes a limit: the number of columns on this side of it."""
    low, high = 0, width
    rising = per_column > 0.0
    while low < high:
        middle = (low + high) // 2
        if (np.float32(w_row + middle * per_column) > limit) == rising:
            high = middle
        else:
            low = middle + 1
    return low


@kernel
def fill_columns(
    backdrop: Backdrop, row: int, first: int, last: int, inverse_depth: Array, triangle: Array
) -> None:
    """Fill the columns first .. last - 1 of a row of both buffers."""
    a = min(max(backdrop.floor[row, 0], first), last)
    b = max(min(backdrop.floor[row, 1], last), a)
    w_row = backdrop.corner + row * backdrop.per_row
    fill(inverse_depth[row, first:a], backdrop.farthest)
    fill(triangle[row, first:a], NOTHING)
    fill_linear(inverse_depth[row, a:b], a, w_row, backdrop.per_column)
    fill(triangle[row, a:b], FLOOR)
    fill(inverse_depth[row, b:last], backdrop.farthest)
    fill(triangle[row, b:last], NOTHING)


@kernel
def fill_box(backdrop: Backdrop, box: Box, inverse_depth: Array, triangle: Array, drawn: Array) -> None:
    """Fill what is not yet filled of the pixels that a box on the screen touches.

    Args:
        backdrop: of the view.
        box: on the screen, in pixels.
        inverse_depth: (H, W) buffer.
        triangle: (H, W) buffer.
        drawn: (H, 2) columns of each row that are filled, from the first to before the second; renewed.
    """
    height, width = triangle.shape
    # a pixel more on each side, for rounding; whole groups of lanes, so that there is less to do next time
    first = clamp_index(box[0] - 1.0, 0, width) // LANES * LANES
    last = min((clamp_index(box[1] + 1.0, 0, width) + LANES) // LANES * LANES, width)
    for row in range(clamp_index(box[2] - 1.0, 0, height), clamp_index(box[3] + 2.0, 0, height)):
        begin, end = drawn[row, 0], drawn[row, 1]
        if begin == end:
            fill_columns(backdrop, row, first, last, inverse_depth, triangle)
            drawn[row, 0], drawn[row, 1] = first, last
            continue
        if first < begin:
            fill_columns(backdrop, row, first, begin, inverse_depth, triangle)
            drawn[row, 0] = first
        if last > end:
            fill_columns(backdrop, row, end, last, inverse_depth, triangle)
            drawn[row, 1] = last


@kernel
def fill_rest(buffers: ViewBuffers) -> None:
    """Fill all pixels of a view that are not yet filled."""
    triangle = buffers.triangle
    box = (0.0, float(triangle.shape[1]), 0.0, float(triangle.shape[0]))
    fill_box(backdrop_of(buffers), box, buffers.inverse_depth, triangle, buffers.drawn)


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


@allocating_kernel
def resolve_geometry(k: int, scene: SceneTables, view: View, buffers: ViewBuffers, out: Channels) -> None:
    """Write depth, positions and ids of view k, those that were asked for."""
    if out.depth.size > 0:
        resolve_depth(0, buffers, out.depth[k])
    if out.position_w.size > 0:
        if out.depth.size > 0:
            resolve_position(out.depth[k], view, out.position_w[k])
        else:
            depth = np.empty(buffers.triangle.shape, dtype=np.float32)
            resolve_depth(0, buffers, depth)
            resolve_position(depth, view, out.position_w[k])
    if out.geom.size > 0:
        resolve_ids(buffers, scene.face_geom, np.arange(scene.geom_body.shape[0]).astype(np.int32), out.geom[k])
    if out.body.size > 0:
        resolve_ids(buffers, scene.face_geom, scene.geom_body_id, out.body[k])
    if out.part.size > 0:
        resolve_ids(buffers, scene.face_geom, scene.geom_part, out.part[k])


@kernel
def resolve_depth(first: int, buffers: ViewBuffers, depth: Array) -> None:
    """Write depth along the optical axis in metres, 0 where nothing is, of the rows from `first` on: (R, W)."""
    backdrop, drawn = backdrop_of(buffers), buffers.drawn
    inverse_depth, triangle = buffers.inverse_depth, buffers.triangle
    width = depth.shape[1]
    for i in range(depth.shape[0]):
        row = first + i
        begin, end = drawn[row, 0], drawn[row, 1]
        drawn_depth(inverse_depth[row, begin:end], triangle[row, begin:end], depth[i, begin:end])
        if begin > 0:
            backdrop_depth(backdrop, row, 0, begin, depth[i])
        if end < width:
            backdrop_depth(backdrop, row, end, width, depth[i])


@kernel
def drawn_depth(inverse_depth: Array, triangle: Array, depth: Array) -> None:
    """Write the depth of pixels whose values are in the buffers, all (N,)."""
    for i in range(depth.shape[0]):
        z = np.float32(1.0) / inverse_depth[i]
        depth[i] = z if triangle[i] != NOTHING else np.float32(0.0)


@kernel
def backdrop_depth(backdrop: Backdrop, row: int, first: int, last: int, depth: Array) -> None:
    """Write the depth of the backdrop into the columns first .. last - 1 of a row, (W,)."""
    a = min(max(backdrop.floor[row, 0], first), last)
    b = max(min(backdrop.floor[row, 1], last), a)
    w_row = backdrop.corner + row * backdrop.per_row
    fill(depth[first:a], np.float32(0.0))
    fill(depth[b:last], np.float32(0.0))
    if backdrop.per_column == 0.0:  # a level camera
        fill(depth[a:b], np.float32(1.0) / np.float32(w_row))
    else:
        fill_linear(depth[a:b], a, w_row, backdrop.per_column)
        invert(depth[a:b])


@kernel
def resolve_position(depth: Array, view: View, position_w: Array) -> None:
    """Write the world position of what each pixel sees, 0 where nothing is; double precision once per row."""
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
    """Write the positions (3 W,) of a row: a flat loop, which the compiler turns into vector instructions.

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
def resolve_ids(buffers: ViewBuffers, face_geom: Array, table: Array, ids: Array) -> None:
    """Write an id per pixel; `NOTHING` and `FLOOR` stand for themselves.

    Args:
        buffers: of the view.
        face_geom: (F,) visual of each face.
        table: (G,) id of each visual.
        ids: (H, W) int32 written.
    """
    floor, drawn, triangle = buffers.floor, buffers.drawn, buffers.triangle
    for row in range(ids.shape[0]):
        begin, end = drawn[row, 0], drawn[row, 1]
        if end - begin < ids.shape[1]:
            fill(ids[row, : floor[row, 0]], NOTHING)
            fill(ids[row, floor[row, 0] : floor[row, 1]], FLOOR)
            fill(ids[row, floor[row, 1] :], NOTHING)
        drawn_ids(triangle[row, begin:end], face_geom, table, ids[row, begin:end])


@kernel
def drawn_ids(triangle: Array, face_geom: Array, table: Array, ids: Array) -> None:
    """Write the ids of pixels whose values are in the buffer, all (N,)."""
    for i in range(ids.shape[0]):
        t = triangle[i]
        ids[i] = table[face_geom[t]] if t >= 0 else t
