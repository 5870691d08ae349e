"""Fast shading for observations: light at the corners (Gouraud 1971), one sample per pixel, no shadows.

Three steps per view: list runs of neighbouring pixels that show one face and the faces that are seen, set each
face up, colour the pixels.
"""

import numpy as np

from artiskill.geometry.kernel import Array, Point, inlined_kernel, kernel
from artiskill.sensors.camera import View
from artiskill.sensors.drawing.buffers import LitPoints, ViewBuffers
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
    rotated_normal,
    texel_row,
    tone_mapped,
)
from artiskill.sensors.drawing.simd import LANES, copy, copy_simd, count_equal_simd, shade_simd

# what is known of a face in the present view; a textured one's state also tells its mipmap, by its excess
UNSEEN, SEEN, CONSTANT, LINEAR, TEXTURED = 0, 1, 2, 3, 4
# a face that covers less than this many pixels gets one corner's colour; in a fine mesh the others' hardly differ
_SMALL_PX = 4.0

Corners = tuple[int, int, int]
Factors = tuple[np.floating, np.floating, np.floating]


@kernel
def list_runs(buffers: ViewBuffers) -> None:
    """List the runs of a view, row by row, at most `LANES` pixels each, and its faces, each once.

    All faces are `UNSEEN` before; `SEEN` is written for those that are seen.
    """
    triangle, drawn, state = buffers.triangle, buffers.drawn, buffers.face_state
    runs, row_runs, seen = buffers.runs, buffers.row_runs, buffers.seen
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
                if state[t] == UNSEEN:
                    state[t] = SEEN
                    seen[faces] = t
                    faces += 1
            column += length
    row_runs[height] = count
    buffers.face_count[0] = faces


@kernel
def forget_faces(buffers: ViewBuffers) -> None:
    """Make the seen faces `UNSEEN` again."""
    state, seen = buffers.face_state, buffers.seen
    for i in range(buffers.face_count[0]):
        state[seen[i]] = UNSEEN


@kernel
def set_up_faces(
    scene: SceneTables, rotations: Array, view: View, light: Lights, buffers: ViewBuffers, lit: LitPoints
) -> None:
    """Write the seen faces' display colour and texture coordinates as functions of the screen, and their states.

    With the corners as columns of M, in the camera's frame, the point seen through the ray (x, y, 1) has the
    barycentric coordinates depth * M^-1 (x, y, 1) (Olano and Greer 1997), so that colours and texture coordinates
    over depth are linear. Where one colour will do, it is written as it is, in the place of the constants.
    """
    seen, state, planes, camera = buffers.seen, buffers.face_state, buffers.face_planes, buffers.camera
    point_view, colours, views = lit.point_view, lit.point_colours, lit.views
    face_rows, uvs, normals, bodies = scene.face_rows, scene.corner_uvs, scene.point_normals, scene.geom_body
    materials, textures = scene.materials, scene.textures
    views[0] += 1
    square_px, has_lamps = 0.5 * view.lens[0] * view.lens[0], light.lamps.shape[0] > 0
    for j in range(buffers.face_count[0]):
        t = seen[j]
        corners, geom = (face_rows[t, 3], face_rows[t, 4], face_rows[t, 5]), face_rows[t, 6]
        p0 = point(camera, face_rows[t, 0])
        p1, p2 = point(camera, face_rows[t, 1]), point(camera, face_rows[t, 2])
        rows = (cross3(p1, p2), cross3(p2, p0), cross3(p0, p1))
        det = dot3(p0, rows[0])  # six times the volume between eye and face; negative from behind
        back, textured = 1 if det < 0.0 else 0, textures[geom, 0, 1] > 0
        # its area on the screen: |det| shrinks with the third power of the distance
        area_px, cube = abs(det) * square_px, abs(p0[2] * p1[2] * p2[2])
        plain = (face_rows[t, 7] != 0 and not has_lamps) or area_px < _SMALL_PX * cube
        needed = 1 if plain and not textured else 3
        for i in range(needed):
            s = face_rows[t, 3 + i]
            if point_view[back, s] != views[0]:
                point_view[back, s] = views[0]
                place = in_world(point(camera, face_rows[t, i]), view) if has_lamps else (0.0, 0.0, 0.0)
                owner = geom, bodies[geom] + 1
                light_point((back, s), owner, place, normals, rotations, materials, light, colours)
        if needed == 1:
            state[t] = CONSTANT
            write_constants(t, back, corners[0], colours, planes)
            continue
        state[t] = TEXTURED + mip_level(textures[geom], uvs[t], area_px, cube) if textured else LINEAR
        write_planes((t, back), corners, rows, det, textured, colours, uvs, planes)


