import math

import numpy as np
import pytest

from artiskill.errors import ConfigError
from artiskill.sensors.camera import Camera


def test_look_at_puts_the_target_in_the_middle_and_up_upwards():
    camera = Camera.look_at((1.0, 2.0, 3.0), (-2.0, 0.5, 1.0), width=64, height=48)
    for point, expected in (((-2.0, 0.5, 1.0), (32, 24)),):
        in_camera = camera.extrinsics @ np.array([*point, 1.0])
        pixel = camera.intrinsics @ in_camera[:3]
        np.testing.assert_allclose(pixel[:2] / pixel[2], expected, atol=1e-9)
        assert in_camera[2] == pytest.approx(math.dist((1, 2, 3), point))
    above = camera.intrinsics @ (camera.extrinsics @ np.array([-2.0, 0.5, 1.5, 1.0]))[:3]
    assert above[1] / above[2] < 24
    assert camera.rotation_w[2, 0] == pytest.approx(0.0)


def test_field_of_view_is_vertical():
    camera = Camera(np.zeros(3), np.eye(3), 400, 160, fov_rad=math.radians(60))
    top = camera.intrinsics @ np.array([0.0, -math.tan(math.radians(30)), 1.0])
    assert top[1] == pytest.approx(0.0, abs=1e-9)


def test_straight_down_has_x_upwards():
    camera = Camera.look_at((0, 0, 2), (0, 0, 0), width=4, height=4)
    np.testing.assert_allclose(camera.rotation_w[:, 1], (1, 0, 0), atol=1e-12)
    np.testing.assert_allclose(camera.rotation_w[:, 2], (0, 0, 1), atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0}, "width"),
        ({"height": 2.5}, "height"),
        ({"fov_rad": math.pi}, "fov_rad"),
        ({"near_m": 0.0}, "near_m"),
        ({"near_m": 2.0, "far_m": 1.0}, "near_m < far_m"),
        ({"far_m": math.nan}, "far_m"),
        ({"position_w": (0, math.nan, 0)}, "finite"),
        ({"position_w": (0, 0)}, "shape"),
        ({"rotation_w": np.eye(3) * 2}, "rotation"),
        ({"rotation_w": np.diag((1.0, 1.0, -1.0))}, "rotation"),
        ({"rotation_w": np.full((3, 3), np.nan)}, "rotation"),
        ({"rotation_w": np.eye(4)}, "shape"),
    ],
)
def test_illegal_cameras_are_named(change, message):
    legal = {"position_w": np.zeros(3), "rotation_w": np.eye(3), "width": 8, "height": 8}
    with pytest.raises(ConfigError, match=message):
        Camera(**{**legal, **change})


def test_look_at_needs_two_points():
    with pytest.raises(ConfigError, match="two different points"):
        Camera.look_at((1, 1, 1), (1, 1, 1), width=8, height=8)
