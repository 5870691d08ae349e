"""Pictures for people by deferred shading: soft shadows of sun and sky, textures, a tiled floor, smooth edges."""

import math
from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, Point, kernel
from artiskill.sensors.camera import View
from artiskill.sensors.drawing.backdrop import FLOOR
from artiskill.sensors.drawing.buffers import Samples, thread_samples, thread_shadow_buffers
from artiskill.sensors.drawing.scene_tables import TriangleSoup
from artiskill.sensors.drawing.shading import (
    Lights,
    Surfaces,
    cross3,
    dot3,
    encoded,
    irradiance,
    point_irradiance,
    specular,
    texel_area,
    tone_mapped,
    trilinear,
    turned_normal,
    unit3,
)
from artiskill.sensors.drawing.shadows import ShadowMap, ShadowPass, add_visibility
from artiskill.sensors.render_config import RenderConfig


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


@kernel
def surface_attributes(
    count: int,
    surface: Surfaces,
    view: View,
    decode: Array,
    triangle: Array,
    screen: Array,
    place_w: Array,
    normal_w: Array,
    colour: Array,
    shininess: Array,
    haze: Array,
) -> None:
    """Fill the samples that show a triangle; the others are left alone.

    Args:
        count: samples in use.
        surface: what is drawn.
        view: the camera, its lens in units of samples.
        decode: (256,) sRGB bytes to linear.
        triangle: (S,) see `Samples`, as all that follow.
        screen: (S, 2).
        place_w: (S, 3) written.
        normal_w: (S, 3) written.
        colour: (S, 3) written.
        shininess: (S,) written.
        haze: (S,) written.
    """
    for i in range(count):
        t = triangle[i]
        if t < 0:
            continue
        ray = view_ray(screen[i, 0], screen[i, 1], view.rotation, view.lens)
        face = surface.faces[t]
        p0 = from_camera(surface.world, face[0], view.position)
        p1 = from_camera(surface.world, face[1], view.position)
        p2 = from_camera(surface.world, face[2], view.position)
        b0, b1, b2, det = barycentric(p0, p1, p2, ray)
        n = surface.corner_normals[t]
        uv = surface.corner_uvs[t]
        mixed = (
            b0 * n[0, 0] + b1 * n[1, 0] + b2 * n[2, 0],
            b0 * n[0, 1] + b1 * n[1, 1] + b2 * n[2, 1],
            b0 * n[0, 2] + b1 * n[1, 2] + b2 * n[2, 2],
        )
        side = -1.0 if det > 0.0 else 1.0  # seen from behind: light the back
        normal = turned_normal(surface.rotations, surface.face_body[t] + 1, mixed, side)
        geom = surface.face_geom[t]
        u, v = b0 * uv[0, 0] + b1 * uv[1, 0] + b2 * uv[2, 0], b0 * uv[0, 1] + b1 * uv[1, 1] + b2 * uv[2, 1]
        p = (
            b0 * p0[0] + b1 * p1[0] + b2 * p2[0],
            b0 * p0[1] + b1 * p1[1] + b2 * p2[1],
            b0 * p0[2] + b1 * p1[2] + b2 * p2[2],
        )
        images = surface.textures[geom]
        # a face's area on the screen shrinks with the third power of the distance, see `set_up_faces`
        depth = -(view.rotation[0, 2] * p[0] + view.rotation[1, 2] * p[1] + view.rotation[2, 2] * p[2])
        area_px = 0.5 * view.lens[0] * view.lens[0] * abs(det)
        texels_per_px = texel_area(images, uv) * depth * depth * depth / area_px
        texel = trilinear(images, surface.texels, u, v, texels_per_px, decode)
        for k in range(3):
            place_w[i, k] = np.float32(p[k] + view.position[k])
            normal_w[i, k] = np.float32(normal[k])
            colour[i, k] = np.float32(surface.materials[geom, k] * texel[k])
        shininess[i] = np.float32(surface.materials[geom, 3])
        haze[i] = np.float32(0.0)


