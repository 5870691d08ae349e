"""Kernels that look up textures: nearest texel and bilinear."""

import math

from artiskill.geometry.kernel import Array, Point, kernel


@kernel
def texel_row(first: int, height: int, width: int, u: float, v: float) -> int:
    """Row of the texel table nearest to (u, v) of a texture with its first texel there.

    Images repeat, v points up.
    """
    return first + wrapped((1.0 - v) * height, height) * width + wrapped(u * width, width)


@kernel
def wrapped(place: float, size: int) -> int:
    """A coordinate in texels to an index in [0, size), periodically; what is not finite gives 0."""
    turns = place / size
    fraction = turns - math.floor(turns)
    if not 0.0 <= fraction < 1.0:
        return 0
    return min(int(fraction * size), size - 1)


@kernel
def bilinear(texture: Array, texels: Array, u: float, v: float, decode: Array) -> Point:
    """Linear colour at (u, v) of a texture, mixed from four texels; white for one of height 0."""
    first, height, width = texture[0], texture[1], texture[2]
    if height == 0:
        return 1.0, 1.0, 1.0
    x, y = u * width - 0.5, (1.0 - v) * height - 0.5
    left, top = math.floor(x), math.floor(y)
    fx, fy = x - left, y - top
    column, next_column = wrapped(left + 0.5, width), wrapped(left + 1.5, width)
    row, next_row = first + wrapped(top + 0.5, height) * width, first + wrapped(top + 1.5, height) * width
    a, b = texels[row + column], texels[row + next_column]
    c, d = texels[next_row + column], texels[next_row + next_column]
    wa, wb, wc, wd = (1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy
    return (
        wa * decode[a[0]] + wb * decode[b[0]] + wc * decode[c[0]] + wd * decode[d[0]],
        wa * decode[a[1]] + wb * decode[b[1]] + wc * decode[c[1]] + wd * decode[d[1]],
        wa * decode[a[2]] + wb * decode[b[2]] + wc * decode[c[2]] + wd * decode[d[2]],
    )
