import numpy as np
import pytest

from artiskill.sensors.drawing.backdrop import FLOOR, NOTHING
from artiskill.sensors.drawing.fast_shading import (
    CONSTANT,
    LINEAR,
    TEXTURED,
    list_runs,
    paint_pixel,
    paint_rows,
    paint_textures,
)
from artiskill.sensors.drawing.simd import LANES

FACES = 6
MARGIN = 64  # bytes after what may be written, which nothing may touch


def random_view(rng, height, width):
    """What the kernels read, with faces of all kinds in runs of all lengths before floor and nothing."""
    lengths = rng.integers(1, 40, height * width)
    shown = np.repeat(rng.integers(-2, FACES, len(lengths)), lengths)[: height * width].reshape(height, width)
    floor = np.sort(rng.integers(0, width + 1, (height, 2)), axis=1)
    floor[::3] = 0, width
    columns = np.arange(width)
    behind = np.where((columns >= floor[:, :1]) & (columns < floor[:, 1:]), FLOOR, NOTHING)
    triangle = np.where(shown < 0, behind, shown).astype(np.int32)
    state = np.array([CONSTANT, LINEAR, TEXTURED, LINEAR, TEXTURED + 1, CONSTANT], dtype=np.uint8)
    planes = rng.uniform(-90, 160, (FACES, 5, 3)).astype(np.float32)
    planes[state == CONSTANT, :3, :2] = 0.0
    depth = rng.uniform(0.2, 4.0, (height, width)).astype(np.float32)
    return np.array([80.0, width / 2, height / 2, 0.05, 10.0]), floor, depth, triangle, state, planes


@pytest.mark.parametrize(
    ("height", "width"), [(1, 1), (40, 1), (9, 5), (3, 15), (3, 16), (5, 17), (4, 33), (1, 70), (30, 40)]
)
def test_runs_and_single_pixels_give_the_same_bits(rng, height, width):
    lens, floor, depth, triangle, state, planes = random_view(rng, height, width)
    face_geom = np.array([0, 0, 1, 0, 1, 0], dtype=np.int32)
    textures = np.array([[[0, 0, 0], [0, 0, 0]], [[0, 4, 4], [16, 2, 2]]])
    texels = rng.integers(0, 256, (20, 3)).astype(np.uint8)
    plain = rng.integers(0, 256, (2, 3)).astype(np.uint8)

    per_px = np.float32(1.0 / lens[0])
    expected = plain[(triangle == FLOOR).astype(int)]
    for row, column in np.argwhere(triangle >= 0):
        x = (np.float32(column) - np.float32(lens[1] - 0.5)) * per_px
        y = (np.float32(lens[2] - 0.5) - np.float32(row)) * per_px
        t = triangle[row, column]
        seen = x, y, depth[row, column], t, state, planes, face_geom, textures, texels
        paint_pixel(column, *seen, expected[row])

    drawn = np.tile((0, width), (height, 1))
    runs, row_runs = np.zeros((height * width, 2), dtype=np.int32), np.zeros(height + 1, dtype=np.int32)
    list_runs(triangle, drawn, np.zeros(FACES, np.uint8), np.zeros(FACES, np.int32), runs, row_runs)
    top = height // 3
    for first, rows in ((0, height), (top, height - top), (0, max(1, top))):
        memory = np.full((rows * width + LANES) * 3 + MARGIN, 77, dtype=np.uint8)
        rgb = memory[:-MARGIN].reshape(-1, 3)
        near = np.append(depth[first : first + rows].reshape(-1), np.ones(LANES, np.float32))
        textured = np.zeros(height * width, dtype=np.int32)
        of_runs = near, triangle, state, planes
        left = paint_rows(first, rows, lens, plain, floor, runs, row_runs, *of_runs, textured, rgb)
        paint_textures(first, lens, runs, textured[:left], *of_runs, face_geom, textures, texels, rgb)
        painted = rgb[: rows * width].reshape(rows, width, 3)
        np.testing.assert_array_equal(painted, expected[first : first + rows])
        assert (memory[-MARGIN:] == 77).all()
    assert len(np.unique(expected)) > 1 or height * width == 1
