"""Cameras for pictures: placed by angles about a point, near enough that what is to be seen fills the picture."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

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
    return following_cameras([points_w], azimuth_deg, elevation_deg, width, height, fov_deg)[0]


def following_cameras(
    points_w: Sequence[np.ndarray],
    azimuth_deg: float,
    elevation_deg: float,
    width: int,
    height: int,
    fov_deg: float = 45.0,
    *,
    free_below: float = 0.0,
    calm_frames: int = 0,
) -> list[Camera]:
    """A camera for each frame of a film that sees all points of its frame, and moves smoothly without turning.

    What the camera must see is, in each frame, all of so many frames around it; the mean of such demands over as
    many frames is met in the middle one of them.

    Args:
        points_w: of each frame (N, 3) with N >= 1, metres.
        azimuth_deg: as in `framing_camera`, as all that follow.
        elevation_deg: .
        width: pixels.
        height: pixels.
        fov_deg: .
        free_below: share of the picture's height, [0, 0.5], that is left free at its lower edge: for a caption.
        calm_frames: how many frames before and after matter; 0 for the nearest camera of each frame.

    Raises:
        ConfigError: a value out of range or not finite.
    """
    backward = _direction(azimuth_deg, elevation_deg)
    lens = _lens(width, height, fov_deg)
    axes = Camera.look_at(backward, np.zeros(3), **lens).rotation_w  # columns right, up, backward
    slopes = _slopes(width, height, fov_deg, free_below)
    demands = np.array([_demands(points @ axes * (1.0, 1.0, -1.0), slopes) for points in points_w])
    cameras = []
    for *planes, depth, behind in _calmed(demands, slopes, calm_frames).tolist():
        right, left, top, bottom = (plane + slope * depth for plane, slope in zip(planes, slopes, strict=True))
        eye = axes @ np.array(((right - left) / 2, (top - bottom) / 2, -depth))
        cameras.append(Camera(eye, axes, far_m=max(FAR_M, 2.0 * (behind - depth)), **lens))
    return cameras


def _slopes(width: int, height: int, fov_deg: float, free_below: float) -> np.ndarray:
    """Return how far what must be seen may lie to the right, left, top and bottom, at depth 1."""
    check(0 <= free_below <= 0.5, f"the free share of the picture must lie in [0, 0.5], not {free_below}")
    above = math.tan(math.radians(fov_deg) / 2) * (1.0 - _MARGIN)
    side = above * width / height
    return np.array((side, side, above, above * (1.0 - 2.0 * free_below)))


def _demands(points: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """What a camera must satisfy to see all points (N, 3) of right, up and depth: (6,), greater is stricter.

    The planes to the right, left, top and bottom through the eye open by `slopes`; the first four numbers say
    where they must be at depth 0. Then how near the points come, negated, and how far they go.
    """
    right, up, depth = points.T
    places = (right, -right, up, -up)
    planes = [float((place - slope * depth).max()) for place, slope in zip(places, slopes, strict=True)]
    return np.array((*planes, -float(depth.min()), float(depth.max())))


def _calmed(demands: np.ndarray, slopes: np.ndarray, frames: int) -> np.ndarray:
    """Planes, the greatest depth of the eye that they allow, and the farthest depth, smooth over time: (T, 6).

    Running means, by a Hann window, of what running maxima ask for. The planes' means allow the depth's mean,
    because it is concave in them.
    """
    window = 2 * frames + 1
    padded = np.pad(demands, ((2 * frames, 2 * frames), (0, 0)), mode="edge")
    bounds = sliding_window_view(padded, window, axis=0).max(axis=-1)
    pairs = bounds[:, 0:4:2] + bounds[:, 1:4:2]
    depths = np.minimum(-(pairs / (slopes[::2] + slopes[1::2])).max(axis=1), -bounds[:, 4] - 2 * _NEAR_M)
    wanted = np.column_stack((bounds[:, :4], depths, bounds[:, 5]))
    weights = np.hanning(window + 2)[1:-1]
    return (sliding_window_view(wanted, window, axis=0) * (weights / weights.sum())).sum(axis=-1)


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