@inlined_kernel
def light_point(
    which: tuple[int, int],
    owner: tuple[int, int],
    place: Point,
    normals: Array,
    rotations: Array,
    materials: Array,
    light: Lights,
    colours: Array,
) -> None:
    """Write the display colour of a lit point without its texture.

    Args:
        which: 1 for its back, else 0; its number.
        owner: its geom, and that geom's pose.
        place: in the world; it matters to lamps only.
        normals: see `SceneTables`.
        rotations: of the poses.
        materials: see `SceneTables`.
        light: lights.
        colours: see `LitPoints`, written.
    """
    (back, s), (geom, pose) = which, owner
    given = (np.float64(normals[s, 0]), np.float64(normals[s, 1]), np.float64(normals[s, 2]))
    normal = rotated_normal(rotations, pose, given, 1.0 - 2.0 * back)
    received = irradiance(normal, 1.0, 1.0, light)
    if light.lamps.shape[0] > 0:
        added = point_irradiance(place, normal, light)
        received = (received[0] + added[0], received[1] + added[1], received[2] + added[2])
    for k in range(3):
        value = encoded(tone_mapped(received[k] * materials[geom, k]), light.encode)
        colours[back, s, k] = np.float32(value)


@inlined_kernel
def write_constants(t: int, back: int, s: int, colours: Array, planes: Array) -> None:
    """Write the colour of face t that has only one, that of lit point s."""
    for i in range(3):
        planes[t, i, 0], planes[t, i, 1] = 0.0, 0.0
        planes[t, i, 2] = colours[back, s, i]


@inlined_kernel
def in_world(p: Point, view: View) -> Point:
    """Map right, up and depth in the camera's frame to the world."""
    e, r = view.position, view.rotation
    return (
        e[0] + r[0, 0] * p[0] + r[0, 1] * p[1] - r[0, 2] * p[2],
        e[1] + r[1, 0] * p[0] + r[1, 1] * p[1] - r[1, 2] * p[2],
        e[2] + r[2, 0] * p[0] + r[2, 1] * p[1] - r[2, 2] * p[2],
    )


@inlined_kernel
def write_planes(
    which: tuple[int, int],
    corners: Corners,
    rows: tuple[Point, Point, Point],
    det: float,
    textured: bool,
    colours: Array,
    uvs: Array,
    planes: Array,
) -> None:
    """Write the colours of a face, and its texture coordinates if it is textured.

    Args:
        which: its number; 1 for its back, else 0.
        corners: lit points.
        rows: over `det` the matrix from rays to corners' shares.
        det: see `rows`.
        textured: whether it has a texture.
        colours: see `LitPoints`.
        uvs: see `SceneTables`.
        planes: see `ViewBuffers`, written.
    """
    t, back = which
    inverse = 1.0 / det if abs(det) > 1e-300 else 0.0
    for k in range(3):
        f0, f1, f2 = inverse * rows[0][k], inverse * rows[1][k], inverse * rows[2][k]
        for i in range(3):
            a, b, c = colours[back, corners[0], i], colours[back, corners[1], i], colours[back, corners[2], i]
            planes[t, i, k] = np.float32(f0 * a + f1 * b + f2 * c)
        if textured:
            for i in range(2):
                planes[t, 3 + i, k] = np.float32(f0 * uvs[t, 0, i] + f1 * uvs[t, 1, i] + f2 * uvs[t, 2, i])


