"""Kernels that colour the pixels of a view from what was set up for each face that is seen, see `set_up_faces`."""

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.lanes import LANES, copy_lanes, equal_lanes, shade_lanes
from artiskill.sensors.rasterise import FLOOR
from artiskill.sensors.texture import texel_row

# what is known of a face in the present view; a textured one's state also tells its mipmap, by what it exceeds it
UNSEEN, SEEN, CONSTANT, LINEAR, TEXTURED = 0, 1, 2, 3, 4

Factors = tuple[np.floating, np.floating, np.floating]


@kernel
def paint_runs(
    lens: Array,
    plain: Array,
    depth: Array,
    triangle: Array,
    face_state: Array,
    planes: Array,
    runs: Array,
    rgb: Array,
) -> tuple[int, int]:
    """Colour the pixels of all rows but the last, by runs of pixels that show one face; list textured runs.

    Lanes beyond a run are written too, and then again with the next run. In the last rows they would leave the
    image.

    Returns:
        How many rows are done, and how many rows of `runs` are in use: the runs that are left to `paint_textures`.
    """
    height, width = triangle.shape
    rows = max(0, height - 1 - (LANES - 1) // width) if width >= LANES else 0
    textured = 0
    per_px = np.float32(1.0 / lens[0])
    centre_x, centre_y = np.float32(lens[1] - 0.5), np.float32(lens[2] - 0.5)
    for row in range(rows):
        y = (centre_y - np.float32(row)) * per_px
        column = 0
        while column < width:
            index = row * width + column
            t = triangle[row, column]
            count = min(equal_lanes(triangle, index), width - column)
            if t < 0:
                copy_lanes(rgb, index, plain, width if t == FLOOR else 0)
            elif face_state[t] >= TEXTURED:
                runs[textured, 0], runs[textured, 1] = index, count
                textured += 1
            else:
                curved = np.float32(0.0 if face_state[t] == CONSTANT else 1.0)
                red, green, blue = factors(planes, t, 0), factors(planes, t, 1), factors(planes, t, 2)
                shade_lanes(rgb, depth, index, column, centre_x, per_px, y, curved, red, green, blue)
            column += count
    return rows, textured


@kernel
def paint_textures(
    runs: Array,
    lens: Array,
    depth: Array,
    triangle: Array,
    face_state: Array,
    planes: Array,
    face_geom: Array,
    textures: Array,
    texels: Array,
    rgb: Array,
) -> None:
    """Colour runs (R, 2) of textured pixels."""
    width = triangle.shape[1]
    per_px = np.float32(1.0 / lens[0])
    centre_x, centre_y = np.float32(lens[1] - 0.5), np.float32(lens[2] - 0.5)
    for i in range(runs.shape[0]):
        row, first = runs[i, 0] // width, runs[i, 0] % width
        t = triangle[row, first]
        g, level = face_geom[t], face_state[t] - TEXTURED
        image = textures[g, level, 0], textures[g, level, 1], textures[g, level, 2]
        y = (centre_y - np.float32(row)) * per_px
        for column in range(first, first + runs[i, 1]):
            x, z = (np.float32(column) - centre_x) * per_px, depth[row, column]
            u, v = z * linear(planes, t, 3, x, y), z * linear(planes, t, 4, x, y)
            texel = texel_row(image[0], image[1], image[2], u, v)
            for k in range(3):
                rgb[row, column, k] = byte(z * linear(planes, t, k, x, y) * tint(texels[texel, k]))


@kernel
def paint_rows(
    first: int,
    lens: Array,
    plain: Array,
    depth: Array,
    triangle: Array,
    face_state: Array,
    planes: Array,
    face_geom: Array,
    textures: Array,
    texels: Array,
    rgb: Array,
) -> None:
    """Colour the pixels from row `first` on, one by one."""
    per_px = np.float32(1.0 / lens[0])
    centre_x, centre_y = np.float32(lens[1] - 0.5), np.float32(lens[2] - 0.5)
    for row in range(first, triangle.shape[0]):
        y = (centre_y - np.float32(row)) * per_px
        for column in range(triangle.shape[1]):
            t = triangle[row, column]
            if t < 0:
                for k in range(3):
                    rgb[row, column, k] = plain[1 if t == FLOOR else 0, 0, k]
                continue
            x = (np.float32(column) - centre_x) * per_px
            z, texel = depth[row, column], -1
            if face_state[t] == CONSTANT:
                z = np.float32(1.0)
            if face_state[t] >= TEXTURED:
                u, v = z * linear(planes, t, 3, x, y), z * linear(planes, t, 4, x, y)
                g, level = face_geom[t], face_state[t] - TEXTURED
                texel = texel_row(textures[g, level, 0], textures[g, level, 1], textures[g, level, 2], u, v)
            for k in range(3):
                value = z * linear(planes, t, k, x, y)
                rgb[row, column, k] = byte(value if texel < 0 else value * tint(texels[texel, k]))


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
