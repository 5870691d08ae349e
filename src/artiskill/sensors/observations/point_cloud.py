"""Points and masks of pixels: all of them, or only chosen ones; the numbers are the same bits.

Masks say which pixels belong to which part, by tables over the visuals that are made once per episode's target.
"""

from typing import Any

import numpy as np

from artiskill.errors import ConfigError
from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.camera import Views
from artiskill.sensors.drawing.backdrop import FLOOR
from artiskill.sensors.drawing.buffers import ViewBuffers
from artiskill.sensors.drawing.simd import LANES, count_equal_simd, interleave_floats

# ids start at `FLOOR`: the rows of a table are floor, nothing, visual 0, visual 1, ...
FIRST_ID = FLOOR
MOST_MASKS = 7  # one bit of a byte each, the eighth says whether a point counts at all
COUNTS = np.uint8(128)
# Points up to this height are ground for down-sampling, as in the benchmark's baselines.
GROUND_HEIGHT_M = 1e-3


def mask_codes(masks: np.ndarray) -> np.ndarray:
    """Return a byte by visual id minus `FIRST_ID`: bit i stands for mask i. (k, G) bool -> (G + 2,) uint8.

    Floor and nothing belong to no mask.

    Raises:
        ConfigError: more masks than `MOST_MASKS`.
    """
    count, visuals = masks.shape
    if count > MOST_MASKS:
        raise ConfigError(f"at most {MOST_MASKS} masks, not {count}")
    codes = np.zeros(visuals - FIRST_ID, dtype=np.uint8)
    codes[-FIRST_ID:] = (masks * np.left_shift(1, np.arange(count))[:, None]).sum(axis=0)
    return codes


@kernel
def classify_view(
    camera: int, buffers: ViewBuffers, face_geom: Array, codes: Array, views: Views, line: Array, out: Array
) -> None:
    """Write a byte per pixel of one view, see `RasterBuffers.classify`; 0 to begin with.

    `line` (W,) float32 is overwritten.
    """
    ground = np.float32(GROUND_HEIGHT_M)
    triangle, inverse_depth, drawn, rights = buffers.triangle, buffers.inverse_depth, buffers.drawn, views.rights
    height, width = triangle.shape
    for row in range(height):
        column, end = drawn[row, 0], drawn[row, 1]
        ray, along, origin = row_ray(views, camera, row, 2)
        heights = line[column:end]
        unproject_drawn(inverse_depth[row, column:end], rights[camera, column:end], ray, along, origin, heights)
        while column < end:
            index = row * width + column
            t = triangle[row, column]
            count = min(count_equal_simd(triangle, index), end - column) if index + LANES <= triangle.size else 1
            if t >= 0:
                code = codes[face_geom[t] - FIRST_ID] | COUNTS
                for i in range(column, column + count):
                    if line[i] > ground:
                        out[row, i] = code
            column += count


@kernel
def classify_points(xyz: Array, seg: Array, out: Array) -> None:
    """Write the same bytes for clouds that exist already: (N, 3), (N, k) -> (N,) uint8."""
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
def masks_of_points(pixels: Array, classes: Array, seg: Array) -> None:
    """Write the masks of pixels (M,) from the bytes (P,) of all of them, see `classify_view`; seg (M, k) bool."""
    for i in range(pixels.shape[0]):
        for k in range(seg.shape[1]):
            seg[i, k] = (classes[pixels[i]] >> k) & 1


@kernel
def positions_of_pixels(pixels: Array, views: Views, inverse_depth: Array, xyz: Array) -> None:
    """Write world positions (M, 3) float32 of pixels that show faces, by their index in the full cloud."""
    rights = views.rights
    height, width = inverse_depth.shape[1], inverse_depth.shape[2]
    for i in range(pixels.shape[0]):
        image, column = pixels[i] // width, pixels[i] % width
        camera, row = image // height, image % height
        depth = np.float32(1.0) / inverse_depth[camera, row, column]
        for k in range(3):
            ray, along, origin = row_ray(views, camera, row, k)
            xyz[i, k] = unproject(depth, rights[camera, column], ray, along, origin)


@kernel
def unproject_rows(depth: Array, views: Views, camera: int, top: int, line: Array, xyz: Array) -> None:
    """Write all points of some rows of a camera: depths (R, W) from row `top` on, to (R, W, 3) float32 world.

    `line` (3, W) float32 is overwritten.
    """
    rows, width = depth.shape
    rights = views.rights[camera]
    for row in range(rows):
        for k in range(3):
            ray, along, origin = row_ray(views, camera, top + row, k)
            unproject_row(depth[row], rights, ray, along, origin, line[k])
        start, done = 3 * width * row, 0
        while done + LANES <= width:
            interleave_floats(xyz, start + 3 * done, line, done, width + done, 2 * width + done)
            done += LANES
        for column in range(done, width):
            for k in range(3):
                xyz[row, column, k] = line[k, column]


@kernel
def unproject_row(depth: Array, rights: Array, ray: Any, along: Any, origin: Any, out: Array) -> None:
    """Write one coordinate of all points of a row, (W,), 0 where nothing is; plain enough to be vectorised."""
    for column in range(depth.shape[0]):
        d = depth[column]
        from_origin = origin if d > 0.0 else np.float32(0.0)
        out[column] = unproject(d, rights[column], ray, along, from_origin)


@kernel
def unproject_drawn(inverse_depth: Array, rights: Array, ray: Any, along: Any, origin: Any, out: Array) -> None:
    """Write one world coordinate of pixels of a row that see something, all (N,)."""
    for i in range(out.shape[0]):
        out[i] = unproject(np.float32(1.0) / inverse_depth[i], rights[i], ray, along, origin)


@kernel
def row_ray(views: Views, camera: int, row: int, k: int) -> tuple[Any, Any, Any]:
    """Return coordinate k of what a row's pixels share: direction of its middle ray, of the row, the origin."""
    r = views.rotations
    ray = r[camera, k, 1] * views.ups[camera, row] - r[camera, k, 2]
    return np.float32(ray), np.float32(r[camera, k, 0]), np.float32(views.positions[camera, k])


@kernel
def unproject(depth: Any, right: Any, ray: Any, along_row: Any, origin: Any) -> Any:
    """Return one world coordinate of what a pixel sees; all float32, the last three from `row_ray`."""
    return depth * (ray + right * along_row) + origin


@kernel
def move_to_frame(xyz: Array, origin: Array, rotation: Array) -> None:
    """Move world points to a frame, in place: (M, 3), the frame's origin (3,) and axes as columns (3, 3)."""
    for i in range(xyz.shape[0]):
        x, y, z = xyz[i, 0] - origin[0], xyz[i, 1] - origin[1], xyz[i, 2] - origin[2]
        for k in range(3):
            xyz[i, k] = np.float32(rotation[0, k] * x + rotation[1, k] * y + rotation[2, k] * z)