@kernel
def paint_rows(
    first: int,
    rows: int,
    lens: Array,
    plain: Array,
    buffers: ViewBuffers,
    textured: Array,
    depth: Array,
    rgb: Array,
) -> int:
    """Colour some rows of a view, but for textured runs, which are listed.

    Lanes beyond a run are written too, and then again with what follows; the last row leaves some behind its end.

    Args:
        first: row of the view.
        rows: how many.
        lens: of the camera.
        plain: see `Lights`.
        buffers: of the view, whose runs are listed and faces set up.
        textured: (R,) int32 written: runs that are left to `paint_textures`.
        depth: (rows * W + LANES,) float32 metres.
        rgb: (rows * W + LANES, 3) uint8 written.

    Returns:
        How many entries of `textured` are in use.
    """
    floor, line, width = buffers.floor, buffers.line, buffers.triangle.shape[1]
    line_start, line_end, left = -1, -1, 0
    axes = image_axes(lens)
    for row in range(first, first + rows):
        if floor[row, 0] != line_start or floor[row, 1] != line_end:
            line_start, line_end = floor[row, 0], floor[row, 1]
            write_backdrop_line(line_start, line_end, plain, line)
        at = (row - first) * width  # of the row's first pixel in `rgb`
        copy(line.reshape(-1)[: 3 * width], rgb.reshape(-1)[3 * at :])
        left = paint_row(row, at, axes, buffers, left, textured, depth, rgb)
    return left


@inlined_kernel
def paint_row(
    row: int, at: int, axes: Factors, buffers: ViewBuffers, left: int, textured: Array, depth: Array, rgb: Array
) -> int:
    """Colour the runs of a row whose first pixel is number `at`; return `left`, grown; see `paint_rows`."""
    state, planes, line = buffers.face_state, buffers.face_planes, buffers.line
    runs, row_runs, width = buffers.runs, buffers.row_runs, buffers.triangle.shape[1]
    ids = buffers.triangle.reshape(-1)
    centre_x, centre_y, per_px = axes
    y = (centre_y - np.float32(row)) * per_px
    end = row_runs[row + 1]
    for i in range(row_runs[row], end):
        column = runs[i, 0] - row * width
        t = ids[runs[i, 0]]
        if state[t] >= TEXTURED:
            textured[left] = i
            left += 1
        else:
            curved = np.float32(0.0 if state[t] == CONSTANT else 1.0)
            shade_simd(rgb, depth, at + column, column, (centre_x, per_px, y, curved), factors(planes, t))
        column += runs[i, 1]
        if column < (runs[i + 1, 0] - row * width if i + 1 < end else width):
            copy_simd(rgb, at + column, line, column)
    return left


@kernel
def image_axes(lens: Array) -> Factors:
    """Return column and row of the optical axis, counted from the first pixel's centre, and 1 / focal length."""
    return np.float32(lens[1] - 0.5), np.float32(lens[2] - 0.5), np.float32(1.0 / lens[0])


@kernel
def write_backdrop_line(floor_start: int, floor_end: int, plain: Array, line: Array) -> None:
    """Write the colours of a row that shows floor in some columns and nothing in all others: (W + LANES, 3)."""
    for column in range(line.shape[0]):
        kind = 1 if floor_start <= column < floor_end else 0
        for k in range(3):
            line[column, k] = plain[kind, k]


@kernel
def paint_textures(
    first: int, lens: Array, scene: SceneTables, buffers: ViewBuffers, textured: Array, depth: Array, rgb: Array
) -> None:
    """Colour textured runs of the rows from `first` on; arguments as of `paint_rows`, `textured` those in use."""
    runs, state, planes = buffers.runs, buffers.face_state, buffers.face_planes
    face_geom, textures, texels = scene.face_geom, scene.textures, scene.texels
    width, ids = buffers.triangle.shape[1], buffers.triangle.reshape(-1)
    centre_x, centre_y, per_px = image_axes(lens)
    for i in textured:
        row, begin = runs[i, 0] // width, runs[i, 0] % width
        t = ids[runs[i, 0]]
        g, level = face_geom[t], state[t] - TEXTURED
        image = textures[g, level, 0], textures[g, level, 1], textures[g, level, 2]
        y = (centre_y - np.float32(row)) * per_px
        at = (row - first) * width
        for column in range(begin, begin + runs[i, 1]):
            x, z = (np.float32(column) - centre_x) * per_px, depth[at + column]
            u, v = z * linear(planes, t, 3, x, y), z * linear(planes, t, 4, x, y)
            texel = texel_row(image[0], image[1], image[2], u, v)
            for k in range(3):
                rgb[at + column, k] = byte(z * linear(planes, t, k, x, y) * tint(texels[texel, k]))


