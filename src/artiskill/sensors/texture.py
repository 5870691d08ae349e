"""Kernels that look up textures: nearest texel, and linear in the image and between its mipmaps."""

import math

import numpy as np

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
def mip_level(images: Array, uv: Array, area: float, cube: float) -> int:
    """The version of a texture whose texels are nearest in size to the pixels of a face.

    Args:
        images: (M, 3) of the texture, the largest first.
        uv: (3, 2) of the face's corners.
        area: times 1 / cube the face's area on the screen, pixels.
        cube: product of the corners' depths; may be 0, as if seen from very near.
    """
    texels = texel_area(images, uv) * cube
    level = 0
    while texels > 2.0 * area and level < images.shape[0] - 1:
        texels *= 0.25
        level += 1
    return level


@kernel
def texel_area(images: Array, uv: Array) -> float:
    """Texels of the largest version that a face covers."""
    du1, dv1, du2, dv2 = uv[1, 0] - uv[0, 0], uv[1, 1] - uv[0, 1], uv[2, 0] - uv[0, 0], uv[2, 1] - uv[0, 1]
    return 0.5 * abs(np.float64(du1) * dv2 - np.float64(du2) * dv1) * images[0, 1] * images[0, 2]


@kernel
def trilinear(images: Array, texels: Array, u: float, v: float, texels_per_px: float, decode: Array) -> Point:
    """Linear colour at (u, v), mixed from the two versions of a texture that fit the pixels; white for none.

    `texels_per_px` counts those of the largest version in a pixel's area. Between versions, whose counts are four
    to one, the mixture follows the count, not its logarithm, which differs between machines.
    """
    level = 0
    while texels_per_px >= 4.0 and level < images.shape[0] - 1:
        texels_per_px *= 0.25
        level += 1
    near = bilinear(images[level], texels, u, v, decode)
    if not texels_per_px > 1.0 or level == images.shape[0] - 1:
        return near
    share = min((texels_per_px - 1.0) / 3.0, 1.0)
    far = bilinear(images[level + 1], texels, u, v, decode)
    return (
        near[0] + share * (far[0] - near[0]),
        near[1] + share * (far[1] - near[1]),
        near[2] + share * (far[2] - near[2]),
    )


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
