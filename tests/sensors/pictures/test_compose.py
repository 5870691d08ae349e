"""Pictures of observations: who covers whom."""

import numpy as np

from artiskill.sensors.camera import Camera
from artiskill.sensors.pictures.compose import (
    GAP_PX,
    MASK_COLOURS,
    below,
    beside,
    draw_points,
    of_width,
    paint_depth,
    paint_masks,
)

CAMERA = Camera.look_at((0, 0, 0), (1, 0, 0), width=21, height=11)


def test_the_first_mask_wins_and_the_rest_keeps_its_colour() -> None:
    rgb = np.full((3, 3), 100, np.uint8)
    painted = paint_masks(rgb, np.array(((True, True), (False, True), (False, False))), opacity=1.0)
    np.testing.assert_array_equal(painted, (MASK_COLOURS[0], MASK_COLOURS[1], (100, 100, 100)))


def test_near_is_bright_and_nothing_is_black() -> None:
    grey = paint_depth(np.array((0.0, 0.5, 2.0, 99.0), np.float32), far_m=4.0)
    assert grey.shape == (4, 3)
    assert grey[0].tolist() == [0, 0, 0]
    assert grey[1, 0] > grey[2, 0] > grey[3, 0] == 0


def test_nearer_points_cover_farther_ones() -> None:
    xyz = np.array(((2.0, 0, 0), (1.0, 0, 0), (3.0, 0, 0), (-1.0, 0, 0), (50.0, 0, 0)), np.float32)
    rgb = np.arange(15, dtype=np.uint8).reshape(5, 3)
    for radius_m in (0.0, 0.1):
        picture = draw_points(xyz, rgb, CAMERA, radius_m)
        np.testing.assert_array_equal(picture[5, 10], rgb[1])
    assert picture[0, 0].tolist() == [255, 255, 255]
    ahead = xyz.copy()
    ahead[:, 1] = ahead[:, 0] * 0.5
    assert (draw_points(ahead, rgb, CAMERA)[:, :10] != 255).any(), "the left is on the left"


def test_an_empty_cloud_is_an_empty_picture() -> None:
    assert (draw_points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), CAMERA) == 255).all()


def test_points_before_the_lens_stay_small() -> None:
    """Thousands of them are painted in a moment; without a bound they would take minutes."""
    camera = Camera.look_at((0, 0, 0), (1, 0, 0), width=640, height=480, near_m=0.02)
    points = np.full((5000, 3), (0.025, 0.0, 0.0))
    picture = draw_points(points, np.zeros((5000, 3), dtype=np.uint8), camera)
    assert (picture == 0).all(axis=-1).sum() == 25**2


def filled(height, width, value):
    return np.full((height, width, 3), value, dtype=np.uint8)


def test_pictures_stand_beside_and_below_each_other():
    row = beside([filled(4, 5, 10), filled(4, 7, 20)])
    assert row.shape == (4, 12 + GAP_PX, 3)
    assert (row[:, :5] == 10).all()
    assert (row[:, 5 : 5 + GAP_PX] == 255).all()
    assert (row[:, 5 + GAP_PX :] == 20).all()
    sheet = below([row, filled(3, row.shape[1], 30)])
    assert sheet.shape == (7 + GAP_PX, row.shape[1], 3)
    assert (sheet[-3:] == 30).all()


def test_width_is_fitted_in_proportion():
    picture = filled(10, 30, 7)
    assert of_width(picture, 30) is picture
    assert of_width(picture, 60).shape == (20, 60, 3)
    assert (of_width(picture, 12) == 7).all()
