"""What the shading kernels read, surfaces, view and lights, as tuples of arrays; small functions of light."""

import math
from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, Point, kernel
from artiskill.sensors.render_config import RenderConfig
from artiskill.sensors.triangle_soup import TriangleSoup

# the display curve is tabulated up to this much light; its steps are fine enough for 8 bits in the darkest tones
_ENCODE_STEPS = 8192
_SPECULAR_STRENGTH = 0.35


class Surfaces(NamedTuple):
    """Arrays of a `TriangleSoup` and its present pose: `world` (V, 3), `rotations` (N + 1, 3, 3)."""

    world: Array
    rotations: Array
    faces: Array
    face_geom: Array
    face_body: Array
    corner_normals: Array
    corner_uvs: Array
    materials: Array
    textures: Array
    texels: Array


class View(NamedTuple):
    """A camera as arrays: position (3,), rotation (3, 3), lens (5,) as from `Camera.lens`."""

    position: Array
    rotation: Array
    lens: Array


class Lights(NamedTuple):
    """Lights and colours, each (3,) float64.

    `to_sun` is a unit vector, `horizon` and `zenith` are linear values of the finished picture, the rest is linear
    light times the exposure. `lamps` (L, 7): position, light at a distance of 1 m, 1 / range^2. `encode` (8193,)
    takes linear [0, 1] to the display's [0, 255], `decode` (256,) back.
    """

    to_sun: Array
    sun: Array
    sky: Array
    bounce: Array
    lamps: Array
    floor: Array
    horizon: Array
    zenith: Array
    encode: Array
    decode: Array


def surfaces(soup: TriangleSoup, world: Array, rotations: Array) -> Surfaces:
    """The soup in its present pose."""
    return Surfaces(
        world,
        rotations,
        soup.faces,
        soup.face_geom,
        soup.face_body,
        soup.corner_normals,
        soup.corner_uvs,
        soup.materials,
        soup.textures,
        soup.texels,
    )


def lights(config: RenderConfig) -> Lights:
    """The config's colours, ready for the kernels."""
    exposure = config.exposure
    steps = [_srgb_encoded(i / _ENCODE_STEPS) * 255.0 for i in range(_ENCODE_STEPS + 1)]
    return Lights(
        to_sun=np.array(config.sun.direction_w),
        sun=np.array(config.sun.colour) * (config.sun.strength * exposure),
        sky=np.array(config.ambient.sky) * exposure,
        bounce=np.array(config.ambient.ground) * exposure,
        lamps=_lamp_rows(config),
        floor=np.array(config.floor.colour),
        horizon=np.array([_srgb_decoded(c) for c in config.background.horizon]),
        zenith=np.array([_srgb_decoded(c) for c in config.background.zenith]),
        encode=np.array(steps),
        decode=np.array([_srgb_decoded(i / 255.0) for i in range(256)]),
    )


def plain_colours(light: Lights) -> np.ndarray:
    """(2, 3) uint8 display colours of background and floor where they are not shaded per pixel."""
    table = np.empty((2, 3))
    _encode_plain(light, table)
    return table.round().astype(np.uint8)


def _lamp_rows(config: RenderConfig) -> np.ndarray:
    rows = np.zeros((len(config.lamps), 7))
    for row, lamp in zip(rows, config.lamps, strict=True):
        row[:3] = lamp.position_w
        row[3:6] = np.array(lamp.colour) * (lamp.strength * config.exposure)
        row[6] = 1.0 / lamp.range_m**2
    return rows


@kernel
def irradiance(normal: Point, sunlit: float, skylit: float, light: Lights) -> Point:
    """Light on a surface: hemisphere ambient and the sun by Lambert's cosine, as far as they reach the place."""
    up = 0.5 + 0.5 * normal[2]
    sun = sunlit * max(0.0, dot3(normal, (light.to_sun[0], light.to_sun[1], light.to_sun[2])))
    return (
        skylit * (light.bounce[0] + up * (light.sky[0] - light.bounce[0])) + sun * light.sun[0],
        skylit * (light.bounce[1] + up * (light.sky[1] - light.bounce[1])) + sun * light.sun[1],
        skylit * (light.bounce[2] + up * (light.sky[2] - light.bounce[2])) + sun * light.sun[2],
    )


@kernel
def specular(normal: Point, to_eye: Point, shininess: float, light: Lights) -> float:
    """Blinn's (1977) highlight of the sun; its exponent is a power of two from 8 to 256, no `pow` needed."""
    hx, hy, hz = light.to_sun[0] + to_eye[0], light.to_sun[1] + to_eye[1], light.to_sun[2] + to_eye[2]
    half = unit3((hx, hy, hz))
    value = max(0.0, dot3(normal, half))
    for _ in range(3 + int(5.0 * shininess)):
        value *= value
    return _SPECULAR_STRENGTH * shininess * value


@kernel
def tone_mapped(x: float) -> float:
    """Light of any strength to [0, 1]: Narkowicz's (2015) fit of the ACES film curve."""
    x = max(x, 0.0) * 0.8
    return min(1.0, (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14))


@kernel
def encoded(x: float, encode: Array) -> float:
    """Linear [0, 1] to the display's [0, 255] by table, interpolated."""
    steps = encode.shape[0] - 1
    place = x * steps
    if not place > 0.0:
        return encode[0]
    i = int(place) if place < steps else steps - 1
    return encode[i] + min(1.0, place - i) * (encode[i + 1] - encode[i])


@kernel
def _encode_plain(light: Lights, table: Array) -> None:
    """Background and floor in the sun, on the display's scale of 0 .. 255, into (2, 3)."""
    received = irradiance((0.0, 0.0, 1.0), 1.0, 1.0, light)
    for k in range(3):
        table[0, k] = encoded(light.horizon[k], light.encode)
        table[1, k] = encoded(tone_mapped(received[k] * light.floor[k]), light.encode)


@kernel
def dot3(a: Point, b: Point) -> float:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross3(a: Point, b: Point) -> Point:
    """Cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def unit3(a: Point) -> Point:
    """Unit vector; zero and NaN give +z, so that light stays finite."""
    squared = dot3(a, a)
    if not squared > 1e-30:
        return 0.0, 0.0, 1.0
    inverse = 1.0 / math.sqrt(squared)
    return a[0] * inverse, a[1] * inverse, a[2] * inverse


def _srgb_encoded(x: float) -> float:
    return 12.92 * x if x <= 0.0031308 else 1.055 * x ** (1 / 2.4) - 0.055


def _srgb_decoded(x: float) -> float:
    return x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4
