"""Lights and textures: what both ways of shading share."""

import math
from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, Point, kernel
from artiskill.sensors.camera import View
from artiskill.sensors.drawing.backdrop import FLOOR
from artiskill.sensors.render_config import RenderConfig

# the display curve is tabulated up to this much light; its steps are fine enough for 8 bits in the darkest tones
_ENCODE_STEPS = 8192
_SPECULAR_STRENGTH = 0.35


class Lights(NamedTuple):
    """Lights and colours, each (3,) float64 unless it says otherwise.

    Attributes:
        to_sun: unit vector.
        sun: linear light times the exposure, as the next two.
        sky: on a surface that faces up.
        bounce: on a surface that faces down.
        lamps: (L, 7) position, light at a distance of 1 m, 1 / range^2.
        has_floor: whether the ground is drawn.
        floor: linear colour.
        horizon: linear value of the finished picture, as the next one.
        zenith: straight up.
        encode: (8193,) takes linear [0, 1] to the display's [0, 255].
        decode: (256,) takes it back.
        plain: (2, 3) uint8 display colours of background and floor where they are not shaded per pixel.
    """

    to_sun: Array
    sun: Array
    sky: Array
    bounce: Array
    lamps: Array
    has_floor: bool
    floor: Array
    horizon: Array
    zenith: Array
    encode: Array
    decode: Array
    plain: Array


def lights(config: RenderConfig) -> Lights:
    """Return the config's colours, ready for the kernels."""
    exposure = config.exposure
    steps = [_srgb_encoded(i / _ENCODE_STEPS) * 255.0 for i in range(_ENCODE_STEPS + 1)]
    light = Lights(
        to_sun=np.array(config.sun.direction_w),
        sun=np.array(config.sun.colour) * (config.sun.strength * exposure),
        sky=np.array(config.ambient.sky) * exposure,
        bounce=np.array(config.ambient.ground) * exposure,
        lamps=_lamp_rows(config),
        has_floor=config.floor.enabled,
        floor=np.array(config.floor.colour),
        horizon=np.array([_srgb_decoded(c) for c in config.background.horizon]),
        zenith=np.array([_srgb_decoded(c) for c in config.background.zenith]),
        encode=np.array(steps),
        decode=np.array([_srgb_decoded(i / 255.0) for i in range(256)]),
        plain=np.zeros((2, 3), dtype=np.uint8),
    )
    table = np.empty((2, 3))
    _encode_plain(light, table)
    return light._replace(plain=table.round().astype(np.uint8))


def _lamp_rows(config: RenderConfig) -> np.ndarray:
    rows = np.zeros((len(config.lamps), 7))
    for row, lamp in zip(rows, config.lamps, strict=True):
        row[:3] = lamp.position_w
        row[3:6] = np.array(lamp.colour) * (lamp.strength * config.exposure)
        row[6] = 1.0 / lamp.range_m**2
    return rows


@kernel
def irradiance(normal: Point, sunlit: float, skylit: float, light: Lights) -> Point:
    """Return the light on a surface: hemisphere ambient and the sun by Lambert's cosine."""
    up = 0.5 + 0.5 * normal[2]
    sun = sunlit * max(0.0, dot3(normal, (light.to_sun[0], light.to_sun[1], light.to_sun[2])))
    return (
        skylit * (light.bounce[0] + up * (light.sky[0] - light.bounce[0])) + sun * light.sun[0],
        skylit * (light.bounce[1] + up * (light.sky[1] - light.bounce[1])) + sun * light.sun[1],
        skylit * (light.bounce[2] + up * (light.sky[2] - light.bounce[2])) + sun * light.sun[2],
    )


@kernel
def specular(normal: Point, to_eye: Point, shininess: float, light: Lights) -> float:
    """Return Blinn's (1977) highlight of the sun; its exponent is a power of two, 8 to 256: no `pow` needed."""
    hx, hy, hz = light.to_sun[0] + to_eye[0], light.to_sun[1] + to_eye[1], light.to_sun[2] + to_eye[2]
    half = unit3((hx, hy, hz))
    value = max(0.0, dot3(normal, half))
    for _ in range(3 + int(5.0 * shininess)):
        value *= value
    return _SPECULAR_STRENGTH * shininess * value


@kernel
def tone_mapped(x: float) -> float:
    """Map light of any strength to [0, 1]: Narkowicz's (2015) fit of the ACES film curve."""
    x = max(x, 0.0) * 0.8
    return min(1.0, (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14))


