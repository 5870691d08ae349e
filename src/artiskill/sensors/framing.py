"""Cameras for pictures: placed by angles about a point, near enough that what is to be seen fills the picture."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.config import check, check_value, check_vector
from artiskill.sensors.camera import Camera

FAR_M = 60.0  # the floor runs to the horizon
_NEAR_M = 0.02
_MARGIN = 0.06  # of the picture's half, left free on each side


@dataclass(frozen=True)
class WorldCameraConfig:
    """The camera that people look through when they say nothing else.

    Attributes:
        eye_w_m: (x, y, z) where it stands.
        target_w_m: (x, y, z) of the middle of its picture.
        fov_deg: vertical field of view.
    """

    eye_w_m: tuple[float, ...]
    target_w_m: tuple[float, ...]
    fov_deg: float

    def __post_init__(self) -> None:
        check_vector(self, "eye_w_m", "target_w_m")
        check_value(self, "fov_deg", 0 < self.fov_deg < 180, "must lie in (0, 180)")
        check(self.eye_w_m != self.target_w_m, "eye_w_m and target_w_m must be different points")


def orbit_camera(
    target_w: Any,
    distance_m: float,
    azimuth_deg: float,
    elevation_deg: float,
    width: int,
    height: int,
    fov_deg: float = 45.0,
) -> Camera:
    """A camera that looks at a point from a direction.

    Args:
        target_w: (3,) the point in the middle of the picture, metres.
        distance_m: from there to the camera.
        azimuth_deg: where the camera stands, counter-clockwise from +x seen from above.
        elevation_deg: where it stands above the horizon, [-90, 90].
        width: pixels.
        height: pixels.
        fov_deg: vertical field of view, in (0, 180).

    Raises:
        ConfigError: a value out of range or not finite.
    """
    target, backward = _checked_point(target_w), _direction(azimuth_deg, elevation_deg)
    check(0 < distance_m < math.inf, f"the camera's distance must be positive and finite, not {distance_m}")
    lens = _lens(width, height, fov_deg)
    return Camera.look_at(target + distance_m * backward, target, far_m=max(FAR_M, 2 * distance_m), **lens)


def framing_camera(
    points_w: np.ndarray,
    azimuth_deg: float,
    elevation_deg: float,
    width: int,
    height: int,
    fov_deg: float = 45.0,
) -> Camera:
    """The nearest camera from a direction that sees all points, with a small margin.

    Each side of the view is a plane that must leave all points inside; opposite sides share the play equally.

    Args:
        points_w: (N, 3) with N >= 1, metres.
        azimuth_deg: as in `orbit_camera`, as all that follow.
        elevation_deg: .
        width: pixels.
        height: pixels.
        fov_deg: .

    Raises:
        ConfigError: a value out of range or not finite.
    """
    backward = _direction(azimuth_deg, elevation_deg)
    lens = _lens(width, height, fov_deg)
    axes = Camera.look_at(backward, np.zeros(3), **lens).rotation_w  # columns right, up, backward
    right, up, depth = (points_w @ axes * (1.0, 1.0, -1.0)).T
    slope = math.tan(math.radians(fov_deg) / 2) * (1.0 - _MARGIN)
    x, nearest_x = _fit_axis(right, depth, slope * width / height)
    y, nearest_y = _fit_axis(up, depth, slope)
    nearest = min(nearest_x, nearest_y, float(depth.min()) - 2 * _NEAR_M)
    eye = axes @ np.array((x, y, -nearest))
    far = max(FAR_M, 2.0 * (float(depth.max()) - nearest))
    return Camera(eye, axes, far_m=far, **lens)


def _fit_axis(place: np.ndarray, depth: np.ndarray, slope: float) -> tuple[float, float]:
    """Where the camera must stand along one image axis, and how deep at most, to see all points."""
    high, low = float((place - slope * depth).max()), float((-place - slope * depth).max())
    return (high - low) / 2, -(high + low) / (2 * slope)


def _direction(azimuth_deg: float, elevation_deg: float) -> np.ndarray:
    check(math.isfinite(azimuth_deg), f"the camera's azimuth must be finite, not {azimuth_deg}")
    check(-90 <= elevation_deg <= 90, f"the camera's elevation must lie in [-90, 90] degrees, not {elevation_deg}")
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    flat = math.cos(elevation)
    return np.array((flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)))


def _lens(width: int, height: int, fov_deg: float) -> dict[str, Any]:
    check(0 < fov_deg < 180, f"the field of view must lie in (0, 180) degrees, not {fov_deg}")
    return {"width": width, "height": height, "fov_rad": math.radians(fov_deg), "near_m": _NEAR_M}


def _checked_point(point: Any) -> np.ndarray:
    value = np.asarray(point, dtype=np.float64)
    legal = value.shape == (3,) and bool(np.isfinite(value).all())
    check(legal, f"the camera's target must be three finite numbers, not {value.tolist()}")
    return value
