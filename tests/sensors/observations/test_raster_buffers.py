"""Observations against images of the whole views and plain NumPy, bit for bit, however little is asked for."""

import math
from dataclasses import replace

import numpy as np
import pytest

from artiskill.sensors.camera import Camera, views_of
from artiskill.sensors.observations.point_cloud import COUNTS, classify_points, mask_codes
from artiskill.sensors.observations.raster_buffers import CloudArrays, ImageArrays, RasterBuffers
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import Images, Renderer

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


@pytest.fixture(params=[(case, quality) for case in CASES for quality in ("fast", "picture")], ids=" ".join)
def seen(request, little_scene, rng) -> tuple[RasterBuffers, Images, np.ndarray]:
    """Buffers, images of the same, and random overlapping masks of the visuals."""
    (size, number, changes), quality = CASES[request.param[0]], request.param[1]
    scene, cameras = little_scene, cameras_of(little_scene, size, number)
    renderer = Renderer(scene.visuals, load_render_config(quality, changes))
    poses = scene.positions_w, scene.quaternions_w
    images = renderer.render(*poses, cameras, ("rgb", "depth", "geom", "position_w"))
    masks = rng.random((MASKS, len(scene.visuals))) < 0.4
    return renderer.rasterise(*poses, views_of(cameras)), images, masks


def seg_of(images: Images, masks: np.ndarray) -> np.ndarray:
    """(C, H, W, k) masks."""
    return np.where((images.geom >= 0)[..., None], masks.T[np.maximum(images.geom, 0)], False)


def full_cloud(buffers: RasterBuffers, images: Images, masks: np.ndarray) -> CloudArrays:
    shape = images.geom.shape
    cloud = CloudArrays(
        np.full((*shape, 3), 7, np.float32), np.full((*shape, 3), 7, np.uint8), np.ones((*shape, MASKS), np.bool_)
    )
    buffers.write_cloud(mask_codes(masks), cloud)
    return cloud


def test_channels_of_a_camera_stand_together(seen):
    buffers, images, masks = seen
    cameras, height, width = images.geom.shape
    found = ImageArrays(
        np.full((height, width, cameras, 3), 7, np.uint8),
        np.full((height, width, cameras), 7, np.float32),
        np.ones((height, width, cameras, MASKS), np.bool_),
    )
    for _ in range(2):  # the second time with buffers that were used
        buffers.write_images(mask_codes(masks), found)
    np.testing.assert_array_equal(found.rgb, np.moveaxis(images.rgb, 0, 2))
    np.testing.assert_array_equal(found.depth, np.moveaxis(images.depth, 0, 2))
    np.testing.assert_array_equal(found.seg, np.moveaxis(seg_of(images, masks), 0, 2))


def test_points_are_where_the_renderer_says(seen):
    buffers, images, masks = seen
    cloud = full_cloud(buffers, images, masks)
    np.testing.assert_allclose(cloud.xyz, images.position_w, atol=1e-5)
    np.testing.assert_array_equal(cloud.rgb, images.rgb)
    np.testing.assert_array_equal(cloud.seg, seg_of(images, masks))
    assert not cloud.xyz[images.geom == -1].any()
    if (images.geom == -2).any():
        assert np.abs(cloud.xyz[images.geom == -2][:, 2]).max() < 2e-6, "the floor is flat"


def test_classes_say_masks_and_ground(seen):
    buffers, images, masks = seen
    cloud = full_cloud(buffers, images, masks)
    counts = (images.geom >= 0) & (cloud.xyz[..., 2] > np.float32(1e-3))
    expected = np.where(counts, (cloud.seg * [1, 2, 4]).sum(-1) + int(COUNTS), 0).reshape(-1)
    np.testing.assert_array_equal(buffers.classify(mask_codes(masks)), expected)
    of_points = np.empty(len(expected), np.uint8)
    seg = np.where((images.geom == -2)[..., None], False, cloud.seg)
    classify_points(cloud.xyz.reshape(-1, 3), seg.reshape(-1, MASKS), of_points)
    shown = (images.geom != -2).reshape(-1)
    np.testing.assert_array_equal(of_points[shown], expected[shown])


def test_chosen_points_are_those_of_the_full_cloud(seen, rng):
    buffers, images, masks = seen
    whole = CloudArrays(*(part.reshape(images.geom.size, -1) for part in full_cloud(buffers, images, masks)))
    classes = buffers.classify(mask_codes(masks))
    counting = np.flatnonzero(classes & COUNTS).astype(np.int32)
    chosen = rng.permutation(counting)[: max(1, len(counting) // 3)]
    assert len(chosen) > 0 or classes.size < 100
    np.testing.assert_array_equal(buffers.positions(chosen), whole.xyz[chosen])
    found = CloudArrays(
        np.full((len(chosen), 3), 7, np.float32),
        np.zeros((len(chosen), 3), np.uint8),
        np.ones((len(chosen), MASKS), np.bool_),
    )
    for _ in range(2):
        buffers.write_points(chosen, classes, found)
    for part, expected in zip(found, whole, strict=True):
        np.testing.assert_array_equal(part, expected[chosen])
    buffers.write_points(chosen[:0], classes, CloudArrays(*(part[:0] for part in found)))  # none at all
