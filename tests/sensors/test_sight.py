"""A sight gives what images of the whole views give, bit for bit, however little is asked for."""

import math
from dataclasses import replace

import numpy as np
import pytest

from artiskill.sensors.camera import Camera, views_of
from artiskill.sensors.observations.point_cloud import COUNTS, mask_codes, rays_of
from artiskill.sensors.observations.raster_buffers import CHANNELS, PictureSight
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import Renderer

MASKS = 3
LAMP = {"position_w": [0, 0, 2], "colour": [1, 1, 1], "strength": 2, "range_m": 5}
CASES = {
    "three": ((160, 120), 3, {}),
    "one": ((61, 40), 1, {}),
    "two, no floor": ((48, 33), 2, {"floor.enabled": False}),
    "four": ((16, 17), 4, {}),
    "three, tiny": ((5, 3), 3, {}),
    "three, a lamp": ((80, 50), 3, {"lamps": [LAMP]}),
}


def cameras_of(scene, size, number):
    """The first as the scene's, the others turned, the last rolled: what is nearer than the horizon is slanted."""
    lens = {"width": size[0], "height": size[1], "far_m": 5.0}
    first = replace(scene.camera, **lens)
    lens |= {"near_m": first.near_m, "fov_rad": first.fov_rad}
    turns = range(1, number)
    eyes = ((2 * math.cos(k), 2 * math.sin(k), 1) for k in turns)
    ups = ((0.2 * (k == 3), 0, 1) for k in turns)
    return [first, *(Camera.look_at(eye, (0, 0, 0.4), up, **lens) for eye, up in zip(eyes, ups, strict=True))]


@pytest.fixture(params=CASES)
def seen(request, little_scene):
    """A sight, the same from images, and rays."""
    size, number, changes = CASES[request.param]
    scene, cameras = little_scene, cameras_of(little_scene, size, number)
    renderer = Renderer(scene.visuals, load_render_config("fast", changes))
    poses = scene.positions_w, scene.quaternions_w
    images = renderer.render(*poses, cameras, CHANNELS)
    return renderer.sight(*poses, views_of(cameras), size[::-1]), PictureSight(images), rays_of(cameras)


def codes_of(sight, rng):
    return mask_codes(rng.random((MASKS, len(sight.scene.geom_body))) < 0.4)


def test_channels_are_those_of_the_images(seen, rng):
    sight, pictures, _ = seen
    codes = codes_of(sight, rng)
    cameras, height, width = pictures.images.geom.shape
    found, expected = (
        (
            np.full((height, width, cameras, 3), 7, np.uint8),
            np.full((height, width, cameras), 7, np.float32),
            np.ones((height, width, cameras, MASKS), np.bool_),
        )
        for _ in range(2)
    )
    for _ in range(2):  # the second time with buffers that were used
        sight.channels(codes, *found)
    pictures.channels(codes, *expected)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)


def test_clouds_are_those_of_the_images(seen, rng):
    sight, pictures, rays = seen
    codes, shape = codes_of(sight, rng), pictures.images.geom.shape
    found, expected = (
        (
            np.full((*shape, 3), 7, np.float32),
            np.full((*shape, 3), 7, np.uint8),
            np.ones((*shape, MASKS), np.bool_),
        )
        for _ in range(2)
    )
    sight.cloud(codes, rays, *found)
    pictures.cloud(codes, rays, *expected)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)


def test_chosen_points_are_those_of_the_images(seen, rng):
    sight, pictures, rays = seen
    codes = codes_of(sight, rng)
    classes = sight.classified(codes, rays)
    np.testing.assert_array_equal(classes, pictures.classified(codes, rays))
    counting = np.flatnonzero(classes & COUNTS).astype(np.int32)
    chosen = rng.permutation(counting)[: max(1, len(counting) // 3)]
    assert len(chosen) > 0 or classes.size < 100
    np.testing.assert_array_equal(sight.positions(chosen, rays), pictures.positions(chosen, rays))
    found, expected = (
        (
            np.full((len(chosen), 3), 7, np.float32),
            np.zeros((len(chosen), 3), np.uint8),
            np.ones((len(chosen), 3), bool),
        )
        for _ in range(2)
    )
    for _ in range(2):
        sight.points(chosen, rays, classes, *found)
    pictures.points(chosen, rays, classes, *expected)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)
    sight.points(chosen[:0], rays, classes, *(part[:0] for part in found))  # none at all
