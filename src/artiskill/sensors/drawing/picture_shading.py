"""Pictures for people by deferred shading: soft shadows of sun and sky, textures, a tiled floor, smooth edges.

A pixel has s x s samples of visibility (multisampling, Akeley 1993). If all show the same triangle it is shaded
once, in its middle; otherwise once per run of equal triangles among its samples.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from artiskill.assets.articulated_object import ROOM_WALL
from artiskill.geometry.kernel import Array, Point, kernel
from artiskill.sensors.camera import View
from artiskill.sensors.drawing.backdrop import FLOOR
from artiskill.sensors.drawing.buffers import Samples, thread_samples, thread_shadow_buffers
from artiskill.sensors.drawing.rasterise import point
from artiskill.sensors.drawing.scene_tables import Poses, SceneTables
from artiskill.sensors.drawing.shading import (
    Lights,
    cross3,
    dot3,
    encoded,
    irradiance,
    point_irradiance,
    rotated_normal,
    specular,
    texel_area,
    tone_mapped,
    trilinear,
    unit3,
)
from artiskill.sensors.drawing.shadows import ShadowMap, ShadowPass, add_visibility, transform_vertices
from artiskill.sensors.render_config import RenderConfig

# the sky's light comes from straight up and from this many directions around, this high
_SKY_RING = 5
_SKY_ELEVATION_RAD = math.radians(35)
# the background reaches the zenith's colour at 1 / 1.4 = 0.71: 45 degrees up
_CLIMB = 1.4


class PosedScene(NamedTuple):
    """One state of a scene: vertices `world` (V, 3), and maps of sun and sky, valid until the thread's next."""

    pose: Poses
    world: np.ndarray
    sun: list[ShadowMap]
    sky: list[ShadowMap]


class PictureShader:
    """Shades what was rasterised. Any number of threads may use one: each writes to buffers of its own only."""

    def __init__(self, scene: SceneTables, parts: Sequence[str], light: Lights, config: RenderConfig) -> None:
        """Prepare for a scene, whose `geom_part` counts `parts`."""
        floor, shadows, occlusion = config.floor, config.shadows, config.occlusion
        self._scene, self._light = scene, light
        self._tiles = np.array([floor.tile_m, floor.contrast, floor.fade_start_m, floor.fade_end_m])
        self._occlusion = occlusion.strength if occlusion.enabled else 0.0
        # all but the room's walls: they stand behind everything, and a map that held them would be too coarse
        casts = np.array([name != ROOM_WALL for name in parts], dtype=np.bool_)[scene.geom_part]
        suns = [light.to_sun] if shadows.enabled else []
        skies = _sky_directions() if occlusion.enabled else []
        self._suns = len(suns)
        self._passes = [ShadowPass(scene, casts, sun, shadows.resolution, shadows.softness_m) for sun in suns]
        self._passes += [
            ShadowPass(scene, casts, sky, occlusion.resolution, occlusion.softness_m) for sky in skies
        ]

    def pose(self, pose: Poses) -> PosedScene:
        """Draw the shadow maps of a state: once, for all cameras."""
        world = np.empty_like(self._scene.vertices)
        transform_vertices(self._scene, pose, world)
        buffers = thread_shadow_buffers([one.resolution for one in self._passes], len(world))
        maps = [one.draw(world, into) for one, into in zip(self._passes, buffers, strict=True)]
        return PosedScene(pose, world, maps[: self._suns], maps[self._suns :])

    def shade(
        self, posed: PosedScene, view: View, samples_per_axis: int, triangle: np.ndarray, rgb: np.ndarray
    ) -> None:
        """Colour an image (H, W, 3) from triangle ids (s H, s W); `view` has its lens in units of samples."""
        samples, light = thread_samples(triangle.size), self._light
        count = collect_samples(triangle, samples_per_axis, samples)
        surface_attributes(count, self._scene, posed.pose.rotations, posed.world, view, light.decode, samples)
        surroundings(count, view, light, self._tiles, samples)
        _look_up(count, samples, posed.sun, samples.sunlit)
        _look_up(count, samples, posed.sky, samples.skylit)
        illuminate(count, view.position, light, self._occlusion, samples)
        accumulate_pixels(count, samples, light.encode, rgb)


def _look_up(count: int, samples: Samples, maps: list[ShadowMap], visible: np.ndarray) -> None:
    """Write the mean visibility through several maps, weighted by how much they face the surface; 1 for none."""
    visible[:count] = 0.0
    weight = np.zeros(count, dtype=np.float32)
    for shadow in maps:
        add_visibility(count, shadow, samples, visible, weight)
    asked = weight > 0.0
    np.divide(visible[:count], weight, out=visible[:count], where=asked)
    visible[:count][~asked] = 1.0


