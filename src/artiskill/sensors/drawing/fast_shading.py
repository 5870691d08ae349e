"""Fast shading for observations: light at the corners (Gouraud 1971), one sample per pixel, no shadows.

Three steps per view: list runs of pixels and the faces that are seen (`runs`), set each face up (here), colour the
pixels (`paint`). The arrays of a scene are taken out of their tuples once per step: Numba counts references each
time, which inside a loop would cost more than the work.
"""

from typing import Any

import numpy as np

from artiskill.geometry.kernel import Array, Point, inlined_kernel, kernel
from artiskill.sensors.camera import View
from artiskill.sensors.drawing.buffers import Drawing, LitPoints
from artiskill.sensors.drawing.rasterise import point
from artiskill.sensors.drawing.scene_tables import SceneTables
from artiskill.sensors.drawing.shading import (
    Lights,
    cross3,
    dot3,
    encoded,
    irradiance,
    mip_level,
    point_irradiance,
    texel_row,
    tone_mapped,
    turned_normal,
)
from artiskill.sensors.drawing.simd import LANES, copy, copy_simd, count_equal_simd, shade_simd

# what is known of a face in the present view, see `paint`
UNSEEN, SEEN = 0, 1


@kernel
def list_runs(triangle: Array, drawn: Array, face_state: Array, seen: Array, runs: Array, row_runs: Array) -> int:
    """List the runs of a view, row by row, and its faces, each once.

    Args:
        triangle: (H, W) buffer.
        drawn: (H, 2) where it has values; elsewhere is no face.
        face_state: (F,) uint8 all `UNSEEN`; `SEEN` written for the faces that are seen.
        seen: (F,) int32 written: the faces that are seen.
        runs: (H * W, 2) int32 written: number of the first pixel in the image, and how many, at most `LANES`.
        row_runs: (H + 1,) int32 written: the first run of each row, and how many there are.

    Returns:
        How many faces are seen.
    """
    count, faces = 0, 0
    height, width = triangle.shape
    for row in range(height):
        row_runs[row] = count
        column, end = drawn[row, 0], drawn[row, 1]
        while column < end:
            index = row * width + column
            t = triangle[row, column]
            length = min(count_equal_simd(triangle, index), end - column) if index + LANES <= triangle.size else 1
            if t >= 0:
                runs[count, 0], runs[count, 1] = index, length
                count += 1
                if face_state[t] == UNSEEN:
                    face_state[t] = SEEN
                    seen[faces] = t
                    faces += 1
            column += length
    row_runs[height] = count
    return faces


# what is known of a seen face once it is set up; a textured one's state also tells its mipmap, by its excess
CONSTANT, LINEAR, TEXTURED = 2, 3, 4

Factors = tuple[np.floating, np.floating, np.floating]


@kernel
def paint_rows(
    first: int,
    rows: int,
    lens: Array,
    plain: Array,
    floor: Array,
    runs: Array,
    row_runs: Array,
    depth: Array,
    triangle: Array,
    face_state: Array,
    planes: Array,
    textured: Array,
    rgb: Array,
) -> int:
    """Colour some rows of a view, but for textured runs, which are listed.

    Lanes beyond a run are written too, and then again with what follows; the last row leaves some behind its end.

    Args:
        first: row of the view.
        rows: how many.
        lens: of the camera.
        plain: (2, 3) uint8 colours of background and floor.
        floor: (H, 2) see `Backdrop`.
        runs: (R, 2) of the view, as the next argument from `list_runs`.
        row_runs: (H + 1,).
        depth: (rows * W + LANES,) float32 metres.
        triangle: (H, W) buffer.
        face_state: (F,) uint8.
        planes: (F, 5, 3) see `Drawing`.
        textured: (R,) int32 written: runs that are left to `paint_textures`.
        rgb: (rows * W + LANES, 3) uint8 written.

    Returns:
        How many entries of `textured` are in use.
    """
    width = triangle.shape[1]
    ids = triangle.reshape(-1)
    line = np.empty((width + LANES, 3), dtype=np.uint8)  # a row without faces
    line_start, line_end = -1, -1
    left = 0
    per_px = np.float32(1.0 / lens[0])
    centre_x, centre_y = np.float32(lens[1] - 0.5), np.float32(lens[2] - 0.5)
    for row in range(first, first + rows):
        if floor[row, 0] != line_start or floor[row, 1] != line_end:
            line_start, line_end = floor[row, 0], floor[row, 1]
            for column in range(width + LANES):
                kind = 1 if line_start <= column < line_end else 0
                for k in range(3):
                    line[column, k] = plain[kind, k]
        y = (centre_y - np.float32(row)) * per_px
        at = (row - first) * width  # of the row's first pixel in `rgb`
        copy(line.reshape(-1)[: 3 * width], rgb.reshape(-1)[3 * at :])
        begin, end = row_runs[row], row_runs[row + 1]
        for i in range(begin, end):
            column, count = runs[i, 0] - row * width, runs[i, 1]
            t = ids[runs[i, 0]]
            if face_state[t] >= TEXTURED:
                textured[left] = i
                left += 1
            else:
                curved = np.float32(0.0 if face_state[t] == CONSTANT else 1.0)
                red, green, blue = factors(planes, t, 0), factors(planes, t, 1), factors(planes, t, 2)
                shade_simd(rgb, depth, at + column, column, centre_x, per_px, y, curved, red, green, blue)
            column += count
            following = runs[i + 1, 0] - row * width if i + 1 < end else width
            if column < following:
                copy_simd(rgb, at + column, line, column)
    return left


