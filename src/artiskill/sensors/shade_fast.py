"""Fast shading for observations: light at the corners (Gouraud 1971), one sample per pixel, no shadows.

Three steps per view: list the faces that are seen, set each up, colour the pixels. The arrays of a scene are taken
out of their tuples once per step: Numba counts references each time, which inside a loop would cost more than the
work.
"""

from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, Point, inlined_kernel, kernel
from artiskill.sensors.lighting import Lights, View, cross3, dot3, encoded, irradiance, tone_mapped, unit3
from artiskill.sensors.paint import (
    CONSTANT,
    LINEAR,
    SEEN,
    TEXTURED,
    UNSEEN,
    paint_rows,
    paint_runs,
    paint_textures,
)
from artiskill.sensors.point_lights import light_floor, point_irradiance
from artiskill.sensors.scan_conversion import point
from artiskill.sensors.scene_tables import SceneTables
from artiskill.sensors.texture import mip_level

# a face that covers less than this many pixels gets one corner's colour; in a fine mesh the others' hardly differ
_SMALL_PX = 4.0

Corners = tuple[int, int, int]


class ShadeScratch(NamedTuple):
    """What one view computes once per seen face or lit point.

    Attributes:
        seen: (F,) int32 the faces that are seen.
        face_state: (F,) uint8 which of the above; all zero between views.
        face_planes: (F, 5, 3) float32 red, green, blue, u, v: see `set_up_faces`.
        point_view: (2, S) int64 the view for which a lit point's colour is known, for its front and its back.
        point_colours: (2, S, 3) float32 display colours [0, 255].
        views: (1,) int64 how many views were drawn.
        runs: (H * W, 2) int32 runs of textured pixels: number of the first in the image, and how many.
    """

    seen: Array
    face_state: Array
    face_planes: Array
    point_view: Array
    point_colours: Array
    views: Array
    runs: Array


def allocate_shade_scratch(faces: int, points: int, pixels: int) -> ShadeScratch:
    """Scratch for a scene; memory that is never touched is never used."""
    return ShadeScratch(
        np.empty(faces, dtype=np.int32),
        np.zeros(faces, dtype=np.uint8),
        np.empty((faces, 5, 3), dtype=np.float32),
        np.zeros((2, points), dtype=np.int64),
        np.empty((2, points, 3), dtype=np.float32),
        np.zeros(1, dtype=np.int64),
        np.empty((pixels, 2), dtype=np.int32),
    )


@kernel
def shade_fast(
    scene: SceneTables,
    rotations: Array,
    view: View,
    light: Lights,
    plain: Array,
    camera: Array,
    depth: Array,
    triangle: Array,
    scratch: ShadeScratch,
    rgb: Array,
) -> None:
    """Colour a view.

    Args:
        scene: what was drawn.
        rotations: (N + 1, 3, 3) of the world and all bodies.
        view: the camera.
        light: lights and the display table.
        plain: (2, W, 3) uint8 a row of background and a row of floor.
        camera: (V, 3) vertices in the camera's frame: right, up, depth.
        depth: (H, W) float32 metres.
        triangle: (H, W) int32.
        scratch: of the thread.
        rgb: (H, W, 3) uint8, written.
    """
    count = list_seen_faces(triangle, scratch.face_state, scratch.seen)
    set_up_faces(count, scene, rotations, view, light, camera, scratch)
    states, planes = scratch.face_state, scratch.face_planes
    textures = scene.face_geom, scene.textures, scene.texels
    rows, textured = paint_runs(view.lens, plain, depth, triangle, states, planes, scratch.runs, rgb)
    if textured > 0:
        paint_textures(scratch.runs[:textured], view.lens, depth, triangle, states, planes, *textures, rgb)
    paint_rows(rows, view.lens, plain, depth, triangle, states, planes, *textures, rgb)
    if light.lamps.shape[0] > 0:
        light_floor(view, light, triangle, rgb)
    for i in range(count):
        states[scratch.seen[i]] = UNSEEN


@kernel
def list_seen_faces(triangle: Array, face_state: Array, seen: Array) -> int:
    """List every face in the buffer once; returns how many."""
    count = 0
    for row in range(triangle.shape[0]):
        for column in range(triangle.shape[1]):
            t = triangle[row, column]
            if t >= 0 and face_state[t] == UNSEEN:
                face_state[t] = SEEN
                seen[count] = t
                count += 1
    return count


