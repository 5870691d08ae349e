"""Kernels that draw one projected triangle into a buffer of `w` and a buffer of triangle ids.

Conventions: screen x to the right, y down, in pixels, pixel (row, column) centred at (column + 0.5, row + 0.5).
`w` is what the depth test compares, greater is nearer: the inverse depth of a perspective camera, the height
towards the sun of a shadow map. Both are linear over the screen. Geometry is float64, buffers are float32.
"""

import numpy as np

from artiskill.geometry.kernel import Array, Point, kernel
from artiskill.sensors.lanes import LANES, draw_lanes

# x and y on the screen
Pixel = tuple[float, float]

# square pixels: a sliver this thin covers no pixel centre worth having, and its depth gradient is noise
_MIN_AREA_PX = 1e-6
# beyond this a vertex is so far off the screen that differences of coordinates lose all digits
_MAX_AREA_PX = 1e18
# pixels: what lies this close to a pixel's centre may by rounding count as on it
_EDGE_PX = 1e-6


@kernel
def point(table: Array, i: int) -> Point:
    """Row i of an (N, 3) table as a tuple: registers, no reference counts."""
    return table[i, 0], table[i, 1], table[i, 2]


@kernel
def scan_convert(
    a: Point, b: Point, c: Point, t: int, two_sided: bool, inverse_depth: Array, triangle: Array
) -> None:
    """Draw one projected triangle, unless it shows its back, has no area or covers no pixel's centre."""
    height, width = inverse_depth.shape
    if covers_centres(a, b, c, two_sided, height, width):
        fill_rows(downwards(a, b, c), depth_plane(a, b, c), t, inverse_depth, triangle)


@kernel
def depth_plane(a: Point, b: Point, c: Point) -> Point:
    """What a triangle's w is at the centre of the first pixel, and its growth per column and per row."""
    inverse = 1.0 / screen_area(a, b, c)
    dw_dx = ((b[2] - a[2]) * (c[1] - a[1]) - (c[2] - a[2]) * (b[1] - a[1])) * inverse
    dw_dy = ((c[2] - a[2]) * (b[0] - a[0]) - (b[2] - a[2]) * (c[0] - a[0])) * inverse
    return a[2] + (0.5 - a[0]) * dw_dx + (0.5 - a[1]) * dw_dy, dw_dx, dw_dy


@kernel
def screen_area(a: Point, b: Point, c: Point) -> float:
    """Twice the area of a triangle on the screen; as y points down, it is negative where the front is seen."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])


@kernel
def covers_centres(a: Point, b: Point, c: Point, two_sided: bool, height: int, width: int) -> bool:
    """Whether a triangle may have to be drawn: it is seen, has an area, and a pixel's centre lies in its box."""
    area = screen_area(a, b, c)
    if not (_MIN_AREA_PX < abs(area) < _MAX_AREA_PX) or (area > 0.0 and not two_sided):
        return False  # written so that NaN ends here too
    if misses_centres(min(a[0], b[0], c[0]), max(a[0], b[0], c[0]), width):
        return False
    return not misses_centres(min(a[1], b[1], c[1]), max(a[1], b[1], c[1]), height)


@kernel
def downwards(a: Point, b: Point, c: Point) -> tuple[Pixel, Pixel, Pixel]:
    """Three places on the screen by their y; those with the same y stay in their order.

    Which way a comparison goes cannot be foreseen, so these are choices between numbers instead of jumps.
    """
    first, second = in_order((a[0], a[1]), (b[0], b[1]))
    first, third = in_order(first, (c[0], c[1]))
    second, third = in_order(second, third)
    return first, second, third


@kernel
def in_order(a: Pixel, b: Pixel) -> tuple[Pixel, Pixel]:
    """Two places on the screen, the upper one first."""
    swap = b[1] < a[1]
    return (
        (b[0] if swap else a[0], b[1] if swap else a[1]),
        (a[0] if swap else b[0], a[1] if swap else b[1]),
    )  # fmt: skip


@kernel
def misses_centres(low: float, high: float, size: int) -> bool:
    """Whether no pixel's centre lies between two coordinates: most triangles of a fine mesh end here."""
    return (
        high < 0.5 - _EDGE_PX
        or low > size - 0.5 + _EDGE_PX
        or np.ceil(low - (0.5 + _EDGE_PX)) > np.floor(high - (0.5 - _EDGE_PX))
    )


@kernel
def fill_rows(
    corners: tuple[Pixel, Pixel, Pixel], plane: Point, t: int, inverse_depth: Array, triangle: Array
) -> None:
    """The pixels whose centres lie in a triangle or on its edges, with depth test.

    Each edge is evaluated from its upper end by one formula, so that triangles with a common edge leave no pixel
    between them. `plane` is w at the centre of the first pixel and its growth per column and per row.
    """
    height, width = inverse_depth.shape
    top, middle, bottom = corners
    first_row = clamp_index(np.ceil(top[1] - 0.5), 0, height)
    last_row = clamp_index(np.floor(bottom[1] - 0.5), -1, height - 1)
    long_slope, upper_slope, lower_slope = slope(top, bottom), slope(top, middle), slope(middle, bottom)
    for row in range(first_row, last_row + 1):
        y = row + 0.5
        x_long = top[0] + (y - top[1]) * long_slope
        upper, lower = top[0] + (y - top[1]) * upper_slope, middle[0] + (y - middle[1]) * lower_slope
        x_short = upper if y < middle[1] else lower
        first = clamp_index(np.ceil(min(x_long, x_short) - 0.5), 0, width)
        last = clamp_index(np.floor(max(x_long, x_short) - 0.5), -1, width - 1)
        fill_span(row, first, last, plane, t, inverse_depth, triangle)


@kernel
def fill_span(
    row: int, first: int, last: int, plane: Point, t: int, inverse_depth: Array, triangle: Array
) -> None:
    """Columns first .. last of a row, with depth test."""
    w_row = plane[0] + row * plane[2]
    start = row * inverse_depth.shape[1]
    column = first
    # `LANES` at once while there are so many before the image's end; if none is left, no lane is inside
    while start + column + LANES <= inverse_depth.size:
        draw_lanes(inverse_depth, triangle, start + column, column, last + 1 - column, w_row, plane[1], t)
        column += LANES
        if column > last:
            return
    for i in range(column, last + 1):
        w = np.float32(w_row + i * plane[1])
        if w > inverse_depth[row, i]:
            inverse_depth[row, i] = w
            triangle[row, i] = t


@kernel
def slope(upper: Pixel, lower: Pixel) -> float:
    """Change of x per row along an edge; 0 for a level edge, which is never followed."""
    drop = lower[1] - upper[1]
    return (lower[0] - upper[0]) / drop if drop > 0.0 else 0.0


@kernel
def clamp_index(value: float, low: int, high: int) -> int:
    """A float to an integer in [low, high]: compared as a float, since out of range, or NaN, it has no integer.

    Choices between numbers instead of jumps, as in `downwards`.
    """
    bounded = value if value > low else np.float64(low)
    return int(bounded if bounded < high else np.float64(high))
