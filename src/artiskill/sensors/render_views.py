"""Kernel that draws views, one after the other, without the interpreter; its inputs and its scratch."""

from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.lighting import Lights, View
from artiskill.sensors.rasterise import draw_geoms, fill_background
from artiskill.sensors.resolve import Channels, resolve_depth, resolve_geometry
from artiskill.sensors.scene_tables import SceneTables
from artiskill.sensors.shade_fast import ShadeScratch, allocate_shade_scratch, shade_fast


class Scratch(NamedTuple):
    """What drawing one view needs besides its inputs; one per thread.

    Attributes:
        camera: (V, 3) float64 vertices as right, up, depth in the camera's frame.
        projected: (V, 3) float64 vertices as screen x, y and inverse depth.
        candidates: (F,) int32 faces to draw.
        inverse_depth: (H, W) float32.
        triangle: (H, W) int32.
        depth: (1, H, W) float32 metres, for when depth is not asked for.
        shade: of the shader.
    """

    camera: Array
    projected: Array
    candidates: Array
    inverse_depth: Array
    triangle: Array
    depth: Array
    shade: ShadeScratch


class Poses(NamedTuple):
    """The world, index 0, and N bodies: `positions` (B, N + 1, 3), `rotations` (B, N + 1, 3, 3)."""

    positions: Array
    rotations: Array


class Views(NamedTuple):
    """K cameras: `positions` (K, 3), `rotations` (K, 3, 3), `lenses` (K, 5) as from `Camera.lens`."""

    positions: Array
    rotations: Array
    lenses: Array


def allocate_scratch(scene: SceneTables, height: int, width: int) -> Scratch:
    """Scratch for views of so many pixels."""
    vertices, faces = scene.vertices.shape, len(scene.faces)
    return Scratch(
        np.zeros(vertices),
        np.zeros(vertices),
        np.empty(faces + 1, dtype=np.int32),  # one more: the last entry is written before it is counted
        np.empty((height, width), dtype=np.float32),
        np.empty((height, width), dtype=np.int32),
        np.empty((1, height, width), dtype=np.float32),
        allocate_shade_scratch(faces, len(scene.point_vertex), height * width),
    )


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
        plain: (2, W, 3) uint8 a row of background and a row of floor.
        has_floor: whether the ground is drawn.
        scratch: of this thread.
        out: the channels to write, K images each or none.
    """
    buffers = (scratch.inverse_depth, scratch.triangle)
    for k in range(first, last):
        view = View(views.positions[k], views.rotations[k], views.lenses[k])
        positions, rotations = poses.positions[k // cameras], poses.rotations[k // cameras]
        fill_background(view.position, view.rotation, view.lens, has_floor, buffers[0], buffers[1])
        draw_geoms(
            scene,
            positions,
            rotations,
            view,
            scratch.camera,
            scratch.projected,
            scratch.candidates,
            buffers[0],
            buffers[1],
        )
        depth = out.depth[k] if out.depth.size > 0 else scratch.depth[0]
        if out.depth.size > 0 or out.position_w.size > 0 or out.rgb.size > 0:
            resolve_depth(buffers[0], buffers[1], depth)
        resolve_geometry(k, scene, view, depth, buffers[1], out)
        if out.rgb.size > 0:
            shade_fast(
                scene,
                rotations,
                view,
                light,
                plain,
                scratch.camera,
                depth,
                buffers[1],
                scratch.shade,
                out.rgb[k],
            )


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