@kernel
def encoded(x: float, encode: Array) -> float:
    """Map linear [0, 1] to the display's [0, 255] by table, interpolated."""
    steps = encode.shape[0] - 1
    place = x * steps
    if not place > 0.0:
        return encode[0]
    i = int(place) if place < steps else steps - 1
    return encode[i] + min(1.0, place - i) * (encode[i + 1] - encode[i])


@kernel
def _encode_plain(light: Lights, table: Array) -> None:
    """Write background and floor in the sun, on the display's scale of 0 .. 255, into (2, 3)."""
    received = irradiance((0.0, 0.0, 1.0), 1.0, 1.0, light)
    for k in range(3):
        table[0, k] = encoded(light.horizon[k], light.encode)
        table[1, k] = encoded(tone_mapped(received[k] * light.floor[k]), light.encode)


@kernel
def dot3(a: Point, b: Point) -> float:
    """Return the inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross3(a: Point, b: Point) -> Point:
    """Return the cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def unit3(a: Point) -> Point:
    """Return the unit vector; zero and NaN give +z, so that light stays finite."""
    squared = dot3(a, a)
    if not squared > 1e-30:
        return 0.0, 0.0, 1.0
    inverse = 1.0 / math.sqrt(squared)
    return a[0] * inverse, a[1] * inverse, a[2] * inverse


def _srgb_encoded(x: float) -> float:
    return 12.92 * x if x <= 0.0031308 else 1.055 * x ** (1 / 2.4) - 0.055


def _srgb_decoded(x: float) -> float:
    return x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4


@kernel
def rotated_normal(rotations: Array, pose: int, n: Point, side: float) -> Point:
    """Rotate a body-frame normal to the world, unit length, turned to the side that is seen."""
    r = rotations
    return unit3(
        (
            side * (r[pose, 0, 0] * n[0] + r[pose, 0, 1] * n[1] + r[pose, 0, 2] * n[2]),
            side * (r[pose, 1, 0] * n[0] + r[pose, 1, 1] * n[1] + r[pose, 1, 2] * n[2]),
            side * (r[pose, 2, 0] * n[0] + r[pose, 2, 1] * n[1] + r[pose, 2, 2] * n[2]),
        )
    )


_UP = (0.0, 0.0, 1.0)
# nearer than this a lamp gets no brighter: the inverse square would have no bound
_NEAREST_SQUARE_M2 = 0.05**2


@kernel
def point_irradiance(place: Point, normal: Point, light: Lights) -> Point:
    """Return the light of all lamps on a surface: inverse square of the distance, Lambert's cosine.

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


@kernel
def texel_row(first: int, height: int, width: int, u: float, v: float) -> int:
    """Return the row of the texel table nearest to (u, v) of a texture with its first texel there.

    Images repeat, v points up.
    """
    return first + wrapped((1.0 - v) * height, height) * width + wrapped(u * width, width)


@kernel
def wrapped(place: float, size: int) -> int:
    """Turn a coordinate in texels into an index in [0, size), periodically; what is not finite gives 0."""
    turns = place / size
    fraction = turns - math.floor(turns)
    if not 0.0 <= fraction < 1.0:
        return 0
    return min(int(fraction * size), size - 1)


@kernel
def mip_level(images: Array, uv: Array, area: float, cube: float) -> int:
    """Return the version of a texture whose texels are nearest in size to the pixels of a face.

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
    """Return how many texels of the largest version that a face covers."""
    du1, dv1, du2, dv2 = uv[1, 0] - uv[0, 0], uv[1, 1] - uv[0, 1], uv[2, 0] - uv[0, 0], uv[2, 1] - uv[0, 1]
    return 0.5 * abs(np.float64(du1) * dv2 - np.float64(du2) * dv1) * images[0, 1] * images[0, 2]


@kernel
def trilinear(images: Array, texels: Array, u: float, v: float, texels_per_px: float, decode: Array) -> Point:
    """Return the linear colour at (u, v), mixed from the two versions of a texture that fit the pixels.

    White where there is no texture. `texels_per_px` counts those of the largest version in a pixel's area. Between
    versions, whose counts are four to one, the mixture follows the count, not its logarithm, which differs between
    machines.
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
    """Return the linear colour at (u, v) of a texture, mixed from four texels; white for one of height 0."""
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