def _sky_directions() -> list[np.ndarray]:
    flat, up = math.cos(_SKY_ELEVATION_RAD), math.sin(_SKY_ELEVATION_RAD)
    turns = [2.0 * math.pi * (k + 0.25) / _SKY_RING for k in range(_SKY_RING)]
    ring = [np.array((flat * math.cos(a), flat * math.sin(a), up)) for a in turns]
    return [np.array((0.0, 0.0, 1.0)), *ring]


@kernel
def collect_samples(triangle: Array, s: int, samples: Samples) -> int:
    """List what to shade in a (s H, s W) buffer of triangle ids; return how many samples that takes."""
    pixel, shown, screen, share = samples.pixel, samples.triangle, samples.screen, samples.share
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
def surface_attributes(
    count: int, scene: SceneTables, rotations: Array, world: Array, view: View, decode: Array, samples: Samples
) -> None:
    """Fill the samples that show a triangle; the others are left alone.

    Args:
        count: samples in use.
        scene: what is drawn.
        rotations: of the poses.
        world: (V, 3) vertices.
        view: the camera, its lens in units of samples.
        decode: (256,) sRGB bytes to linear.
        samples: `place_w`, `normal_w`, `colour`, `shininess` and `haze` are written.
    """
    place_w, normal_w, colour = samples.place_w, samples.normal_w, samples.colour
    face_rows, normals, textures, texels = scene.face_rows, scene.point_normals, scene.textures, scene.texels
    for i in range(count):
        t = samples.triangle[i]
        if t < 0:
            continue
        ray = view_ray(samples.screen[i, 0], samples.screen[i, 1], view.rotation, view.lens)
        p0 = from_camera(world, face_rows[t, 0], view.position)
        p1 = from_camera(world, face_rows[t, 1], view.position)
        p2 = from_camera(world, face_rows[t, 2], view.position)
        b0, b1, b2, det = barycentric(p0, p1, p2, ray)
        n0, n1, n2 = (
            point(normals, face_rows[t, 3]),
            point(normals, face_rows[t, 4]),
            point(normals, face_rows[t, 5]),
        )
        side = -1.0 if det > 0.0 else 1.0  # seen from behind: light the back
        geom, uv = face_rows[t, 6], scene.corner_uvs[t]
        normal = rotated_normal(rotations, scene.geom_body[geom] + 1, mixed(b0, b1, b2, n0, n1, n2), side)
        u, v = b0 * uv[0, 0] + b1 * uv[1, 0] + b2 * uv[2, 0], b0 * uv[0, 1] + b1 * uv[1, 1] + b2 * uv[2, 1]
        p = mixed(b0, b1, b2, p0, p1, p2)
        # a face's area on the screen shrinks with the third power of the distance, see `set_up_faces`
        depth = -(view.rotation[0, 2] * p[0] + view.rotation[1, 2] * p[1] + view.rotation[2, 2] * p[2])
        area_px = 0.5 * view.lens[0] * view.lens[0] * abs(det)
        texels_per_px = texel_area(textures[geom], uv) * depth * depth * depth / area_px
        texel = trilinear(textures[geom], texels, u, v, texels_per_px, decode)
        for k in range(3):
            place_w[i, k] = np.float32(p[k] + view.position[k])
            normal_w[i, k] = np.float32(normal[k])
            colour[i, k] = np.float32(scene.materials[geom, k] * texel[k])
        samples.shininess[i], samples.haze[i] = np.float32(scene.materials[geom, 3]), np.float32(0.0)


@kernel
def mixed(b0: float, b1: float, b2: float, p0: Point, p1: Point, p2: Point) -> Point:
    """Return the sum of three points with these weights."""
    return (
        b0 * p0[0] + b1 * p1[0] + b2 * p2[0],
        b0 * p0[1] + b1 * p1[1] + b2 * p2[1],
        b0 * p0[2] + b1 * p1[2] + b2 * p2[2],
    )


@kernel
def view_ray(x: float, y: float, rotation: Array, lens: Array) -> Point:
    """Return the direction in the world of what the screen shows at (x, y), of length 1 along the optical axis."""
    right, up = (x - lens[1]) / lens[0], (lens[2] - y) / lens[0]
    return (
        rotation[0, 0] * right + rotation[0, 1] * up - rotation[0, 2],
        rotation[1, 0] * right + rotation[1, 1] * up - rotation[1, 2],
        rotation[2, 0] * right + rotation[2, 1] * up - rotation[2, 2],
    )


@kernel
def from_camera(world: Array, vertex: int, position: Array) -> Point:
    """Return a vertex relative to the camera's place, along world axes."""
    return world[vertex, 0] - position[0], world[vertex, 1] - position[1], world[vertex, 2] - position[2]


