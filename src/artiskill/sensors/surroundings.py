"""Kernel from shading samples on the floor and beyond it to their attributes."""

import math

import numpy as np

from artiskill.geometry.kernel import Array, Point, kernel
from artiskill.sensors.backdrop import FLOOR
from artiskill.sensors.lighting import dot3
from artiskill.sensors.surface_attributes import view_ray

# the background reaches the zenith's colour at 1 / 1.4 = 0.71: 45 degrees up
_CLIMB = 1.4


@kernel
def surroundings(
    count: int,
    position: Array,
    rotation: Array,
    lens: Array,
    floor: Array,
    tiles: Array,
    sky: Array,
    triangle: Array,
    screen: Array,
    place_w: Array,
    normal_w: Array,
    colour: Array,
    shininess: Array,
    haze: Array,
) -> None:
    """Fill the samples that show the floor or the background; the others are left alone.

    Args:
        count: samples in use.
        position: (3,) of the camera, as the next two.
        rotation: (3, 3).
        lens: (5,) in units of samples.
        floor: (3,) linear colour.
        tiles: (4,) tile_m, contrast, fade_start_m, fade_end_m of `FloorConfig`.
        sky: (2, 3) linear colours of horizon and zenith.
        triangle: (S,) see `Samples`, as all that follow.
        screen: (S, 2).
        place_w: (S, 3) written for the floor.
        normal_w: (S, 3) written for the floor.
        colour: (S, 3) written: the floor's albedo, the background's colour.
        shininess: (S,) written.
        haze: (S,) written; 1 for the background.
    """
    for i in range(count):
        if triangle[i] >= 0:
            continue
        ray = view_ray(screen[i, 0], screen[i, 1], rotation, lens)
        shininess[i] = np.float32(0.0)
        reach = -position[2] / ray[2]
        away = reach * math.sqrt(ray[0] * ray[0] + ray[1] * ray[1])
        haze[i] = np.float32(smooth_step((away - tiles[2]) / (tiles[3] - tiles[2])))
        if triangle[i] != FLOOR or haze[i] >= 1.0:
            haze[i] = np.float32(1.0)
            climb = min(1.0, max(0.0, _CLIMB * ray[2] / math.sqrt(dot3(ray, ray))))
            for k in range(3):
                colour[i, k] = np.float32(sky[0, k] + climb * (sky[1, k] - sky[0, k]))
            continue
        x, y = position[0] + reach * ray[0], position[1] + reach * ray[1]
        width_x, width_y = footprint(ray, position[2], rotation, lens[0])
        wave = square_wave(x / tiles[0], width_x / tiles[0]) * square_wave(y / tiles[0], width_y / tiles[0])
        place_w[i, 0], place_w[i, 1], place_w[i, 2] = np.float32(x), np.float32(y), np.float32(0.0)
        normal_w[i, 0], normal_w[i, 1], normal_w[i, 2] = np.float32(0.0), np.float32(0.0), np.float32(1.0)
        for k in range(3):
            colour[i, k] = np.float32(floor[k] * (1.0 + 0.5 * tiles[1] * wave))


@kernel
def footprint(ray: Point, height: float, rotation: Array, focal: float) -> tuple[float, float]:
    """How far, along x and y, a ray's foot on the floor moves when its place on the screen does by two samples."""
    scale = 2.0 * height / (ray[2] * ray[2] * focal)
    x0 = abs(rotation[0, 0] * ray[2] - ray[0] * rotation[2, 0])
    x1 = abs(rotation[0, 1] * ray[2] - ray[0] * rotation[2, 1])
    y0 = abs(rotation[1, 0] * ray[2] - ray[1] * rotation[2, 0])
    y1 = abs(rotation[1, 1] * ray[2] - ray[1] * rotation[2, 1])
    return scale * max(x0, x1), scale * max(y0, y1)


@kernel
def smooth_step(x: float) -> float:
    """0 below 0, 1 above 1, a cubic between."""
    x = min(1.0, max(0.0, x))
    return x * x * (3.0 - 2.0 * x)


@kernel
def square_wave(x: float, width: float) -> float:
    """Mean over `width` of a wave that is +1 and -1 in turns of length 1, by its integral, a triangle wave."""
    width = max(width, 1e-6)
    if width > 8.0:
        return 0.0
    return (triangle_wave(x + 0.5 * width) - triangle_wave(x - 0.5 * width)) / width


@kernel
def triangle_wave(x: float) -> float:
    """Integral of the square wave: between 0 and 1, period 2."""
    phase = 0.5 * x - math.floor(0.5 * x)
    return 1.0 - abs(2.0 * phase - 1.0)