@kernel
def list_faces(camera: int, pixels: Array, buffers: ViewBuffers) -> None:
    """List the faces that some pixels of a view show, each once, instead of `list_runs`.

    Args:
        camera: number of the view.
        pixels: (M,) numbers, counted through all views; those of other views are left out.
        buffers: of the view.
    """
    triangle, state, seen = buffers.triangle.reshape(-1), buffers.face_state, buffers.seen
    count, start = 0, camera * triangle.shape[0]
    for i in range(pixels.shape[0]):
        if start <= pixels[i] < start + triangle.shape[0]:
            t = triangle[pixels[i] - start]
            if state[t] == UNSEEN:
                state[t] = SEEN
                seen[count] = t
                count += 1
    buffers.face_count[0] = count


@kernel
def paint_pixels(
    camera: int, pixels: Array, lens: Array, scene: SceneTables, buffers: ViewBuffers, rgb: Array
) -> None:
    """Colour those pixels that belong to one view, whose faces are set up: (M, 3); see `list_faces`."""
    triangle, inverse_depth = buffers.triangle, buffers.inverse_depth
    state, planes = buffers.face_state, buffers.face_planes
    face_geom, textures, texels = scene.face_geom, scene.textures, scene.texels
    width, start = triangle.shape[1], camera * triangle.size
    centre_x, centre_y, per_px = image_axes(lens)
    for i in range(pixels.shape[0]):
        if not start <= pixels[i] < start + triangle.size:
            continue
        row, column = (pixels[i] - start) // width, (pixels[i] - start) % width
        x, y = (np.float32(column) - centre_x) * per_px, (centre_y - np.float32(row)) * per_px
        z, t, texel = np.float32(1.0) / inverse_depth[row, column], triangle[row, column], -1
        if state[t] == CONSTANT:
            z = np.float32(1.0)
        if state[t] >= TEXTURED:
            u, v = z * linear(planes, t, 3, x, y), z * linear(planes, t, 4, x, y)
            g, level = face_geom[t], state[t] - TEXTURED
            texel = texel_row(textures[g, level, 0], textures[g, level, 1], textures[g, level, 2], u, v)
        for k in range(3):
            value = z * linear(planes, t, k, x, y)
            rgb[i, k] = byte(value if texel < 0 else value * tint(texels[texel, k]))


@kernel
def factors(planes: Array, t: int) -> tuple[Factors, Factors, Factors]:
    """Return the three colours of face t as functions of the ray's x, y and 1."""
    return (
        (planes[t, 0, 0], planes[t, 0, 1], planes[t, 0, 2]),
        (planes[t, 1, 0], planes[t, 1, 1], planes[t, 1, 2]),
        (planes[t, 2, 0], planes[t, 2, 1], planes[t, 2, 2]),
    )


@kernel
def linear(planes: Array, t: int, k: int, x: np.floating, y: np.floating) -> np.floating:
    """Evaluate function k of face t, linear over the screen."""
    return planes[t, k, 0] * x + planes[t, k, 1] * y + planes[t, k, 2]


@kernel
def tint(texel: np.integer) -> np.floating:
    """Turn a texel's byte into the factor [0, 1] on the display colour."""
    return np.float32(texel) * np.float32(1.0 / 255.0)


@kernel
def byte(value: np.floating) -> np.integer:
    """Turn a colour into the display's 0 .. 255."""
    return np.uint8(min(max(value, np.float32(0.0)), np.float32(255.0)))
