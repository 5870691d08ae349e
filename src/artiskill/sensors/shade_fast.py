"""Fast shading for observations: light at the corners (Gouraud 1971), one sample per pixel, no shadows.

Three steps per view: list the faces that are seen, set each up, colour the pixels. The arrays of a scene are taken
out of their tuples once per step: Numba counts references each time, which inside a loop would cost more than the
work.
"""

from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, Point, kernel
from artiskill.sensors.lighting import Lights, cross3, dot3, encoded, irradiance, tone_mapped, unit3
from artiskill.sensors.rasterise import FLOOR, NOTHING
from artiskill.sensors.scan_conversion import point
from artiskill.sensors.scene_tables import SceneTables
from artiskill.sensors.texture import texel_row

# what is known of a face in the present view
_UNSEEN, _SEEN, _CONSTANT, _LINEAR, _TEXTURED = 0, 1, 2, 3, 4
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
    """

    seen: Array
    face_state: Array
    face_planes: Array
    point_view: Array
    point_colours: Array
    views: Array


def allocate_shade_scratch(faces: int, points: int) -> ShadeScratch:
    """Scratch for a scene; memory that is never touched is never used."""
    return ShadeScratch(
        np.empty(faces, dtype=np.int32),
        np.zeros(faces, dtype=np.uint8),
        np.empty((faces, 5, 3), dtype=np.float32),
        np.zeros((2, points), dtype=np.int64),
        np.empty((2, points, 3), dtype=np.float32),
        np.zeros(1, dtype=np.int64),
    )


@kernel
def shade_fast(
    scene: SceneTables,
    rotations: Array,
    lens: Array,
    light: Lights,
    plain: Array,
    camera: Array,
    inverse_depth: Array,
    triangle: Array,
    scratch: ShadeScratch,
    rgb: Array,
) -> None:
    """Colour a view.

    Args:
        scene: what was drawn.
        rotations: (N + 1, 3, 3) of the world and all bodies.
        lens: (5,) of the camera.
        light: lights and the display table.
        plain: (2, W, 3) uint8 a row of background and a row of floor.
        camera: (V, 3) vertices in the camera's frame: right, up, depth.
        inverse_depth: (H, W) float32.
        triangle: (H, W) int32.
        scratch: of the thread.
        rgb: (H, W, 3) uint8, written.
    """
    count = list_seen_faces(triangle, scratch.face_state, scratch.seen)
    set_up_faces(count, scene, rotations, lens, light, camera, scratch)
    states, planes = scratch.face_state, scratch.face_planes
    textures = scene.face_geom, scene.textures, scene.texels
    colour_pixels(lens, plain, inverse_depth, triangle, states, planes, *textures, rgb)
    for i in range(count):
        states[scratch.seen[i]] = _UNSEEN


@kernel
def list_seen_faces(triangle: Array, face_state: Array, seen: Array) -> int:
    """List every face in the buffer once; returns how many."""
    count = 0
    for row in range(triangle.shape[0]):
        for column in range(triangle.shape[1]):
            t = triangle[row, column]
            if t >= 0 and face_state[t] == _UNSEEN:
                face_state[t] = _SEEN
                seen[count] = t
                count += 1
    return count


@kernel
def set_up_faces(
    count: int,
    scene: SceneTables,
    rotations: Array,
    lens: Array,
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
    square_px = 0.5 * lens[0] * lens[0]
    for j in range(count):
        t = seen[j]
        geom = geoms[t]
        p0, p1, p2 = point(camera, faces[t, 0]), point(camera, faces[t, 1]), point(camera, faces[t, 2])
        rows = (cross3(p1, p2), cross3(p2, p0), cross3(p0, p1))
        det = dot3(p0, rows[0])  # six times the volume between eye and face; negative from behind
        back = 1 if det < 0.0 else 0
        textured = textures[geom, 1] > 0
        # its area on the screen: |det| shrinks with the third power of the distance
        small = abs(det) * square_px < _SMALL_PX * abs(p0[2] * p1[2] * p2[2])
        needed = 1 if (flat[t] or small) and not textured else 3
        for i in range(needed):
            s = corners[t, i]
            if point_view[back, s] != views[0]:
                point_view[back, s] = views[0]
                light_point(s, back, geom, bodies[geom] + 1, normals, rotations, materials, light, colours)
        if needed == 1:
            state[t] = _CONSTANT
            for i in range(3):
                planes[t, i, 2] = colours[back, corners[t, 0], i]
        else:
            state[t] = _TEXTURED if textured else _LINEAR
            used = (corners[t, 0], corners[t, 1], corners[t, 2])
            write_planes(t, back, used, rows, det, colours, uvs, planes)


@kernel
def light_point(
    s: int,
    back: int,
    geom: int,
    pose: int,
    normals: Array,
    rotations: Array,
    materials: Array,
    light: Lights,
    colours: Array,
) -> None:
    """Write the display colour of lit point s without its texture; arrays as in `SceneTables`, `ShadeScratch`."""
    normal = (np.float64(normals[s, 0]), np.float64(normals[s, 1]), np.float64(normals[s, 2]))
    received = irradiance(turned_normal(rotations, pose, normal, 1.0 - 2.0 * back), 1.0, 1.0, light)
    for k in range(3):
        value = encoded(tone_mapped(received[k] * materials[geom, k]), light.encode)
        colours[back, s, k] = np.float32(value)


@kernel
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
def colour_pixels(
    lens: Array,
    plain: Array,
    inverse_depth: Array,
    triangle: Array,
    face_state: Array,
    planes: Array,
    face_geom: Array,
    textures: Array,
    texels: Array,
    rgb: Array,
) -> None:
    """Colour all pixels from the faces' functions; arguments as in `shade_fast`, `ShadeScratch`, `SceneTables`."""
    per_px = np.float32(1.0 / lens[0])
    centre_x, centre_y = np.float32(lens[1] - 0.5), np.float32(lens[2] - 0.5)
    floor, nothing = plain[1].reshape(-1), (plain[0, 0, 0], plain[0, 0, 1], plain[0, 0, 2])
    for row in range(triangle.shape[0]):
        y = (centre_y - np.float32(row)) * per_px
        copy_bytes(floor, rgb[row].reshape(-1))  # most of it stays
        for column in range(triangle.shape[1]):
            t = triangle[row, column]
            if t == FLOOR:
                continue
            if t == NOTHING:
                rgb[row, column, 0], rgb[row, column, 1], rgb[row, column, 2] = nothing
                continue
            if face_state[t] == _CONSTANT:
                for k in range(3):
                    rgb[row, column, k] = byte(planes[t, k, 2])
                continue
            x = (np.float32(column) - centre_x) * per_px
            z = np.float32(1.0) / inverse_depth[row, column]
            texel = -1
            if face_state[t] == _TEXTURED:
                u, v = z * linear(planes, t, 3, x, y), z * linear(planes, t, 4, x, y)
                geom = face_geom[t]
                texel = texel_row(textures[geom, 0], textures[geom, 1], textures[geom, 2], u, v)
            for k in range(3):
                value = z * linear(planes, t, k, x, y)
                rgb[row, column, k] = byte(value if texel < 0 else value * tint(texels[texel, k]))


@kernel
def tint(texel: np.integer) -> np.floating:
    """A texel's byte to the factor [0, 1] on the display colour."""
    return np.float32(texel) * np.float32(1.0 / 255.0)


@kernel
def copy_bytes(source: Array, target: Array) -> None:
    """A flat loop, which the compiler turns into vector instructions; an array assignment checks for overlap."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@kernel
def byte(value: np.floating) -> np.integer:
    """A colour to the display's 0 .. 255."""
    return np.uint8(min(max(value, np.float32(0.0)), np.float32(255.0)))


@kernel
def linear(planes: Array, t: int, k: int, x: np.floating, y: np.floating) -> np.floating:
    """Function k of face t, linear over the screen."""
    return planes[t, k, 0] * x + planes[t, k, 1] * y + planes[t, k, 2]


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
