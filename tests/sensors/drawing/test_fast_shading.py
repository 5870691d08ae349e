import numpy as np
import pytest

from artiskill.sensors.drawing.backdrop import FLOOR, NOTHING
from artiskill.sensors.drawing.buffers import allocate_scratch, buffers_at
from artiskill.sensors.drawing.fast_shading import (
    CONSTANT,
    LINEAR,
    SEEN,
    TEXTURED,
    UNSEEN,
    forget_faces,
    list_faces,
    list_runs,
    paint_pixels,
    paint_rows,
    paint_textures,
)
from artiskill.sensors.drawing.scene_tables import build_scene_tables
from artiskill.sensors.drawing.simd import LANES

FACES = 6
MARGIN = 64  # bytes after what may be written, which nothing may touch


def buffers_of(triangle, drawn, faces=9):
    made = buffers_at(allocate_scratch(1, *triangle.shape, 0, faces, 0).views, 0)
    made.triangle[:], made.drawn[:] = triangle, drawn
    return made


def test_runs_are_the_pixels_with_faces_where_something_was_drawn(rng):
    height, width = 7, 45
    triangle = np.repeat(rng.integers(FLOOR, 9, 200), rng.integers(1, 25, 200))[: height * width]
    triangle = triangle.reshape(height, width).astype(np.int32)
    drawn = np.sort(rng.integers(0, width + 1, (height, 2)), axis=1)
    drawn[3] = 0
    made = buffers_of(triangle, drawn)
    list_runs(made)
    columns = np.arange(width)
    expected = (columns >= drawn[:, :1]) & (columns < drawn[:, 1:]) & (triangle >= 0)
    found = np.zeros(height * width, bool)
    for row in range(height):
        for first, count in made.runs[made.row_runs[row] : made.row_runs[row + 1]]:
            assert first // width == row == (first + count - 1) // width
            assert 0 < count <= LANES
            assert len(np.unique(triangle.reshape(-1)[first : first + count])) == 1
            assert not found[first : first + count].any()
            found[first : first + count] = True
    np.testing.assert_array_equal(found.reshape(height, width), expected)
    np.testing.assert_array_equal(np.sort(made.seen[: made.face_count[0]]), np.unique(triangle[expected]))
    np.testing.assert_array_equal(np.flatnonzero(made.face_state == SEEN), np.unique(triangle[expected]))
    forget_faces(made)
    assert (made.face_state == UNSEEN).all()


def test_nothing_drawn_gives_no_runs():
    triangle = np.full((2, 20), NOTHING, np.int32)
    for end in (0, 20):
        made = buffers_of(triangle, (0, end))
        list_runs(made)
        assert made.row_runs[-1] == made.face_count[0] == 0
        assert (made.face_state == UNSEEN).all()


def test_faces_of_some_pixels_are_listed_once(rng):
    triangle = rng.integers(0, 9, (5, 8)).astype(np.int32)
    made = buffers_of(triangle, (0, 8))
    pixels = rng.choice(120, 50, replace=False).astype(np.int32)
    list_faces(1, pixels, made)
    own = pixels[(pixels >= 40) & (pixels < 80)] - 40
    np.testing.assert_array_equal(np.sort(made.seen[: made.face_count[0]]), np.unique(triangle.reshape(-1)[own]))


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
    inverse_depth = rng.uniform(0.25, 5.0, (height, width)).astype(np.float32)
    return np.array([80.0, width / 2, height / 2, 0.05, 10.0]), floor, inverse_depth, triangle, state, planes


@pytest.mark.parametrize(
    ("height", "width"), [(1, 1), (40, 1), (9, 5), (3, 15), (3, 16), (5, 17), (4, 33), (1, 70), (30, 40)]
)
def test_runs_and_single_pixels_give_the_same_bits(rng, height, width):
    lens, floor, inverse_depth, triangle, state, planes = random_view(rng, height, width)
    scene = build_scene_tables([], 0.7, 64)._replace(
        face_geom=np.array([0, 0, 1, 0, 1, 0], dtype=np.int32),
        textures=np.array([[[0, 0, 0], [0, 0, 0]], [[0, 4, 4], [16, 2, 2]]]),
        texels=rng.integers(0, 256, (20, 3)).astype(np.uint8),
    )
    plain = rng.integers(0, 256, (2, 3)).astype(np.uint8)

    made = buffers_of(triangle, (0, width), FACES)
    list_runs(made)
    made.inverse_depth[:], made.floor[:] = inverse_depth, floor
    made.face_state[:], made.face_planes[:] = state, planes

    expected = plain[(triangle == FLOOR).astype(int)]
    pixels = np.flatnonzero(triangle >= 0).astype(np.int32)
    chosen = np.empty((len(pixels), 3), np.uint8)
    paint_pixels(0, pixels, lens, scene, made, chosen)
    expected.reshape(-1, 3)[pixels] = chosen

    depth = np.float32(1.0) / inverse_depth
    top = height // 3
    for first, rows in ((0, height), (top, height - top), (0, max(1, top))):
        memory = np.full((rows * width + LANES) * 3 + MARGIN, 77, dtype=np.uint8)
        rgb = memory[:-MARGIN].reshape(-1, 3)
        near = np.append(depth[first : first + rows].reshape(-1), np.ones(LANES, np.float32))
        textured = np.zeros(height * width, dtype=np.int32)
        left = paint_rows(first, rows, lens, plain, made, textured, near, rgb)
        paint_textures(first, lens, scene, made, textured[:left], near, rgb)
        painted = rgb[: rows * width].reshape(rows, width, 3)
        np.testing.assert_array_equal(painted, expected[first : first + rows])
        assert (memory[-MARGIN:] == 77).all()
    assert len(np.unique(expected)) > 1 or height * width == 1
