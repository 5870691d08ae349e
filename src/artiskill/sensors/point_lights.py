"""Light of lamps that stand somewhere in the scene, weaker with distance; they throw no shadows."""

import math

import numpy as np

from artiskill.geometry.kernel import Array, Point, kernel
from artiskill.sensors.backdrop import FLOOR
from artiskill.sensors.lighting import Lights, View, dot3, encoded, irradiance, tone_mapped

_UP = (0.0, 0.0, 1.0)
# nearer than this a lamp gets no brighter: the inverse square would have no bound
_NEAREST_SQUARE_M2 = 0.05**2


@kernel
def point_irradiance(place: Point, normal: Point, light: Lights) -> Point:
    """Light of all lamps on a surface: inverse square of the distance, Lambert's cosine.

    A smooth window takes it to zero at the lamp's range (Karis 2013).
    """
    red, green, blue = 0.0, 0.0, 0.0
    lamps = light.lamps
    for i in range(lamps.shape[0]):
        way = (lamps[i, 0] - place[0], lamps[i, 1] - place[1], lamps[i, 2] - place[2])
        squared = dot3(way, way)
        share = squared * lamps[i, 6]
        cosine = dot3(normal, way)
        if not (share < 1.0 and cosine > 0.0):
            continue
        window = 1.0 - share * share
        weight = cosine / math.sqrt(squared) * (window * window) / max(squared, _NEAREST_SQUARE_M2)
        red += weight * lamps[i, 3]
        green += weight * lamps[i, 4]
        blue += weight * lamps[i, 5]
    return red, green, blue


@kernel
def light_floor(top: int, view: View, light: Lights, triangle: Array, rgb: Array) -> None:
    """Colour the floor pixel by pixel where lamps make it uneven.

    Args:
        top: the view's row that comes first in the next arrays.
        view: the camera.
        light: with lamps.
        triangle: (R, W) int32 what the pixels show.
        rgb: (R, W, 3) uint8 written.
    """
    r, per_px = view.rotation, 1.0 / view.lens[0]
    height = view.position[2]
    for row in range(triangle.shape[0]):
        up = (view.lens[2] - 0.5 - (top + row)) * per_px
        for column in range(triangle.shape[1]):
            if triangle[row, column] != FLOOR:
                continue
            right = (column + 0.5 - view.lens[1]) * per_px
            depth = height / -(r[2, 0] * right + r[2, 1] * up - r[2, 2])
            x = view.position[0] + depth * (r[0, 0] * right + r[0, 1] * up - r[0, 2])
            y = view.position[1] + depth * (r[1, 0] * right + r[1, 1] * up - r[1, 2])
            received = irradiance(_UP, 1.0, 1.0, light)
            added = point_irradiance((x, y, 0.0), _UP, light)
            for k in range(3):
                value = tone_mapped((received[k] + added[k]) * light.floor[k])
                rgb[row, column, k] = np.uint8(encoded(value, light.encode) + 0.5)