@kernel
def paint_textures(
    first: int,
    lens: Array,
    runs: Array,
    textured: Array,
    depth: Array,
    triangle: Array,
    face_state: Array,
    planes: Array,
    face_geom: Array,
    textures: Array,
    texels: Array,
    rgb: Array,
) -> None:
    """Colour textured runs of the rows from `first` on; arguments as of `paint_rows`, `textured` those in use."""
    width = triangle.shape[1]
    ids = triangle.reshape(-1)
    per_px = np.float32(1.0 / lens[0])
    centre_x, centre_y = np.float32(lens[1] - 0.5), np.float32(lens[2] - 0.5)
    for i in textured:
        row, begin = runs[i, 0] // width, runs[i, 0] % width
        t = ids[runs[i, 0]]
        g, level = face_geom[t], face_state[t] - TEXTURED
        image = textures[g, level, 0], textures[g, level, 1], textures[g, level, 2]
        y = (centre_y - np.float32(row)) * per_px
        at = (row - first) * width
        for column in range(begin, begin + runs[i, 1]):
            x, z = (np.float32(column) - centre_x) * per_px, depth[at + column]
            u, v = z * linear(planes, t, 3, x, y), z * linear(planes, t, 4, x, y)
            texel = texel_row(image[0], image[1], image[2], u, v)
            for k in range(3):
                rgb[at + column, k] = byte(z * linear(planes, t, k, x, y) * tint(texels[texel, k]))


@inlined_kernel
def paint_pixel(
    i: int,
    x: Any,
    y: Any,
    z: Any,
    t: int,
    face_state: Array,
    planes: Array,
    face_geom: Array,
    textures: Array,
    texels: Array,
    rgb: Array,
) -> None:
    """Colour entry i of rgb (N, 3): a pixel that shows face t at depth z through the ray (x, y, 1)."""
    texel = -1
    if face_state[t] == CONSTANT:
        z = np.float32(1.0)
    if face_state[t] >= TEXTURED:
        u, v = z * linear(planes, t, 3, x, y), z * linear(planes, t, 4, x, y)
        g, level = face_geom[t], face_state[t] - TEXTURED
        texel = texel_row(textures[g, level, 0], textures[g, level, 1], textures[g, level, 2], u, v)
    for k in range(3):
        value = z * linear(planes, t, k, x, y)
        rgb[i, k] = byte(value if texel < 0 else value * tint(texels[texel, k]))


@kernel
def factors(planes: Array, t: int, k: int) -> Factors:
    """Function k of face t, by the ray's x, y and 1."""
    return planes[t, k, 0], planes[t, k, 1], planes[t, k, 2]


@kernel
def linear(planes: Array, t: int, k: int, x: np.floating, y: np.floating) -> np.floating:
    """Function k of face t, linear over the screen."""
    return planes[t, k, 0] * x + planes[t, k, 1] * y + planes[t, k, 2]


@kernel
def tint(texel: np.integer) -> np.floating:
    """A texel's byte to the factor [0, 1] on the display colour."""
    return np.float32(texel) * np.float32(1.0 / 255.0)


@kernel
def byte(value: np.floating) -> np.integer:
    """A colour to the display's 0 .. 255."""
    return np.uint8(min(max(value, np.float32(0.0)), np.float32(255.0)))


