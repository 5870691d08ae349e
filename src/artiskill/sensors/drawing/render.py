"""Kernels that draw whole views without the interpreter, and their inputs."""

from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, kernel, structure_kernel
from artiskill.sensors.camera import View, Views, view_at
from artiskill.sensors.drawing.backdrop import Channels, fill_rest, resolve_depth, resolve_geometry
from artiskill.sensors.drawing.buffers import BAND_ROWS, Scratch, buffers_at
from artiskill.sensors.drawing.fast_shading import (
    forget_faces,
    list_runs,
    paint_rows,
    paint_textures,
    set_up_faces,
)
from artiskill.sensors.drawing.rasterise import draw_view
from artiskill.sensors.drawing.scene_tables import Poses, SceneTables
from artiskill.sensors.drawing.shading import Lights, light_floor
from artiskill.sensors.drawing.simd import copy


class RenderInputs(NamedTuple):
    """What is drawn of B environments with C views each.

    Attributes:
        scene: surfaces.
        poses: (B, ...) of the bodies.
        views: B * C cameras, those of one environment after those of another.
        light: lights and the display table.
        picture: (B * C, H, W, 3) uint8 colours that are drawn already, or no elements.
    """

    scene: SceneTables
    poses: Poses
    views: Views
    light: Lights
    picture: Array


@kernel
def render_views(
    first: int, last: int, cameras: int, inputs: RenderInputs, scratch: Scratch, out: Channels
) -> None:
    """Draw views first .. last - 1.

    Args:
        first: a view.
        last: one past the last view.
        cameras: views per environment.
        inputs: what is drawn.
        scratch: of this thread, for one view.
        out: the channels to write.
    """
    scene, light, buffers = inputs.scene, inputs.light, buffers_at(scratch.views, 0)
    for k in range(first, last):
        view, pose = view_at(inputs.views, k), pose_at(inputs.poses, k // cameras)
        draw_view(scene, pose, view, light.has_floor, buffers, scratch)
        if out.rgb.size > 0:
            list_runs(buffers)
            set_up_faces(scene, pose.rotations, view, light, buffers, scratch.lit)
            for top in range(0, out.rgb.shape[1], BAND_ROWS):
                rows = min(BAND_ROWS, out.rgb.shape[1] - top)
                colour_rows(0, top, rows, scene, view, light, inputs.picture, scratch)
                copy(scratch.rgb[0, : rows * out.rgb.shape[2]].reshape(-1), out.rgb[k, top:].reshape(-1))
            forget_faces(buffers)
        resolve_geometry(k, scene, view, buffers, out)


@structure_kernel
def pose_at(poses: Poses, env: int) -> Poses:
    """Return the poses of one environment."""
    return Poses(poses.positions[env], poses.rotations[env])


@kernel
def colour_rows(
    slot: int, top: int, rows: int, scene: SceneTables, view: View, light: Lights, picture: Array, scratch: Scratch
) -> None:
    """Write depths and colours of some rows of a view whose faces are set up, unless there is a picture.

    Args:
        slot: number of the view in the scratch, whose `depth` and `rgb` are written, and in the picture.
        top: the first row.
        rows: how many.
        scene: see `RenderInputs`, as the next three.
        view: one of them.
        light: .
        picture: .
        scratch: of this thread.
    """
    buffers, depth, rgb = buffers_at(scratch.views, slot), scratch.depth[slot], scratch.rgb[slot]
    width = buffers.triangle.shape[1]
    resolve_depth(top, buffers, depth[: rows * width].reshape(rows, width))
    if picture.size > 0:
        copy(picture[slot, top : top + rows].reshape(-1), rgb.reshape(-1))
        return
    left = paint_rows(top, rows, view.lens, light.plain, buffers, scratch.textured, depth, rgb)
    if left > 0:
        paint_textures(top, view.lens, scene, buffers, scratch.textured[:left], depth, rgb)
    if light.lamps.shape[0] > 0:
        fill_rest(buffers)
        shown = buffers.triangle[top : top + rows]
        light_floor(top, view, light, shown, rgb[: rows * width].reshape(rows, width, 3))


@kernel
def pose_matrices(body_positions: Array, body_quaternions: Array, poses: Poses) -> int:
    """Write positions (B, N, 3) and quaternions (B, N, 4) as `Poses`, (B, N + 1, ...); body 0 is the world.

    Returns:
        The first pose that is not finite, as env * N + body, or -1.
    """
    positions, rotations = poses.positions, poses.rotations
    count = body_positions.shape[1]
    bad = -1
    for env in range(body_positions.shape[0]):
        for k in range(3):
            positions[env, 0, k] = 0.0
            for j in range(3):
                rotations[env, 0, k, j] = 1.0 if k == j else 0.0
        for body in range(count):
            q = body_quaternions[env, body]
            w, x, y, z = q[0], q[1], q[2], q[3]
            total = w + x + y + z
            for k in range(3):
                positions[env, body + 1, k] = body_positions[env, body, k]
                total += body_positions[env, body, k]
            if bad < 0 and not np.isfinite(total):
                bad = env * count + body
            r = rotations[env, body + 1]
            r[0, 0], r[0, 1], r[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
            r[1, 0], r[1, 1], r[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
            r[2, 0], r[2, 1], r[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return bad