@kernel
def set_up_faces(
    count: int,
    scene: SceneTables,
    rotations: Array,
    view: View,
    light: Lights,
    camera: Array,
    scratch: ShadeScratch,
) -> None:
    """Write the seen faces' display colour and texture coordinates as functions of the screen, and their states.

    With the corners as columns of M, in the camera's frame, the point seen through the ray (x, y, 1) has the
    barycentric coordinates depth * M^-1 (x, y, 1) (Olano and Greer 1997), so that colours and texture coordinates
    over depth are linear. Where one colour will do, it is written as it is, in the place of the constants.
    """
    seen, state, planes = scratch.seen, scratch.face_state, scratch.face_planes
    point_view, colours, views = scratch.point_view, scratch.point_colours, scratch.views
    faces, corners, flat, uvs = scene.faces, scene.corner_points, scene.flat, scene.corner_uvs
    normals, geoms, bodies = scene.point_normals, scene.face_geom, scene.geom_body
    materials, textures = scene.materials, scene.textures
    views[0] += 1
    square_px, has_lamps = 0.5 * view.lens[0] * view.lens[0], light.lamps.shape[0] > 0
    for j in range(count):
        t = seen[j]
        geom = geoms[t]
        p0, p1, p2 = point(camera, faces[t, 0]), point(camera, faces[t, 1]), point(camera, faces[t, 2])
        rows = (cross3(p1, p2), cross3(p2, p0), cross3(p0, p1))
        det = dot3(p0, rows[0])  # six times the volume between eye and face; negative from behind
        back = 1 if det < 0.0 else 0
        textured = textures[geom, 0, 1] > 0
        # its area on the screen: |det| shrinks with the third power of the distance
        area_px, cube = abs(det) * square_px, abs(p0[2] * p1[2] * p2[2])
        plain = (flat[t] and not has_lamps) or area_px < _SMALL_PX * cube
        needed = 1 if plain and not textured else 3
        for i in range(needed):
            s = corners[t, i]
            if point_view[back, s] != views[0]:
                point_view[back, s] = views[0]
                place = in_world(point(camera, faces[t, i]), view) if has_lamps else (0.0, 0.0, 0.0)
                light_point(s, back, geom, bodies[geom] + 1, place, normals, rotations, materials, light, colours)
        if needed == 1:
            state[t] = CONSTANT
            for i in range(3):
                planes[t, i, 0], planes[t, i, 1] = 0.0, 0.0
                planes[t, i, 2] = colours[back, corners[t, 0], i]
        else:
            state[t] = TEXTURED + mip_level(textures[geom], uvs[t], area_px, cube) if textured else LINEAR
            used = (corners[t, 0], corners[t, 1], corners[t, 2])
            write_planes(t, back, used, rows, det, colours, uvs, planes)


@inlined_kernel
def light_point(
    s: int,
    back: int,
    geom: int,
    pose: int,
    place: Point,
    normals: Array,
    rotations: Array,
    materials: Array,
    light: Lights,
    colours: Array,
) -> None:
    """Write the display colour of lit point s without its texture; arrays as in `SceneTables`, `ShadeScratch`.

    `place` in the world matters to lamps only.
    """
    normal = (np.float64(normals[s, 0]), np.float64(normals[s, 1]), np.float64(normals[s, 2]))
    turned = turned_normal(rotations, pose, normal, 1.0 - 2.0 * back)
    received = irradiance(turned, 1.0, 1.0, light)
    if light.lamps.shape[0] > 0:
        added = point_irradiance(place, turned, light)
        received = (received[0] + added[0], received[1] + added[1], received[2] + added[2])
    for k in range(3):
        value = encoded(tone_mapped(received[k] * materials[geom, k]), light.encode)
        colours[back, s, k] = np.float32(value)


@inlined_kernel
def in_world(p: Point, view: View) -> Point:
    """Right, up and depth in the camera's frame to the world."""
    e, r = view.position, view.rotation
    return (
        e[0] + r[0, 0] * p[0] + r[0, 1] * p[1] - r[0, 2] * p[2],
        e[1] + r[1, 0] * p[0] + r[1, 1] * p[1] - r[1, 2] * p[2],
        e[2] + r[2, 0] * p[0] + r[2, 1] * p[1] - r[2, 2] * p[2],
    )


@inlined_kernel
def write_planes(
    t: int,
    back: int,
    used: Corners,
    rows: tuple[Point, Point, Point],
    det: float,
    colours: Array,
    uvs: Array,
    planes: Array,
) -> None:
    """Colours and texture coordinates of face t; `rows` / `det` is the matrix from rays to corners' shares."""
    inverse = 1.0 / det if abs(det) > 1e-300 else 0.0
    for k in range(3):
        f0, f1, f2 = inverse * rows[0][k], inverse * rows[1][k], inverse * rows[2][k]
        for i in range(3):
            a, b, c = colours[back, used[0], i], colours[back, used[1], i], colours[back, used[2], i]
            planes[t, i, k] = np.float32(f0 * a + f1 * b + f2 * c)
        for i in range(2):
            planes[t, 3 + i, k] = np.float32(f0 * uvs[t, 0, i] + f1 * uvs[t, 1, i] + f2 * uvs[t, 2, i])


@kernel
def turned_normal(rotations: Array, pose: int, n: Point, side: float) -> Point:
    """A body-frame normal rotated to the world, unit length, turned to the side that is seen."""
    r = rotations
    return unit3(
        (
            side * (r[pose, 0, 0] * n[0] + r[pose, 0, 1] * n[1] + r[pose, 0, 2] * n[2]),
            side * (r[pose, 1, 0] * n[0] + r[pose, 1, 1] * n[1] + r[pose, 1, 2] * n[2]),
            side * (r[pose, 2, 0] * n[0] + r[pose, 2, 1] * n[1] + r[pose, 2, 2] * n[2]),
        )
    )
