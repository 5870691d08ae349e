import math

import numpy as np
import pytest

from artiskill.errors import ConfigError
from artiskill.sensors.framing import framing_camera, orbit_camera


def projected(camera, points_w):
    """Image coordinates (N, 2) in units of the picture's half sides, and depths (N,)."""
    in_camera = points_w @ camera.extrinsics[:3, :3].T + camera.extrinsics[:3, 3]
    pixels = in_camera @ camera.intrinsics.T
    half = np.array((camera.width, camera.height)) / 2
    return (pixels[:, :2] / pixels[:, 2:] - half) / half, in_camera[:, 2]


@pytest.mark.parametrize(("width", "height"), [(640, 480), (200, 600), (900, 100)])
@pytest.mark.parametrize("elevation", [-90, -20, 0, 35, 90])
def test_everything_fits_and_nothing_nearer_would_do(rng, width, height, elevation):
    points = rng.normal(size=(50, 3)) * (0.3, 1.0, 2.0) + (5, -4, 3)
    camera = framing_camera(points, 200.0, elevation, width, height, fov_deg=40)
    places, depth = projected(camera, points)
    assert (np.abs(places) < 1).all()
    assert (depth > camera.near_m).all()
    assert depth.max() < camera.far_m
    low, high = places.min(axis=0), places.max(axis=0)
    fills = (high - low) / 2 > 0.9
    assert fills.any(), "one of the sides is used"
    np.testing.assert_allclose(high[fills], -low[fills], atol=0.02)  # and the play on both sides is alike


def test_a_single_point_is_seen_in_the_middle():
    camera = framing_camera(np.array([[1.0, 2.0, 3.0]]), 10.0, 5.0, 30, 20)
    places, depth = projected(camera, np.array([[1.0, 2.0, 3.0]]))
    np.testing.assert_allclose(places, 0.0, atol=1e-9)
    assert depth[0] > camera.near_m


def test_an_orbit_stands_where_it_says():
    camera = orbit_camera((1.0, 2.0, 0.5), 3.0, 180.0, 30.0, 64, 48)
    np.testing.assert_allclose(camera.position_w, (1 - 3 * math.cos(math.pi / 6), 2, 0.5 + 1.5), atol=1e-12)
    places, depth = projected(camera, np.array([[1.0, 2.0, 0.5]]))
    np.testing.assert_allclose(places, 0.0, atol=1e-9)
    assert depth[0] == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"target_w": (0.0, math.nan, 0.0)}, "target"),
        ({"target_w": (0.0, 1.0)}, "target"),
        ({"distance_m": 0.0}, "distance"),
        ({"distance_m": math.inf}, "distance"),
        ({"azimuth_deg": math.nan}, "azimuth"),
        ({"elevation_deg": 90.5}, "elevation"),
        ({"fov_deg": 180.0}, "field of view"),
        ({"width": 0}, "width"),
    ],
)
def test_bad_viewpoints_are_named(change, message):
    legal = {
        **{"target_w": (0.0, 0.0, 0.0), "distance_m": 1.0, "azimuth_deg": 0.0, "elevation_deg": 0.0},
        **{"width": 8, "height": 8, "fov_deg": 45.0},
    }
    with pytest.raises(ConfigError, match=message):
        orbit_camera(**{**legal, **change})