@kernel
def barycentric(p0: Point, p1: Point, p2: Point, ray: Point) -> tuple[float, float, float, float]:
    """Return where a ray from the origin meets a triangle, clamped into it; a determinant, > 0 from behind."""
    c0, c1, c2 = cross3(p1, p2), cross3(p2, p0), cross3(p0, p1)
    det = dot3(p0, c0)
    side = 1.0 if det > 0.0 else -1.0
    b0, b1, b2 = max(0.0, side * dot3(c0, ray)), max(0.0, side * dot3(c1, ray)), max(0.0, side * dot3(c2, ray))
    total = b0 + b1 + b2
    if not total > 0.0:
        return 1.0, 0.0, 0.0, det
    return b0 / total, b1 / total, b2 / total, det


@kernel
def surroundings(count: int, view: View, light: Lights, tiles: Array, samples: Samples) -> None:
    """Fill the samples that show the floor or the background; the others are left alone.

    Args:
        count: samples in use.
        view: the camera, its lens in units of samples.
        light: colours of floor and background.
        tiles: (4,) tile_m, contrast, fade_start_m, fade_end_m of `FloorConfig`.
        samples: written; `place_w` and `normal_w` for the floor only, of the background `colour` is the colour
            itself, and `haze` 1.
    """
    position, rotation, lens = view.position, view.rotation, view.lens
    floor, horizon, zenith = light.floor, light.horizon, light.zenith
    place_w, normal_w, colour, haze = samples.place_w, samples.normal_w, samples.colour, samples.haze
    for i in range(count):
        if samples.triangle[i] >= 0:
            continue
        ray = view_ray(samples.screen[i, 0], samples.screen[i, 1], rotation, lens)
        samples.shininess[i] = np.float32(0.0)
        reach = -position[2] / ray[2]
        away = reach * math.sqrt(ray[0] * ray[0] + ray[1] * ray[1])
        haze[i] = np.float32(smooth_step((away - tiles[2]) / (tiles[3] - tiles[2])))
        if samples.triangle[i] != FLOOR or haze[i] >= 1.0:
            haze[i] = np.float32(1.0)
            climb = min(1.0, max(0.0, _CLIMB * ray[2] / math.sqrt(dot3(ray, ray))))
            for k in range(3):
                colour[i, k] = np.float32(horizon[k] + climb * (zenith[k] - horizon[k]))
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
    """Return how far a ray's foot on the floor moves along x and y when the ray moves by two samples."""
    scale = 2.0 * height / (ray[2] * ray[2] * focal)
    x0 = abs(rotation[0, 0] * ray[2] - ray[0] * rotation[2, 0])
    x1 = abs(rotation[0, 1] * ray[2] - ray[0] * rotation[2, 1])
    y0 = abs(rotation[1, 0] * ray[2] - ray[1] * rotation[2, 0])
    y1 = abs(rotation[1, 1] * ray[2] - ray[1] * rotation[2, 1])
    return scale * max(x0, x1), scale * max(y0, y1)


@kernel
def smooth_step(x: float) -> float:
    """Return 0 below 0, 1 above 1, a cubic between."""
    x = min(1.0, max(0.0, x))
    return x * x * (3.0 - 2.0 * x)


@kernel
def square_wave(x: float, width: float) -> float:
    """Return the mean over `width` of a wave that is +1 and -1 in turns of length 1, by its integral."""
    width = max(width, 1e-6)
    if width > 8.0:
        return 0.0
    return (triangle_wave(x + 0.5 * width) - triangle_wave(x - 0.5 * width)) / width


@kernel
def triangle_wave(x: float) -> float:
    """Return the integral of the square wave: between 0 and 1, period 2."""
    phase = 0.5 * x - math.floor(0.5 * x)
    return 1.0 - abs(2.0 * phase - 1.0)


@kernel
def illuminate(count: int, position: Array, light: Lights, occlusion: float, samples: Samples) -> None:
    """Turn each sample's albedo into its colour, linear in [0, 1], hazy with the horizon.

    Args:
        count: samples in use.
        position: (3,) of the camera.
        light: lights.
        occlusion: how much of the ambient light hiding from the sky takes away.
        samples: `colour` is read and written.
    """
    place_w, normal_w, colour = samples.place_w, samples.normal_w, samples.colour
    sunlit, skylit, shininess, haze = samples.sunlit, samples.skylit, samples.shininess, samples.haze
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


@kernel
def accumulate_pixels(count: int, samples: Samples, encode: Array, rgb: Array) -> None:
    """Write the mean colour of each pixel's samples, which follow one another, as sRGB bytes in rgb (H, W, 3)."""
    pixel, share, colour = samples.pixel, samples.share, samples.colour
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