@kernel
def view_ray(x: float, y: float, rotation: Array, lens: Array) -> Point:
    """Direction in the world of what the screen shows at (x, y), of length 1 along the optical axis."""
    right, up = (x - lens[1]) / lens[0], (lens[2] - y) / lens[0]
    return (
        rotation[0, 0] * right + rotation[0, 1] * up - rotation[0, 2],
        rotation[1, 0] * right + rotation[1, 1] * up - rotation[1, 2],
        rotation[2, 0] * right + rotation[2, 1] * up - rotation[2, 2],
    )


@kernel
def from_camera(world: Array, vertex: int, position: Array) -> Point:
    """A vertex relative to the camera's place, along world axes."""
    return world[vertex, 0] - position[0], world[vertex, 1] - position[1], world[vertex, 2] - position[2]


@kernel
def barycentric(p0: Point, p1: Point, p2: Point, ray: Point) -> tuple[float, float, float, float]:
    """Where a ray from the origin meets a triangle, clamped into it, and the determinant, positive from behind."""
    c0, c1, c2 = cross3(p1, p2), cross3(p2, p0), cross3(p0, p1)
    det = dot3(p0, c0)
    side = 1.0 if det > 0.0 else -1.0
    b0, b1, b2 = max(0.0, side * dot3(c0, ray)), max(0.0, side * dot3(c1, ray)), max(0.0, side * dot3(c2, ray))
    total = b0 + b1 + b2
    if not total > 0.0:
        return 1.0, 0.0, 0.0, det
    return b0 / total, b1 / total, b2 / total, det


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


# the sky's light comes from straight up and from this many directions around, this high
_SKY_RING = 5
_SKY_ELEVATION_RAD = math.radians(35)


class ShadowMaps(NamedTuple):
    """Of one state of a scene: of the sun, and of the directions that the sky's light comes from."""

    sun: list[ShadowMap]
    sky: list[ShadowMap]


class PictureShader:
    """Shades what was rasterised. Any number of threads may use one: each writes to buffers of its own only."""

    def __init__(self, soup: TriangleSoup, light: Lights, config: RenderConfig) -> None:
        """Prepare for a scene."""
        floor = config.floor
        self._light = light
        self._tiles = np.array([floor.tile_m, floor.contrast, floor.fade_start_m, floor.fade_end_m])
        self._background = np.stack((light.horizon, light.zenith))
        self._occlusion = config.occlusion.strength if config.occlusion.enabled else 0.0
        self._sun_passes: list[ShadowPass] = []
        self._sky_passes: list[ShadowPass] = []
        shadows, occlusion = config.shadows, config.occlusion
        if shadows.enabled:
            self._sun_passes.append(ShadowPass(soup, light.to_sun, shadows.resolution, shadows.softness_m))
        if occlusion.enabled:
            for direction in _sky_directions():
                self._sky_passes.append(ShadowPass(soup, direction, occlusion.resolution, occlusion.softness_m))
        self._map_sides = [one.resolution for one in (*self._sun_passes, *self._sky_passes)]

    def draw_shadow_maps(self, world: np.ndarray) -> ShadowMaps:
        """The shadow maps for vertices (V, 3) in the world: once per state, for all cameras.

        They are valid until the calling thread draws others, of whatever scene.
        """
        buffers = thread_shadow_buffers(self._map_sides, len(world))
        passes = (*self._sun_passes, *self._sky_passes)
        maps = [one.draw(world, into) for one, into in zip(passes, buffers, strict=True)]
        return ShadowMaps(maps[: len(self._sun_passes)], maps[len(self._sun_passes) :])

    def shade(
        self,
        surface: Surfaces,
        view: View,
        maps: ShadowMaps,
        samples_per_axis: int,
        triangle: np.ndarray,
        rgb: np.ndarray,
    ) -> None:
        """Colour an image (H, W, 3) from triangle ids (s H, s W); `view` has its lens in units of samples."""
        q, light = thread_samples(triangle.size), self._light
        count = collect_samples(triangle, samples_per_axis, q.pixel, q.triangle, q.screen, q.share)
        attributes = q.triangle, q.screen, q.place_w, q.normal_w, q.colour, q.shininess, q.haze
        surface_attributes(count, surface, view, light.decode, *attributes)
        surroundings(count, *view, light.floor, self._tiles, self._background, *attributes)
        self._look_up(count, q, maps.sun, q.sunlit)
        self._look_up(count, q, maps.sky, q.skylit)
        geometry, visibility = (q.place_w, q.normal_w), (q.sunlit, q.skylit)
        illuminate(
            count, view.position, light, self._occlusion, *geometry, *visibility, q.shininess, q.haze, q.colour
        )
        accumulate_pixels(count, q.pixel, q.share, q.colour, light.encode, rgb)

    @staticmethod
    def _look_up(count: int, q: Samples, maps: list[ShadowMap], visible: np.ndarray) -> None:
        """Mean visibility through several maps, weighted by how much they face the surface; 1 where none does."""
        visible[:count] = 0.0
        weight = np.zeros(count, dtype=np.float32)
        for shadow in maps:
            add_visibility(count, *shadow, q.place_w, q.normal_w, q.haze, visible, weight)
        asked = weight > 0.0
        np.divide(visible[:count], weight, out=visible[:count], where=asked)
        visible[:count][~asked] = 1.0


