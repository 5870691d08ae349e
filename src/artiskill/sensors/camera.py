"""Pinhole cameras: pose, lens and the matrices that users need to re-project."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from artiskill.config import check
from artiskill.errors import ConfigError, shown
from artiskill.geometry.kernel import Array, structure_kernel

# sides below this (relative to unit vectors) count as parallel: the view direction and `up` then fix no roll
_PARALLEL = 1e-6
_FARTHEST_M = 1e9  # between a camera and what it looks at: squares stay finite
MOST_PIXELS = 4096**2  # of a picture: drawing takes some 100 bytes for each, antialiasing more


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera with square pixels and its principal point in the middle of the image.

    The camera frame is the one of OpenGL and MuJoCo: x to the right, y up, z backwards; it looks along -z. Pixel
    (row r, column c) has its centre at (c + 0.5, r + 0.5); row 0 is the top.

    Attributes:
        position_w: (3,) optical centre, metres.
        rotation_w: (3, 3) columns are the camera's right, up and backward directions.
        width: pixels.
        height: pixels.
        fov_rad: vertical field of view, radians, in (0, pi).
        near_m: what is closer along the optical axis is not seen.
        far_m: what is farther along the optical axis is not seen.

    Raises:
        ConfigError: a value out of range, not finite, or a matrix that is no rotation.
    """

    position_w: np.ndarray
    rotation_w: np.ndarray
    width: int
    height: int
    fov_rad: float = math.radians(60)
    near_m: float = 0.1
    far_m: float = 10.0

    def __post_init__(self) -> None:
        position = np.ascontiguousarray(self.position_w, dtype=np.float64)
        rotation = np.ascontiguousarray(self.rotation_w, dtype=np.float64)
        object.__setattr__(self, "position_w", position)
        object.__setattr__(self, "rotation_w", rotation)
        check(position.shape == (3,), f"camera position must have shape (3,), not {position.shape}")
        check(bool(np.isfinite(position).all()), f"camera position must be finite, not {position.tolist()}")
        check(rotation.shape == (3, 3), f"camera rotation must have shape (3, 3), not {rotation.shape}")
        check(_is_rotation(rotation), f"camera rotation must be a rotation matrix, not {rotation.tolist()}")
        for side, pixels in (("width", self.width), ("height", self.height)):
            legal = isinstance(pixels, int | np.integer) and not isinstance(pixels, bool) and pixels >= 1
            check(legal, f"camera {side} must be a whole number of pixels, at least 1, not {shown(pixels)}")
        pixels = int(self.width) * int(self.height)
        check(pixels <= MOST_PIXELS, f"a picture has at most {MOST_PIXELS} pixels, not {shown(pixels)}")
        check(0 < self.fov_rad < math.pi, f"camera fov_rad must lie in (0, pi), not {shown(self.fov_rad)}")
        check(
            0 < self.near_m < self.far_m < math.inf,
            f"camera must have 0 < near_m < far_m, not near_m={self.near_m!r}, far_m={self.far_m!r}",
        )

    @classmethod
    def look_at(cls, eye: Any, target: Any, up: Any = (0.0, 0.0, 1.0), **lens: Any) -> "Camera":
        """Return a camera at `eye` whose optical axis passes through `target`.

        Args:
            eye: (3,) optical centre, world, metres.
            target: (3,) a point in the middle of the image.
            up: (3,) what points up in the image; where it is parallel to the view, +x takes its place (+z, should
                the view go along x).
            **lens: `width`, `height` and the further fields of `Camera`.

        Raises:
            ConfigError: eye and target coincide, or a value is illegal.
        """
        eye, target = np.asarray(eye, dtype=np.float64), np.asarray(target, dtype=np.float64)
        backward = eye - target
        check(
            backward.shape == (3,) and bool((backward != 0).any()),
            f"look_at needs two different points, not {eye.tolist()} and {target.tolist()}",
        )
        check(
            bool((np.abs(backward) <= _FARTHEST_M).all()),
            f"look_at needs two points at most {_FARTHEST_M:g} m apart, not {eye.tolist()} and {target.tolist()}",
        )
        backward = backward / _length(backward)
        for direction in (np.asarray(up, dtype=np.float64), np.eye(3)[0], np.eye(3)[2]):
            right = np.cross(direction, backward)
            if _length(right) > _PARALLEL * _length(direction):
                break
        right = right / _length(right)
        return cls(eye, np.stack((right, np.cross(backward, right), backward), axis=1), **lens)

    @property
    def focal_px(self) -> float:
        """Return the focal length in pixels, the same in both directions."""
        return 0.5 * self.height / math.tan(0.5 * self.fov_rad)

    @property
    def intrinsics(self) -> np.ndarray:
        """Return the (3, 3) matrix K of OpenCV: pixel = K X / X_z for X with x right, y down, z forward."""
        f = self.focal_px
        return np.array([[f, 0.0, self.width / 2], [0.0, f, self.height / 2], [0.0, 0.0, 1.0]])

    @property
    def extrinsics(self) -> np.ndarray:
        """Return (4, 4) world to OpenCV camera frame (x right, y down, z forward): what `intrinsics` expects."""
        rotation = (self.rotation_w * np.array([1.0, -1.0, -1.0])).T
        matrix = np.eye(4)
        matrix[:3, :3] = rotation
        matrix[:3, 3] = -(rotation * self.position_w).sum(axis=1)
        return matrix

    @property
    def lens(self) -> np.ndarray:
        """Return (5,) what the kernels read: focal length, centre x, centre y (pixels), near, far (metres)."""
        return np.array([self.focal_px, self.width / 2, self.height / 2, self.near_m, self.far_m])


