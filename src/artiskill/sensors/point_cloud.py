"""Point clouds from depth and id images: all points, or only chosen ones; the numbers are the same bits."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.camera import Camera
from artiskill.sensors.lanes import LANES, weave_lanes
from artiskill.sensors.segmentation import COUNTS, FIRST_ID, write_masks

# Points up to this height are ground for down-sampling, as in the benchmark's baselines.
GROUND_HEIGHT_M = 1e-3


class Rays(NamedTuple):
    """What takes pixels to points.

    Attributes:
        position: (C, 3) float64 optical centres, world.
        rotation: (C, 3, 3) float64, columns are the cameras' right, up and backward directions.
        ups: (H,) float64 how far above the optical axis each row lies, at depth 1.
        rights: (W,) float32 how far to the right of it each column lies, at depth 1.
    """

    position: Array
    rotation: Array
    ups: Array
    rights: Array


def rays_of(cameras: Sequence[Camera]) -> Rays:
    """The rays of cameras that share a lens."""
    focal, centre_x, centre_y = cameras[0].lens()[:3].tolist()
    return Rays(
        np.stack([camera.position_w for camera in cameras]),
        np.stack([camera.rotation_w for camera in cameras]),
        (centre_y - 0.5 - np.arange(cameras[0].height)) / focal,
        ((np.arange(cameras[0].width) + 0.5 - centre_x) / focal).astype(np.float32),
    )


@kernel
def row_ray(rays: Rays, camera: int, row: int, k: int) -> tuple[Any, Any, Any]:
    """What a row's pixels share, coordinate k: direction of its middle ray, of the row itself, and the origin."""
    r = rays.rotation
    ray = r[camera, k, 1] * rays.ups[row] - r[camera, k, 2]
    return np.float32(ray), np.float32(r[camera, k, 0]), np.float32(rays.position[camera, k])


@kernel
def unproject(depth: Any, right: Any, ray: Any, along_row: Any, origin: Any) -> Any:
    """One world coordinate of what a pixel sees; all float32, `right` of `Rays`, the last three of `row_ray`."""
    return depth * (ray + right * along_row) + origin


@kernel
def unproject_row(depth: Array, rights: Array, ray: Any, along: Any, origin: Any, out: Array) -> None:
    """One coordinate of all points of a row, (W,), 0 where nothing is seen; plain enough to be vectorised."""
    for column in range(depth.shape[0]):
        d = depth[column]
        from_origin = origin if d > 0.0 else np.float32(0.0)
        out[column] = unproject(d, rights[column], ray, along, from_origin)


@kernel
def unproject_rows(depth: Array, rays: Rays, camera: int, top: int, xyz: Array) -> None:
    """All points of some rows of a camera: depths (R, W) from row `top` on, to (R, W, 3) float32 world."""
    rows, width = depth.shape
    rights = rays.rights
    line = np.empty((3, width), dtype=np.float32)
    for row in range(rows):
        for k in range(3):
            ray, along, origin = row_ray(rays, camera, top + row, k)
            unproject_row(depth[row], rights, ray, along, origin, line[k])
        start, done = 3 * width * row, 0
        while done + LANES <= width:
            weave_lanes(xyz, start + 3 * done, line, done, width + done, 2 * width + done)
            done += LANES
        for column in range(done, width):
            for k in range(3):
                xyz[row, column, k] = line[k, column]


@kernel
def write_cloud(depth: Array, geom: Array, codes: Array, rays: Rays, xyz: Array, seg: Array) -> None:
    """All points and their masks.

    Args:
        depth: (C, H, W) float32 metres.
        geom: (C, H, W) int32 visual ids.
        codes: (G + 2,) uint8, see `mask_codes`.
        rays: of the cameras.
        xyz: (C, H, W, 3) float32 world, written; the world's origin where nothing is seen.
        seg: (C, H, W, k) bool, False to begin with; written where a point lies in a mask.
    """
    for camera in range(depth.shape[0]):
        unproject_rows(depth[camera], rays, camera, 0, xyz[camera])
    write_masks(geom.reshape(-1), codes, seg.reshape(-1, seg.shape[3]))


@kernel
def classify_pixels(depth: Array, geom: Array, codes: Array, rays: Rays, out: Array) -> None:
    """A byte per pixel: its masks' bits, and `COUNTS` where it sees something above the ground.

    Args:
        depth: (C, H, W) float32 metres.
        geom: (C, H, W) int32 visual ids.
        codes: (G + 2,) uint8, see `mask_codes`.
        rays: of the cameras.
        out: (C, H, W) uint8, written; 0 for ground and nothing.
    """
    ground = np.float32(GROUND_HEIGHT_M)
    cameras, height, width = depth.shape
    line = np.empty(width, dtype=np.float32)
    for camera in range(cameras):
        for row in range(height):
            ray, along, origin = row_ray(rays, camera, row, 2)
            unproject_row(depth[camera, row], rays.rights, ray, along, origin, line)
            for column in range(width):
                visual = geom[camera, row, column]
                code = np.uint8(0)
                if visual >= 0 and line[column] > ground:
                    code = codes[visual - FIRST_ID] | COUNTS
                out[camera, row, column] = code


@kernel
def points_of_pixels(depth: Array, chosen: Array, rays: Rays, xyz: Array) -> None:
    """World positions of pixels that see something, by their index in the full cloud. (M,) -> (M, 3) float32."""
    height, width = depth.shape[1], depth.shape[2]
    for i in range(chosen.shape[0]):
        image, column = chosen[i] // width, chosen[i] % width
        camera, row = image // height, image % height
        d, right = depth[camera, row, column], rays.rights[column]
        for k in range(3):
            ray, along, origin = row_ray(rays, camera, row, k)
            xyz[i, k] = unproject(d, right, ray, along, origin)


@kernel
def classify_points(xyz: Array, seg: Array, out: Array) -> None:
    """`classify_pixels` for clouds that exist already: (N, 3), (N, k) -> (N,) uint8."""
    ground = np.float32(GROUND_HEIGHT_M)
    for i in range(xyz.shape[0]):
        code = np.uint8(0)
        if xyz[i, 2] > ground:
            code = COUNTS
            for k in range(seg.shape[1]):
                if seg[i, k]:
                    code |= np.uint8(1 << k)
        out[i] = code


@kernel
def move_to_frame(xyz: Array, origin: Array, rotation: Array) -> None:
    """World points to a frame, in place: (M, 3), the frame's origin (3,) and axes as columns (3, 3)."""
    for i in range(xyz.shape[0]):
        x, y, z = xyz[i, 0] - origin[0], xyz[i, 1] - origin[1], xyz[i, 2] - origin[2]
        for k in range(3):
            xyz[i, k] = np.float32(rotation[0, k] * x + rotation[1, k] * y + rotation[2, k] * z)