@kernel
def illuminate(
    count: int,
    position: Array,
    light: Lights,
    occlusion: float,
    place_w: Array,
    normal_w: Array,
    sunlit: Array,
    skylit: Array,
    shininess: Array,
    haze: Array,
    colour: Array,
) -> None:
    """Turn each sample's albedo into its colour, linear in [0, 1], hazy with the horizon.

    Args:
        count: samples in use.
        position: (3,) of the camera.
        light: lights.
        occlusion: how much of the ambient light hiding from the sky takes away.
        place_w: (S, 3) see `Samples`, as all that follow.
        normal_w: (S, 3).
        sunlit: (S,).
        skylit: (S,).
        shininess: (S,).
        haze: (S,).
        colour: (S, 3) read and written.
    """
    for i in range(count):
        if haze[i] >= 1.0 and shininess[i] == 0.0:
            continue
        normal = (np.float64(normal_w[i, 0]), np.float64(normal_w[i, 1]), np.float64(normal_w[i, 2]))
        ambient = 1.0 - occlusion * (1.0 - skylit[i])
        received = irradiance(normal, np.float64(sunlit[i]), ambient, light)
        if light.lamps.shape[0] > 0:
            place = (np.float64(place_w[i, 0]), np.float64(place_w[i, 1]), np.float64(place_w[i, 2]))
            added = point_irradiance(place, normal, light)
            received = (received[0] + added[0], received[1] + added[1], received[2] + added[2])
        shine = 0.0
        if shininess[i] > 0.0:
            to_eye = unit3((position[0] - place_w[i, 0], position[1] - place_w[i, 1], position[2] - place_w[i, 2]))
            shine = sunlit[i] * specular(normal, to_eye, np.float64(shininess[i]), light)
        for k in range(3):
            value = tone_mapped(received[k] * colour[i, k] + shine * light.sun[k])
            colour[i, k] = np.float32(value + haze[i] * (light.horizon[k] - value))


def _sky_directions() -> list[np.ndarray]:
    flat, up = math.cos(_SKY_ELEVATION_RAD), math.sin(_SKY_ELEVATION_RAD)
    turns = [2.0 * math.pi * (k + 0.25) / _SKY_RING for k in range(_SKY_RING)]
    ring = [np.array((flat * math.cos(a), flat * math.sin(a), up)) for a in turns]
    return [np.array((0.0, 0.0, 1.0)), *ring]
