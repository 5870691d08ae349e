"""Kernels at both ends of a picture: from visibility to shading samples, and from their colours to pixels.

A pixel has s x s samples of visibility (multisampling, Akeley 1993). If all show the same triangle it is shaded
once, in its middle; otherwise once per run of equal triangles among its samples. Shading samples live in arrays
of length S, of which the first `count` are in use.
"""

from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.lighting import encoded


class Samples(NamedTuple):
    """Where to shade and what is there, by stages of deferred shading.

    From `collect_samples`: `pixel` (S,) int32 row * width + column, `triangle` (S,) int32, `screen` (S, 2)
    float32 x and y in samples, `share` (S,) float32 of its pixel. From the attribute kernels: `place_w` (S, 3),
    `normal_w` (S, 3), `colour` (S, 3) linear albedo, later light; `shininess` (S,); `haze` (S,) share of the
    horizon's colour. From shadow kernels: `sunlit` (S,), `skylit` (S,), both in [0, 1]. All float32.
    """

    pixel: Array
    triangle: Array
    screen: Array
    share: Array
    place_w: Array
    normal_w: Array
    colour: Array
    shininess: Array
    haze: Array
    sunlit: Array
    skylit: Array


def allocate_samples(count: int) -> Samples:
    """Buffers for so many samples; memory that is never touched is never used."""

    def floats(*shape: int) -> Array:
        return np.empty((count, *shape), dtype=np.float32)

    def integers() -> Array:
        return np.empty(count, dtype=np.int32)

    return Samples(
        pixel=integers(),
        triangle=integers(),
        screen=floats(2),
        share=floats(),
        place_w=floats(3),
        normal_w=floats(3),
        colour=floats(3),
        shininess=floats(),
        haze=floats(),
        sunlit=floats(),
        skylit=floats(),
    )


@kernel
def collect_samples(triangle: Array, s: int, pixel: Array, shown: Array, screen: Array, share: Array) -> int:
    """List what to shade in a (s H, s W) buffer of triangle ids; returns how many samples that takes."""
    count = 0
    width = triangle.shape[1] // s
    for row in range(triangle.shape[0] // s):
        for column in range(width):
            begin = count
            for k in range(s * s):
                y, x = row * s + k // s, column * s + k % s
                if count > begin and shown[count - 1] == triangle[y, x]:
                    share[count - 1] += np.float32(1.0)
                    continue
                pixel[count] = row * width + column
                shown[count] = triangle[y, x]
                screen[count, 0] = np.float32(x + 0.5)
                screen[count, 1] = np.float32(y + 0.5)
                share[count] = np.float32(1.0)
                count += 1
            if count == begin + 1:
                screen[begin, 0] = np.float32((column + 0.5) * s)
                screen[begin, 1] = np.float32((row + 0.5) * s)
            for k in range(begin, count):
                share[k] /= np.float32(s * s)
    return count


@kernel
def accumulate_pixels(count: int, pixel: Array, share: Array, colour: Array, encode: Array, rgb: Array) -> None:
    """Mean colour of each pixel's samples, which follow one another, as sRGB bytes in rgb (H, W, 3)."""
    width = rgb.shape[1]
    i = 0
    while i < count:
        red, green, blue = 0.0, 0.0, 0.0
        place = pixel[i]
        while i < count and pixel[i] == place:
            red += share[i] * colour[i, 0]
            green += share[i] * colour[i, 1]
            blue += share[i] * colour[i, 2]
            i += 1
        row, column = place // width, place % width
        rgb[row, column, 0] = np.uint8(encoded(red, encode) + 0.5)
        rgb[row, column, 1] = np.uint8(encoded(green, encode) + 0.5)
        rgb[row, column, 2] = np.uint8(encoded(blue, encode) + 0.5)
