"""Kernels that draw views without the interpreter, and their inputs."""

from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.camera import View, Views
from artiskill.sensors.drawing.backdrop import (
    Backdrop,
    Channels,
    fill_rest,
    find_backdrop,
    resolve_depth,
    resolve_ids,
    resolve_position,
)
from artiskill.sensors.drawing.buffers import BAND_ROWS, Drawing, Scratch, drawing_of
from artiskill.sensors.drawing.fast_shading import UNSEEN, list_runs, paint_rows, paint_textures, set_up_faces
from artiskill.sensors.drawing.rasterise import draw_geoms
from artiskill.sensors.drawing.scene_tables import SceneTables
from artiskill.sensors.drawing.shading import Lights, light_floor
from artiskill.sensors.drawing.simd import copy, fill


class Poses(NamedTuple):
    """The world, index 0, and N bodies: `positions` (B, N + 1, 3), `rotations` (B, N + 1, 3, 3)."""

    positions: Array
    rotations: Array


@kernel
def render_views(
    first: int,
    last: int,
    cameras: int,
    scene: SceneTables,
    poses: Poses,
    views: Views,
    light: Lights,
    plain: Array,
    has_floor: bool,
    scratch: Scratch,
    out: Channels,
) -> None:
    """Draw views first .. last - 1 of all views, those of one environment after those of another.

    Args:
        first: a view.
        last: one past the last view.
        cameras: views per environment.
        scene: what is drawn.
        poses: of all environments.
        views: the cameras.
        light: lights and the display table.
        plain: (2, 3) uint8 colours of background and floor.
        has_floor: whether the ground is drawn.
        scratch: of this thread, for one view.
        out: the channels to write, K images each or none.
    """
    drawing = drawing_of(scratch.drawings, 0)
    for k in range(first, last):
        view = View(views.positions[k], views.rotations[k], views.lenses[k])
        positions, rotations = poses.positions[k // cameras], poses.rotations[k // cameras]
        backdrop = draw_view(scene, positions, rotations, view, has_floor, drawing, scratch)
        if out.rgb.size > 0:
            count = list_runs(
                drawing.triangle,
                drawing.drawn,
                drawing.face_state,
                drawing.seen,
                drawing.runs,
                drawing.row_runs,
            )
            set_up_faces(count, scene, rotations, view, light, drawing, scratch.lit)
            band, depth = scratch.rgb[0], scratch.depth[0]
            for top in range(0, out.rgb.shape[1], BAND_ROWS):
                rows = min(BAND_ROWS, out.rgb.shape[1] - top)
                colour_rows(top, rows, scene, view, light, plain, backdrop, drawing, scratch.textured, depth, band)
                copy(band[: rows * out.rgb.shape[2]].reshape(-1), out.rgb[k, top:].reshape(-1))
            forget_faces(count, drawing)
        resolve_geometry(k, scene, view, backdrop, drawing, out)


@kernel
def draw_view(
    scene: SceneTables,
    positions: Array,
    rotations: Array,
    view: View,
    has_floor: bool,
    drawing: Drawing,
    scratch: Scratch,
) -> Backdrop:
    """Draw all visuals into the buffers of a view, which hold values only where something may be drawn."""
    backdrop = find_backdrop(view, has_floor, drawing.triangle.shape[1], drawing.floor)
    fill(drawing.drawn.reshape(-1), 0)
    draw_geoms(
        scene,
        positions,
        rotations,
        view,
        backdrop,
        drawing.camera,
        scratch.projected,
        scratch.candidates,
        drawing.inverse_depth,
        drawing.triangle,
        drawing.drawn,
    )
    return backdrop


@kernel
def colour_rows(
    top: int,
    rows: int,
    scene: SceneTables,
    view: View,
    light: Lights,
    plain: Array,
    backdrop: Backdrop,
    drawing: Drawing,
    textured: Array,
    depth: Array,
    rgb: Array,
) -> None:
    """Depths and colours of some rows of a view whose faces are set up.

    Args:
        top: the first row.
        rows: how many.
        scene: what is drawn.
        view: the camera.
        light: lights and the display table.
        plain: (2, 3) uint8 colours of background and floor.
        backdrop: of the view.
        drawing: of the view.
        textured: see `Scratch`, as the next two.
        depth: (BAND_ROWS * W + LANES,) written.
        rgb: (BAND_ROWS * W + LANES, 3) written.
    """
    triangle, state, planes = drawing.triangle, drawing.face_state, drawing.face_planes
    width = triangle.shape[1]
    resolve_depth(
        top, backdrop, drawing.drawn, drawing.inverse_depth, triangle, depth[: rows * width].reshape(rows, width)
    )
    left = paint_rows(
        top,
        rows,
        view.lens,
        plain,
        backdrop.floor,
        drawing.runs,
        drawing.row_runs,
        depth,
        triangle,
        state,
        planes,
        textured,
        rgb,
    )
    if left > 0:
        looks = scene.face_geom, scene.textures, scene.texels
        paint_textures(top, view.lens, drawing.runs, textured[:left], depth, triangle, state, planes, *looks, rgb)
    if light.lamps.shape[0] > 0:
        fill_rest(backdrop, drawing.inverse_depth, triangle, drawing.drawn)
        light_floor(top, view, light, triangle[top : top + rows], rgb[: rows * width].reshape(rows, width, 3))


@kernel
def forget_faces(count: int, drawing: Drawing) -> None:
    """Make the first `count` seen faces `UNSEEN` again."""
    state, seen = drawing.face_state, drawing.seen
    for i in range(count):
        state[seen[i]] = UNSEEN


@kernel
def resolve_geometry(
    k: int, scene: SceneTables, view: View, backdrop: Backdrop, drawing: Drawing, out: Channels
) -> None:
    """Write depth, positions and ids of view k, those that were asked for."""
    inverse_depth, triangle, drawn = drawing.inverse_depth, drawing.triangle, drawing.drawn
    if out.depth.size > 0:
        resolve_depth(0, backdrop, drawn, inverse_depth, triangle, out.depth[k])
    if out.position_w.size > 0:
        if out.depth.size > 0:
            resolve_position(out.depth[k], view, out.position_w[k])
        else:
            depth = np.empty(triangle.shape, dtype=np.float32)
            resolve_depth(0, backdrop, drawn, inverse_depth, triangle, depth)
            resolve_position(depth, view, out.position_w[k])
    if out.geom.size > 0:
        table = np.arange(scene.geom_body.shape[0]).astype(np.int32)
        resolve_ids(backdrop, drawn, triangle, scene.face_geom, table, out.geom[k])
    if out.body.size > 0:
        resolve_ids(backdrop, drawn, triangle, scene.face_geom, scene.geom_body_id, out.body[k])
    if out.part.size > 0:
        resolve_ids(backdrop, drawn, triangle, scene.face_geom, scene.geom_part, out.part[k])


@kernel
def pose_matrices(body_positions: Array, body_quaternions: Array, positions: Array, rotations: Array) -> int:
    """Positions (B, N, 3) and quaternions (B, N, 4) to `Poses`; body 0 of the result is the world.

    Returns:
        The first pose that is not finite, as env * N + body, or -1.
    """
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
