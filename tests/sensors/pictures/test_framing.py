import math

import numpy as np
import pytest

from artiskill.errors import ConfigError
from artiskill.sensors.pictures.framing import following_cameras, framing_camera, orbit_camera


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


@pytest.mark.parametrize("calm_frames", [0, 4])
@pytest.mark.parametrize("free_below", [0.0, 0.15])
def test_followers_see_every_frame_and_move_smoothly(rng, calm_frames, free_below):
    """Of points that jump about at random; the lower edge stays free."""
    shape = rng.normal(size=(30, 3))
    frames = [shape * rng.uniform(0.4, 1.0) + rng.normal(size=3) for _ in range(40)]
    cameras = following_cameras(
        frames, 200.0, 20.0, 160, 120, 40.0, free_below=free_below, calm_frames=calm_frames
    )
    for camera, points in zip(cameras, frames, strict=True):
        places, depth = projected(camera, points)
        assert (np.abs(places) < 1.0).all()
        assert places[:, 1].max() < 1.0 - 2.0 * free_below
        assert depth.min() > camera.near_m
    path = np.array([camera.position_w for camera in cameras])
    turns = np.linalg.norm(np.diff(path, n=2, axis=0), axis=1).max()
    assert turns < 0.5 if calm_frames else turns > 2.0


def test_a_follower_without_calm_is_the_nearest_camera_of_its_frame(rng):
    frames = [rng.normal(size=(20, 3)) + k for k in range(3)]
    for camera, points in zip(following_cameras(frames, 30.0, 10.0, 64, 48), frames, strict=True):
        np.testing.assert_array_equal(camera.position_w, framing_camera(points, 30.0, 10.0, 64, 48).position_w)


def test_no_more_than_half_the_picture_stays_free():
    with pytest.raises(ConfigError, match="free share"):
        following_cameras([np.zeros((1, 3))], 0.0, 0.0, 8, 8, free_below=0.6)
