"""Clouds, masks and codes from depth and ids, against the renderer's own positions and plain NumPy."""

import math

import numpy as np
import pytest

from artiskill.errors import ConfigError
from artiskill.sensors.observations.point_cloud import (
    COUNTS,
    classify_pixels,
    classify_points,
    mask_codes,
    move_to_frame,
    points_of_pixels,
    rays_of,
    write_channels,
    write_cloud,
)
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import Renderer


@pytest.fixture(scope="module")
def seen(little_scene):
    """Two cameras' images, one of them mostly of the sky; their rays; random overlapping masks of the visuals."""
    camera = little_scene.camera
    upwards = camera.look_at(camera.position_w, (0, 0, 2.5), width=160, height=120, fov_rad=camera.fov_rad)
    cameras = (camera, upwards)
    images = Renderer(little_scene.visuals, load_render_config("fast")).render(
        little_scene.positions_w,
        little_scene.quaternions_w,
        cameras,
        ("rgb", "depth", "geom", "position_w"),
    )
    masks = np.random.default_rng(0).random((3, len(little_scene.visuals))) < 0.4
    return images, rays_of(cameras), masks


def expected_seg(geom: np.ndarray, masks: np.ndarray) -> np.ndarray:
    return np.where((geom >= 0)[..., None], masks.T[np.maximum(geom, 0)], False)


def full_cloud(images, rays, masks) -> tuple[np.ndarray, np.ndarray]:
    xyz = np.empty((*images.geom.shape, 3), np.float32)
    seg = np.zeros((*images.geom.shape, len(masks)), np.bool_)
    write_cloud(images.depth, images.geom, mask_codes(masks), rays, xyz, seg)
    return xyz, seg


def test_points_are_where_the_renderer_says(seen) -> None:
    images, _, masks = seen
    xyz, seg = full_cloud(*seen)
    np.testing.assert_allclose(xyz, images.position_w, atol=1e-5)
    np.testing.assert_array_equal(seg, expected_seg(images.geom, masks))
    nothing = images.geom == -1
    assert nothing.any()
    assert not xyz[nothing].any()
    assert np.abs(xyz[images.geom == -2][:, 2]).max() < 2e-6, "the floor is flat"


def test_chosen_pixels_give_the_same_bits(seen) -> None:
    images, rays, _ = seen
    xyz, _ = full_cloud(*seen)
    chosen = np.flatnonzero(images.geom.reshape(-1) != -1).astype(np.int32)[::7]
    some = np.empty((len(chosen), 3), np.float32)
    points_of_pixels(images.depth, chosen, rays, some)
    np.testing.assert_array_equal(some, xyz.reshape(-1, 3)[chosen])


def test_codes_say_masks_and_ground(seen) -> None:
    images, rays, masks = seen
    xyz, seg = full_cloud(*seen)
    codes = np.empty(images.geom.shape, np.uint8)
    classify_pixels(images.depth, images.geom, mask_codes(masks), rays, codes)
    counts = (images.geom >= 0) & (xyz[..., 2] > np.float32(1e-3))
    expected = np.where(counts, (seg * [1, 2, 4]).sum(-1) + int(COUNTS), 0)
    np.testing.assert_array_equal(codes, expected)
    of_points = np.empty(codes.size, np.uint8)
    classify_points(xyz.reshape(-1, 3), seg.reshape(-1, 3), of_points)
    np.testing.assert_array_equal(of_points, expected.reshape(-1))


def test_channels_of_a_camera_stand_together(seen) -> None:
    images, _, masks = seen
    cameras, height, width = images.geom.shape
    rgb = np.empty((height, width, cameras, 3), np.uint8)
    depth = np.empty((height, width, cameras), np.float32)
    seg = np.zeros((height, width, cameras, len(masks)), np.bool_)
    write_channels(images.rgb, images.depth, images.geom, mask_codes(masks), rgb, depth, seg)
    np.testing.assert_array_equal(rgb, np.moveaxis(images.rgb, 0, 2))
    np.testing.assert_array_equal(depth, np.moveaxis(images.depth, 0, 2))
    np.testing.assert_array_equal(seg, np.moveaxis(expected_seg(images.geom, masks), 0, 2))


def test_at_most_seven_masks() -> None:
    assert mask_codes(np.ones((7, 2), np.bool_)).tolist() == [0, 0, 127, 127]
    with pytest.raises(ConfigError, match="7 masks, not 8"):
        mask_codes(np.ones((8, 2), np.bool_))


def test_moving_to_a_frame_and_back() -> None:
    angle = 0.4
    rotation = np.array(
        ((math.cos(angle), -math.sin(angle), 0.0), (math.sin(angle), math.cos(angle), 0.0), (0.0, 0.0, 1.0))
    )
    origin = np.array((1.0, -2.0, 0.5))
    in_frame = np.random.default_rng(1).normal(size=(20, 3))
    xyz = (in_frame @ rotation.T + origin).astype(np.float32)
    move_to_frame(xyz, origin, rotation)
    np.testing.assert_allclose(xyz, in_frame, atol=1e-6)
