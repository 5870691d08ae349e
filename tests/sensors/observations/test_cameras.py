"""The cameras on the base: where they stand, where they look, and what users are told of them."""

import math

import numpy as np
import pytest

from artiskill.config import from_mapping
from artiskill.errors import ConfigError
from artiskill.sensors.camera import Camera, Views, views_of
from artiskill.sensors.observations.cameras import CamerasConfig, Panorama
from artiskill.tasks.registry import make_task

VALUES = {
    "number": 3,
    "width": 400,
    "height": 160,
    "mount_height_m": 1.5,
    "pitch_down_deg": 45,
    "fov_deg": 60,
    "near_m": 0.1,
    "far_m": 10,
}


def config(**changes) -> CamerasConfig:
    return from_mapping(CamerasConfig, {**VALUES, **changes})


def cameras_of(views: Views) -> list[Camera]:
    return [
        Camera(position, rotation, 400, 160, math.radians(60))
        for position, rotation in zip(views.positions, views.rotations, strict=True)
    ]


def test_the_task_has_the_benchmarks_cameras() -> None:
    assert make_task("OpenCabinetDrawer").cameras == config()
    assert make_task("OpenCabinetDrawer", {"cameras.mount_height_m": 2}).cameras == config(mount_height_m=2)


def test_cameras_stand_120_degrees_apart_and_look_45_degrees_down() -> None:
    yaw = 0.3
    panorama = Panorama(config())
    for k, camera in enumerate(cameras_of(panorama.views(1.0, -2.0, yaw))):
        heading = yaw + k * 2 * math.pi / 3
        forward = np.array((math.cos(heading), math.sin(heading), -1.0)) / math.sqrt(2.0)
        np.testing.assert_allclose(-camera.rotation_w[:, 2], forward, atol=1e-12)
        np.testing.assert_allclose(camera.position_w, (1.0, -2.0, 1.5))
        assert camera.rotation_w[2, 0] == 0.0, "the horizon is level"
        assert (camera.width, camera.height, camera.near_m, camera.far_m) == (400, 160, 0.1, 10.0)
        assert camera.fov_rad == pytest.approx(math.radians(60))
        same = Camera.look_at(camera.position_w, camera.position_w + forward, width=400, height=160)
        np.testing.assert_allclose(camera.rotation_w, same.rotation_w, atol=1e-12)


@pytest.mark.parametrize("pitch_down_deg", [-90, 0, 90])
def test_any_pitch_gives_legal_cameras(pitch_down_deg: float) -> None:
    panorama = Panorama(config(pitch_down_deg=pitch_down_deg))
    assert len(cameras_of(panorama.views(0.0, 0.0, 1.0))) == 3  # the class checks that it is a rotation


def test_parameters_take_points_to_pixels() -> None:
    panorama = Panorama(config())
    x, y, yaw = 0.7, -0.4, 2.0
    views = panorama.views(x, y, yaw)
    cameras, parameters = cameras_of(views), panorama.parameters(views)
    assert {name: values.shape for name, values in parameters.items()} == {
        "intrinsics": (3, 3, 3),
        "world_to_camera": (3, 4, 4),
        "robot_to_camera": (3, 4, 4),
    }
    in_robot = np.array((0.3, 0.1, 0.2, 1.0))
    turn = np.array(((math.cos(yaw), -math.sin(yaw)), (math.sin(yaw), math.cos(yaw))))
    in_world = np.array((*(turn @ in_robot[:2] + (x, y)), 0.2, 1.0))
    for k, camera in enumerate(cameras):
        seen = parameters["robot_to_camera"][k] @ in_robot
        np.testing.assert_allclose(parameters["world_to_camera"][k] @ in_world, seen, atol=1e-12)
        axis = parameters["world_to_camera"][k] @ (*(camera.position_w - 2 * camera.rotation_w[:, 2]), 1.0)
        pixel = parameters["intrinsics"][k] @ axis[:3] / axis[2]
        np.testing.assert_allclose(pixel, (200, 80, 1), atol=1e-9)


def test_arrays_and_cameras_are_the_same_bits() -> None:
    panorama = Panorama(config(number=5, pitch_down_deg=33.0))
    views = panorama.views(0.7, -0.4, 2.0)
    cameras = cameras_of(views)
    of_cameras = views_of(cameras)
    for given, expected in zip(views, of_cameras, strict=True):
        np.testing.assert_array_equal(given, expected)
    extrinsics = np.stack([camera.extrinsics for camera in cameras])
    assert panorama.parameters(views)["world_to_camera"].tobytes() == extrinsics.tobytes()


def test_reach_is_the_farthest_corner() -> None:
    panorama = Panorama(config())
    ray = np.linalg.inv(panorama.parameters(panorama.views(0, 0, 0))["intrinsics"][0])
    assert config().reach_m == pytest.approx(10 * np.linalg.norm(ray @ (0, 0, 1)))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"number": 0}, "number"),
        ({"number": 2.5}, "number"),
        ({"width": 0}, "width"),
        ({"height": 5000}, "height"),
        ({"mount_height_m": math.inf}, "mount_height_m"),
        ({"pitch_down_deg": 91}, "pitch_down_deg"),
        ({"pitch_down_deg": math.nan}, "pitch_down_deg"),
        ({"fov_deg": 180}, "fov_deg"),
        ({"near_m": 0}, "near_m"),
        ({"far_m": 0.05}, "far_m"),
        ({"fov": 60}, "fov_deg"),
    ],
)
def test_illegal_values(changes: dict, says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        config(**changes)
