"""Pictures for people by deferred shading: soft shadows of sun and sky, textures, a tiled floor, smooth edges."""

import math
from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.lighting import Lights, Surfaces, View, irradiance, specular, tone_mapped, unit3
from artiskill.sensors.point_lights import point_irradiance
from artiskill.sensors.render_config import RenderConfig
from artiskill.sensors.samples import Samples, accumulate_pixels, collect_samples
from artiskill.sensors.scratch import thread_samples, thread_shadow_buffers
from artiskill.sensors.shadow import ShadowMap, ShadowPass, add_visibility
from artiskill.sensors.surface_attributes import surface_attributes
from artiskill.sensors.surroundings import surroundings
from artiskill.sensors.triangle_soup import TriangleSoup

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
