"""Kernels from the two buffers of a view to depth, world positions and ids."""

from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.lighting import View
from artiskill.sensors.rasterise import NOTHING
from artiskill.sensors.scene_tables import SceneTables

Single = tuple[np.float32, np.float32, np.float32]


class Channels(NamedTuple):
    """Images of K views; one that was not asked for has no elements.

    `rgb` (K, H, W, 3) uint8, `depth` (K, H, W) float32, `position_w` (K, H, W, 3) float32, `geom`, `body` and
    `part` (K, H, W) int32.
    """

    rgb: Array
    depth: Array
    position_w: Array
    geom: Array
    body: Array
    part: Array


@kernel
def resolve_geometry(k: int, scene: SceneTables, view: View, depth: Array, triangle: Array, out: Channels) -> None:
    """Write positions and ids of view k, those that were asked for."""
    if out.position_w.size > 0:
        resolve_position(depth, triangle, view, out.position_w[k])
    if out.geom.size > 0:
        resolve_geom(triangle, scene.face_geom, out.geom[k])
    if out.body.size > 0:
        resolve_ids(triangle, scene.face_geom, scene.geom_body_id, out.body[k])
    if out.part.size > 0:
        resolve_ids(triangle, scene.face_geom, scene.geom_part, out.part[k])


@kernel
def resolve_depth(inverse_depth: Array, triangle: Array, depth: Array) -> None:
    """Depth along the optical axis in metres, 0 where nothing is."""
    for row in range(depth.shape[0]):
        for column in range(depth.shape[1]):
            z = np.float32(1.0) / inverse_depth[row, column]
            depth[row, column] = z if triangle[row, column] != NOTHING else np.float32(0.0)


@kernel
def resolve_position(depth: Array, triangle: Array, view: View, position_w: Array) -> None:
    """World position of what each pixel sees, metres, 0 where nothing is; double precision once per row."""
    r, per_px = view.rotation, 1.0 / view.lens[0]
    eye = (np.float32(view.position[0]), np.float32(view.position[1]), np.float32(view.position[2]))
    step = (np.float32(r[0, 0] * per_px), np.float32(r[1, 0] * per_px), np.float32(r[2, 0] * per_px))
    right = (0.5 - view.lens[1]) * per_px
    for row in range(triangle.shape[0]):
        up = (view.lens[2] - 0.5 - row) * per_px
        ray = (
            np.float32(r[0, 0] * right + r[0, 1] * up - r[0, 2]),
            np.float32(r[1, 0] * right + r[1, 1] * up - r[1, 2]),
            np.float32(r[2, 0] * right + r[2, 1] * up - r[2, 2]),
        )
        row_of_positions(depth[row], triangle[row], eye, ray, step, position_w[row].reshape(-1))


@kernel
def row_of_positions(
    depth: Array, triangle: Array, eye: Single, ray: Single, step: Single, position_w: Array
) -> None:
    """Positions (3 W,) of a row: a flat loop, which the compiler turns into vector instructions.

    `eye` is where all rays begin, `ray` the direction of column 0 of length 1 along the optical axis, `step` what
    one column adds to it.
    """
    for column in range(triangle.shape[0]):
        seen = np.float32(1.0) if triangle[column] != NOTHING else np.float32(0.0)
        z, x = depth[column], np.float32(column)
        position_w[3 * column] = z * (ray[0] + x * step[0]) + seen * eye[0]
        position_w[3 * column + 1] = z * (ray[1] + x * step[1]) + seen * eye[1]
        position_w[3 * column + 2] = z * (ray[2] + x * step[2]) + seen * eye[2]


@kernel
def resolve_geom(triangle: Array, face_geom: Array, ids: Array) -> None:
    """The visual each pixel shows; `NOTHING` and `FLOOR` stand for themselves."""
    for row in range(triangle.shape[0]):
        for column in range(triangle.shape[1]):
            t = triangle[row, column]
            ids[row, column] = face_geom[t] if t >= 0 else t


@kernel
def resolve_ids(triangle: Array, face_geom: Array, table: Array, ids: Array) -> None:
    """An id per pixel from a table with one entry per visual; `NOTHING` and `FLOOR` stand for themselves."""
    for row in range(triangle.shape[0]):
        for column in range(triangle.shape[1]):
            t = triangle[row, column]
            ids[row, column] = table[face_geom[t]] if t >= 0 else t
