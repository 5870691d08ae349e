import numpy as np
import pytest

from artiskill.sensors.paint import CONSTANT, LINEAR, TEXTURED, paint_rows, paint_runs, paint_textures
from artiskill.sensors.rasterise import FLOOR

FACES = 6
MARGIN = 64  # bytes after the image, which nothing may touch


def random_view(rng, height, width):
    """What the kernels read, with faces of all kinds in runs of all lengths."""
    lengths = rng.integers(1, 40, height * width)
    triangle = np.repeat(rng.integers(FLOOR, FACES, len(lengths)), lengths)[: height * width]
    state = np.array([CONSTANT, LINEAR, TEXTURED, LINEAR, TEXTURED + 1, CONSTANT], dtype=np.uint8)
    planes = rng.uniform(-90, 160, (FACES, 5, 3)).astype(np.float32)
    planes[state == CONSTANT, :3, :2] = 0.0
    return (
        np.array([80.0, width / 2, height / 2, 0.05, 10.0]),
        np.repeat(rng.integers(0, 256, (2, 1, 3)), width, axis=1).astype(np.uint8),
        rng.uniform(0.2, 4.0, (height, width)).astype(np.float32),
        triangle.reshape(height, width).astype(np.int32),
        state,
        planes,
    )


@pytest.mark.parametrize(
    ("height", "width"), [(1, 1), (40, 1), (9, 5), (3, 15), (3, 16), (5, 17), (4, 33), (1, 70), (30, 40)]
)
def test_runs_and_single_pixels_give_the_same_bits(rng, height, width):
    lens, plain, depth, triangle, state, planes = random_view(rng, height, width)
    face_geom = np.array([0, 0, 1, 0, 1, 0], dtype=np.int32)
    textures = np.array([[[0, 0, 0], [0, 0, 0]], [[0, 4, 4], [16, 2, 2]]])
    texels = rng.integers(0, 256, (20, 3)).astype(np.uint8)
    seen = depth, triangle, state, planes
    looks = face_geom, textures, texels

    expected = np.zeros((height, width, 3), dtype=np.uint8)
    paint_rows(0, lens, plain, *seen, *looks, expected)

    memory = np.full(height * width * 3 + MARGIN, 77, dtype=np.uint8)
    rgb = memory[:-MARGIN].reshape(height, width, 3)
    runs = np.zeros((height * width, 2), dtype=np.int32)
    rows, textured = paint_runs(lens, plain, *seen, runs, rgb)
    assert rows < height
    paint_textures(runs[:textured], lens, *seen, *looks, rgb)
    paint_rows(rows, lens, plain, *seen, *looks, rgb)

    np.testing.assert_array_equal(rgb, expected)
    assert (memory[-MARGIN:] == 77).all()
    assert len(np.unique(rgb)) > 1 or height * width == 1
