"""Kernels that colour the pixels of a view from what was set up for each face that is seen, see `set_up_faces`."""

from typing import Any

import numpy as np

from artiskill.geometry.kernel import Array, inlined_kernel, kernel
from artiskill.sensors.lanes import LANES, copy_lanes, shade_lanes
from artiskill.sensors.row_fill import copy
from artiskill.sensors.texture import texel_row

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
                shade_lanes(rgb, depth, at + column, column, centre_x, per_px, y, curved, red, green, blue)
            column += count
            following = runs[i + 1, 0] - row * width if i + 1 < end else width
            if column < following:
                copy_lanes(rgb, at + column, line, column)
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