# a face that covers less than this many pixels gets one corner's colour; in a fine mesh the others' hardly differ
_SMALL_PX = 4.0

Corners = tuple[int, int, int]


@kernel
def set_up_faces(
    count: int,
    scene: SceneTables,
    rotations: Array,
    view: View,
    light: Lights,
    drawing: Drawing,
    lit: LitPoints,
) -> None:
    """Write the seen faces' display colour and texture coordinates as functions of the screen, and their states.

    With the corners as columns of M, in the camera's frame, the point seen through the ray (x, y, 1) has the
    barycentric coordinates depth * M^-1 (x, y, 1) (Olano and Greer 1997), so that colours and texture coordinates
    over depth are linear. Where one colour will do, it is written as it is, in the place of the constants.
    """
    seen, state, planes, camera = drawing.seen, drawing.face_state, drawing.face_planes, drawing.camera
    point_view, colours, views = lit.point_view, lit.point_colours, lit.views
    face_rows, uvs, normals, bodies = scene.face_rows, scene.corner_uvs, scene.point_normals, scene.geom_body
    materials, textures = scene.materials, scene.textures
    views[0] += 1
    square_px, has_lamps = 0.5 * view.lens[0] * view.lens[0], light.lamps.shape[0] > 0
    for j in range(count):
        t = seen[j]
        corners, geom = (face_rows[t, 3], face_rows[t, 4], face_rows[t, 5]), face_rows[t, 6]
        p0 = point(camera, face_rows[t, 0])
        p1, p2 = point(camera, face_rows[t, 1]), point(camera, face_rows[t, 2])
        rows = (cross3(p1, p2), cross3(p2, p0), cross3(p0, p1))
        det = dot3(p0, rows[0])  # six times the volume between eye and face; negative from behind
        back = 1 if det < 0.0 else 0
        textured = textures[geom, 0, 1] > 0
        # its area on the screen: |det| shrinks with the third power of the distance
        area_px, cube = abs(det) * square_px, abs(p0[2] * p1[2] * p2[2])
        plain = (face_rows[t, 7] != 0 and not has_lamps) or area_px < _SMALL_PX * cube
        needed = 1 if plain and not textured else 3
        for i in range(needed):
            s = face_rows[t, 3 + i]
            if point_view[back, s] != views[0]:
                point_view[back, s] = views[0]
                place = in_world(point(camera, face_rows[t, i]), view) if has_lamps else (0.0, 0.0, 0.0)
                light_point(s, back, geom, bodies[geom] + 1, place, normals, rotations, materials, light, colours)
        if needed == 1:
            state[t] = CONSTANT
            for i in range(3):
                planes[t, i, 0], planes[t, i, 1] = 0.0, 0.0
                planes[t, i, 2] = colours[back, corners[0], i]
        else:
            state[t] = TEXTURED + mip_level(textures[geom], uvs[t], area_px, cube) if textured else LINEAR
            write_planes(t, back, corners, rows, det, colours, planes)
            if textured:
                write_texture_planes(t, rows, det, uvs, planes)


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
    """Write the display colour of lit point s without its texture; arrays as in `SceneTables`, `LitPoints`.

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
    planes: Array,
) -> None:
    """Colours of face t; `rows` / `det` is the matrix from rays to corners' shares."""
    inverse = 1.0 / det if abs(det) > 1e-300 else 0.0
    for k in range(3):
        f0, f1, f2 = inverse * rows[0][k], inverse * rows[1][k], inverse * rows[2][k]
        for i in range(3):
            a, b, c = colours[back, used[0], i], colours[back, used[1], i], colours[back, used[2], i]
            planes[t, i, k] = np.float32(f0 * a + f1 * b + f2 * c)


@inlined_kernel
def write_texture_planes(t: int, rows: tuple[Point, Point, Point], det: float, uvs: Array, planes: Array) -> None:
    """Texture coordinates of face t, as `write_planes`."""
    inverse = 1.0 / det if abs(det) > 1e-300 else 0.0
    for k in range(3):
        f0, f1, f2 = inverse * rows[0][k], inverse * rows[1][k], inverse * rows[2][k]
        for i in range(2):
            planes[t, 3 + i, k] = np.float32(f0 * uvs[t, 0, i] + f1 * uvs[t, 1, i] + f2 * uvs[t, 2, i])
