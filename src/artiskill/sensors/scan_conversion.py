"""Kernels that draw one projected triangle into a buffer of `w` and a buffer of triangle ids.

Conventions: screen x to the right, y down, in pixels, pixel (row, column) centred at (column + 0.5, row + 0.5).
`w` is what the depth test compares, greater is nearer: the inverse depth of a perspective camera, the height
towards the sun of a shadow map. Both are linear over the screen. Geometry is float64, buffers are float32.
"""

import numpy as np

from artiskill.geometry.kernel import Array, Point, kernel

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
    area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])  # y points down: negative in front
    if not (_MIN_AREA_PX < abs(area) < _MAX_AREA_PX) or (area > 0.0 and not two_sided):
        return  # written so that NaN ends here too
    if misses_centres(min(a[0], b[0], c[0]), max(a[0], b[0], c[0]), inverse_depth.shape[1]):
        return
    if misses_centres(min(a[1], b[1], c[1]), max(a[1], b[1], c[1]), inverse_depth.shape[0]):
        return
    inverse = 1.0 / area
    dw_dx = ((b[2] - a[2]) * (c[1] - a[1]) - (c[2] - a[2]) * (b[1] - a[1])) * inverse
    dw_dy = ((c[2] - a[2]) * (b[0] - a[0]) - (b[2] - a[2]) * (c[0] - a[0])) * inverse
    w_corner = a[2] + (0.5 - a[0]) * dw_dx + (0.5 - a[1]) * dw_dy
    if b[1] < a[1]:
        a, b = b, a
    if c[1] < a[1]:
        a, c = c, a
    if c[1] < b[1]:
        b, c = c, b
    fill_rows(a, b, c, (w_corner, dw_dx, dw_dy), t, inverse_depth, triangle)


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
    top: Point, middle: Point, bottom: Point, plane: Point, t: int, inverse_depth: Array, triangle: Array
) -> None:
    """The pixels whose centres lie in a triangle or on its edges, with depth test.

    Each edge is evaluated from its upper end by one formula, so that triangles with a common edge leave no pixel
    between them. `plane` is w at the centre of the first pixel and its growth per column and per row.
    """
    height, width = inverse_depth.shape
    first_row = clamp_index(np.ceil(top[1] - 0.5), 0, height)
    last_row = clamp_index(np.floor(bottom[1] - 0.5), -1, height - 1)
    long_slope, upper_slope, lower_slope = slope(top, bottom), slope(top, middle), slope(middle, bottom)
    for row in range(first_row, last_row + 1):
        y = row + 0.5
        x_long = top[0] + (y - top[1]) * long_slope
        if y < middle[1]:
            x_short = top[0] + (y - top[1]) * upper_slope
        else:
            x_short = middle[0] + (y - middle[1]) * lower_slope
        first = clamp_index(np.ceil(min(x_long, x_short) - 0.5), 0, width)
        last = clamp_index(np.floor(max(x_long, x_short) - 0.5), -1, width - 1)
        w = plane[0] + first * plane[1] + row * plane[2]
        for column in range(first, last + 1):
            w32 = np.float32(w)
            if w32 > inverse_depth[row, column]:
                inverse_depth[row, column] = w32
                triangle[row, column] = t
            w += plane[1]


@kernel
def slope(upper: Point, lower: Point) -> float:
    """Change of x per row along an edge; 0 for a level edge, which is never followed."""
    drop = lower[1] - upper[1]
    return (lower[0] - upper[0]) / drop if drop > 0.0 else 0.0


@kernel
def clamp_index(value: float, low: int, high: int) -> int:
    """A float to an integer in [low, high]: compared as a float, since out of range, or NaN, it has no integer."""
    if not value > low:
        return low
    return high if value >= high else int(value)
