"""Kernels for what stands behind all triangles: the floor, an interval of every row, and beyond it nothing.

Most of what a robot sees is floor. So buffers are filled with it only where something is drawn over it; elsewhere
it is known without looking: `drawn` holds for each row the columns whose values are there.
"""

from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.lanes import LANES
from artiskill.sensors.lighting import View
from artiskill.sensors.row_fill import fill, fill_linear
from artiskill.sensors.scan_conversion import clamp_index

NOTHING = -1
FLOOR = -2

# least and greatest x, least and greatest y on the screen
Box = tuple[float, float, float, float]


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


@kernel
def find_backdrop(view: View, has_floor: bool, width: int, floor: Array) -> Backdrop:
    """The backdrop of a view, whose `floor` is written."""
    lens, rotation = view.lens, view.rotation
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
    return Backdrop(corner, per_column, per_row, farthest, floor)


@kernel
def columns_up_to(limit: np.floating, w_row: float, per_column: float, width: int) -> int:
    """Where in a row the inverse depth passes a limit: the number of columns on this side of it."""
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
def fill_rest(backdrop: Backdrop, inverse_depth: Array, triangle: Array, drawn: Array) -> None:
    """Fill all pixels that are not yet filled."""
    box = (0.0, float(triangle.shape[1]), 0.0, float(triangle.shape[0]))
    fill_box(backdrop, box, inverse_depth, triangle, drawn)
