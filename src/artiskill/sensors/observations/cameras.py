"""`Panorama`: cameras spread evenly about the vertical, mounted on the robot's base."""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.config import check
from artiskill.sensors.camera import Camera, Views, views_of

_MOST_CAMERAS = 16
_OPENCV_SIGNS = np.array([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class CamerasConfig:
    """The cameras on the base: they move and turn with it, not with the lift.

    Attributes:
        number: of cameras, 1 to 16. The first looks forward, the others follow counter-clockwise seen from above.
        width: [px] of each camera's image.
        height: [px] of each camera's image.
        mount_height_m: of the optical centres, all on the base's vertical axis.
        pitch_down_deg: of the optical axes below the horizon, [-90, 90].
        fov_deg: vertical field of view, in (0, 180).
        near_m: what is closer along the optical axis is not seen.
        far_m: what is farther along the optical axis is not seen.
    """

    number: int
    width: int
    height: int
    mount_height_m: float
    pitch_down_deg: float
    fov_deg: float
    near_m: float
    far_m: float

    def __post_init__(self) -> None:
        check(1 <= self.number <= _MOST_CAMERAS, f"number must lie in [1, {_MOST_CAMERAS}], not {self.number}")
        for name in ("width", "height"):
            pixels = getattr(self, name)
            check(1 <= pixels <= 4096, f"{name} must lie in [1, 4096] pixels, not {pixels}")
        check(math.isfinite(self.mount_height_m), f"mount_height_m must be finite, not {self.mount_height_m}")
        check(-90 <= self.pitch_down_deg <= 90, f"pitch_down_deg must lie in [-90, 90], not {self.pitch_down_deg}")
        check(0 < self.fov_deg < 180, f"fov_deg must lie in (0, 180), not {self.fov_deg}")
        check(
            0 < self.near_m < self.far_m < math.inf,
            f"0 < near_m < far_m must hold, not near_m={self.near_m}, far_m={self.far_m}",
        )

    @property
    def pixels(self) -> int:
        """Return the pixels of all cameras together."""
        return self.number * self.height * self.width

    @property
    def reach_m(self) -> float:
        """Return the greatest distance between a camera and a point it sees: `far_m` in the corner of an image."""
        up = math.tan(math.radians(self.fov_deg) / 2)
        return self.far_m * math.sqrt(1.0 + up**2 * (1.0 + (self.width / self.height) ** 2))


class Panorama:
    """Places the cameras for a pose of the base. Robot frame: on the floor below the base, x forward, z up."""

    def __init__(self, config: CamerasConfig) -> None:
        """Compute what does not depend on the base's pose."""
        self.config = config
        size_and_lens = config.width, config.height, math.radians(config.fov_deg), config.near_m, config.far_m
        camera = Camera(np.zeros(3), np.eye(3), *size_and_lens)
        self._views = views_of([camera] * config.number)
        self._intrinsics = np.tile(camera.intrinsics, (config.number, 1, 1))
        self._robot_to_camera = _to_cameras(self.views(0.0, 0.0, 0.0))

    def views(self, base_x_m: float, base_y_m: float, base_yaw_rad: float) -> Views:
        """Return the cameras in the world as arrays, the forward camera first, counter-clockwise."""
        c = self.config
        pitch = math.radians(c.pitch_down_deg)
        sine, cosine = math.sin(pitch), math.cos(pitch)
        rotations = np.empty((c.number, 3, 3))
        for k in range(c.number):
            heading = base_yaw_rad + k * (2 * math.pi / c.number)
            x, y = math.cos(heading), math.sin(heading)
            # columns: right, up, backward
            rotations[k] = ((y, sine * x, -cosine * x), (-x, sine * y, -cosine * y), (0.0, cosine, sine))
        positions = np.empty((c.number, 3))
        positions[:] = (base_x_m, base_y_m, c.mount_height_m)
        return self._views._replace(positions=positions, rotations=rotations)

    def parameters(self, views: Views) -> dict[str, np.ndarray]:
        """Return what users need to re-project, for `info["cameras"]`; OpenCV: x right, y down, z forward.

        Args:
            views: from `views`.

        Returns:
            `intrinsics` (C, 3, 3) in pixels; `world_to_camera` and `robot_to_camera` (C, 4, 4), which take points
            of that frame to the camera's.
        """
        return {
            "intrinsics": self._intrinsics.copy(),
            "world_to_camera": _to_cameras(views),
            "robot_to_camera": self._robot_to_camera.copy(),
        }


def _to_cameras(views: Views) -> np.ndarray:
    """Return `Camera.extrinsics` of all cameras at once, (C, 4, 4), the same bits."""
    axes = views.rotations * _OPENCV_SIGNS
    x, y, z = (axes[:, k] * views.positions[:, k, None] for k in range(3))
    matrices = np.zeros((len(axes), 4, 4))
    matrices[:, :3, :3] = axes.transpose(0, 2, 1)
    matrices[:, :3, 3] = -(x + y + z)
    matrices[:, 3, 3] = 1.0
    return matrices