def _length(v: np.ndarray) -> float:
    # written out: BLAS norms may differ in the last bit between machines
    return math.sqrt(float(v[0]) ** 2 + float(v[1]) ** 2 + float(v[2]) ** 2)


def _is_rotation(matrix: np.ndarray) -> bool:
    if not np.isfinite(matrix).all():
        return False
    orthonormal = np.abs(matrix.T @ matrix - np.eye(3)).max() < 1e-6
    return bool(orthonormal and np.linalg.det(matrix) > 0)


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
        """Return a camera at the origin with this lens."""
        return Camera(np.zeros(3), np.eye(3), self.width, self.height, self.fov_rad, self.near_m, self.far_m)

    @property
    def views(self) -> "Views":
        """Return all cameras, environment by environment."""
        count = self.positions_w.shape[0] * self.positions_w.shape[1]
        _, _, *rest = views_of([self.lens_camera])
        repeated = (np.repeat(part, count, axis=0) for part in rest)
        return Views(self.positions_w.reshape(-1, 3), self.rotations_w.reshape(-1, 3, 3), *repeated)


class Views(NamedTuple):
    """K cameras of one resolution as arrays, for the kernels.

    Attributes:
        positions: (K, 3) float64 optical centres, world.
        rotations: (K, 3, 3) float64, columns are right, up and backward.
        lenses: (K, 5) float64 as from `Camera.lens`.
        ups: (K, H) float64 how far above the optical axis each row lies, at depth 1.
        rights: (K, W) float32 how far to the right of it each column lies, at depth 1.
    """

    positions: Array
    rotations: Array
    lenses: Array
    ups: Array
    rights: Array


class View(NamedTuple):
    """One camera of `Views`: position (3,), rotation (3, 3), lens (5,)."""

    position: Array
    rotation: Array
    lens: Array


@structure_kernel
def view_at(views: Views, k: int) -> View:
    """Return camera k."""
    return View(views.positions[k], views.rotations[k], views.lenses[k])


def views_of(cameras: Sequence[Camera]) -> Views:
    """Return cameras as arrays.

    Raises:
        ConfigError: no camera, or different resolutions.
    """
    resolutions = {(camera.height, camera.width) for camera in cameras}
    if len(resolutions) != 1:
        sizes = ", ".join(f"{w} x {h}" for h, w in sorted(resolutions)) or "no camera"
        raise ConfigError(f"render needs cameras of one resolution, not {sizes}")
    height, width = resolutions.pop()
    lenses = np.array([camera.lens for camera in cameras])
    focal, centre_x, centre_y = lenses[:, :3, None].swapaxes(0, 1)
    return Views(
        np.array([camera.position_w for camera in cameras]),
        np.array([camera.rotation_w for camera in cameras]),
        lenses,
        (centre_y - 0.5 - np.arange(height)) / focal,
        ((np.arange(width) + 0.5 - centre_x) / focal).astype(np.float32),
    )
