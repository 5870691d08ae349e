"""Kernels from the two buffers to depth, world positions and ids."""

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.rasterise import NOTHING


@kernel
def resolve_depth(inverse_depth: Array, triangle: Array, depth: Array) -> None:
    """Depth along the optical axis in metres, 0 where nothing is."""
    for row in range(depth.shape[0]):
        for column in range(depth.shape[1]):
            z = np.float32(1.0) / inverse_depth[row, column]
            depth[row, column] = z if triangle[row, column] != NOTHING else np.float32(0.0)


@kernel
def resolve_position(
    inverse_depth: Array, triangle: Array, position: Array, rotation: Array, lens: Array, position_w: Array
) -> None:
    """World position of what each pixel sees, metres, 0 where nothing is."""
    per_px = 1.0 / lens[0]
    for row in range(triangle.shape[0]):
        up = (lens[2] - 0.5 - row) * per_px
        # the ray through column 0, and what one column adds
        ray_x = rotation[0, 1] * up - rotation[0, 2] + rotation[0, 0] * (0.5 - lens[1]) * per_px
        ray_y = rotation[1, 1] * up - rotation[1, 2] + rotation[1, 0] * (0.5 - lens[1]) * per_px
        ray_z = rotation[2, 1] * up - rotation[2, 2] + rotation[2, 0] * (0.5 - lens[1]) * per_px
        step_x, step_y, step_z = rotation[0, 0] * per_px, rotation[1, 0] * per_px, rotation[2, 0] * per_px
        for column in range(triangle.shape[1]):
            seen = 1.0 if triangle[row, column] != NOTHING else 0.0
            z = seen / np.float64(inverse_depth[row, column])
            position_w[row, column, 0] = np.float32(z * (ray_x + column * step_x) + seen * position[0])
            position_w[row, column, 1] = np.float32(z * (ray_y + column * step_y) + seen * position[1])
            position_w[row, column, 2] = np.float32(z * (ray_z + column * step_z) + seen * position[2])


@kernel
def resolve_ids(triangle: Array, table: Array, ids: Array) -> None:
    """An id per pixel from a table with one entry per face; `NOTHING` and `FLOOR` stand for themselves."""
    for row in range(triangle.shape[0]):
        for column in range(triangle.shape[1]):
            t = triangle[row, column]
            ids[row, column] = table[t] if t >= 0 else t
