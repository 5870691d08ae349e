"""`CameraBatch`: cameras of one lens in many environments, as arrays."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from artiskill.config import check
from artiskill.errors import ConfigError
from artiskill.sensors.camera import Camera
from artiskill.sensors.render_views import Views

_ROTATION_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class CameraBatch:
    """C cameras in each of B environments, all with the lens of one `Camera`: cheaper to make than B * C of them.

    Attributes:
        positions_w: (B, C, 3) optical centres, metres.
        rotations_w: (B, C, 3, 3) columns are right, up and backward, as in `Camera`.
        width: pixels.
        height: pixels.
        fov_rad: vertical field of view, radians.
        near_m: what is closer along the optical axis is not seen.
        far_m: what is farther is not seen.

    Raises:
        ConfigError: shapes that do not fit, a pose that is not finite or no rotation, an illegal lens.
    """

    positions_w: np.ndarray
    rotations_w: np.ndarray
    width: int
    height: int
    fov_rad: float = math.radians(60)
    near_m: float = 0.1
    far_m: float = 10.0

    def __post_init__(self) -> None:
        positions = np.ascontiguousarray(self.positions_w, dtype=np.float64)
        rotations = np.ascontiguousarray(self.rotations_w, dtype=np.float64)
        object.__setattr__(self, "positions_w", positions)
        object.__setattr__(self, "rotations_w", rotations)
        shapes = f"{positions.shape} and {rotations.shape}"
        fits = positions.ndim == 3 and positions.shape[2] == 3 and rotations.shape == (*positions.shape, 3)
        check(fits, f"camera poses must have shapes (B, C, 3) and (B, C, 3, 3), not {shapes}")
        check(bool(np.isfinite(positions).all()), "camera positions must be finite")
        flat = rotations.reshape(-1, 3, 3)
        products = (flat[:, :, :, None] * flat[:, :, None, :]).sum(axis=1)
        upright = (np.cross(flat[:, :, 0], flat[:, :, 1]) * flat[:, :, 2]).sum(axis=1) > 0
        # written so that NaN fails too
        legal = bool((np.abs(products - np.eye(3)) < _ROTATION_TOLERANCE).all() and upright.all())
        check(legal, "camera rotations must be rotation matrices")
        self.lens_camera  # noqa: B018 - a camera checks its lens

    @property
    def lens_camera(self) -> Camera:
        """A camera at the origin with this lens."""
        return Camera(np.zeros(3), np.eye(3), self.width, self.height, self.fov_rad, self.near_m, self.far_m)

    @property
    def views(self) -> Views:
        """All cameras, environment by environment."""
        count = self.positions_w.shape[0] * self.positions_w.shape[1]
        lenses = np.tile(self.lens_camera.lens(), (count, 1))
        return Views(self.positions_w.reshape(-1, 3), self.rotations_w.reshape(-1, 3, 3), lenses)


def views_of(cameras: Sequence[Camera]) -> Views:
    """Single cameras as arrays."""
    return Views(
        np.array([camera.position_w for camera in cameras]),
        np.array([camera.rotation_w for camera in cameras]),
        np.array([camera.lens() for camera in cameras]),
    )


def common_resolution(cameras: Sequence[Camera]) -> tuple[int, int]:
    """Height and width of all cameras.

    Raises:
        ConfigError: no camera, or different resolutions.
    """
    resolutions = {(camera.height, camera.width) for camera in cameras}
    if len(resolutions) != 1:
        sizes = ", ".join(f"{w} x {h}" for h, w in sorted(resolutions)) or "no camera"
        raise ConfigError(f"render needs cameras of one resolution, not {sizes}")
    return resolutions.pop()
