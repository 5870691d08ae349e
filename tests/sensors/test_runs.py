import numpy as np

from artiskill.sensors.drawing.backdrop import FLOOR, NOTHING
from artiskill.sensors.drawing.fast_shading import SEEN, UNSEEN, list_runs
from artiskill.sensors.drawing.simd import LANES


def listed(triangle, drawn, faces=9):
    height, width = triangle.shape
    state, seen = np.zeros(faces, np.uint8), np.full(faces, -7, np.int32)
    runs, row_runs = np.zeros((height * width, 2), np.int32), np.zeros(height + 1, np.int32)
    count = list_runs(triangle, drawn, state, seen, runs, row_runs)
    return runs[: row_runs[-1]], row_runs, seen[:count], state


def test_runs_are_the_pixels_with_faces_where_something_was_drawn(rng):
    height, width = 7, 45
    triangle = np.repeat(rng.integers(FLOOR, 9, 200), rng.integers(1, 25, 200))[: height * width]
    triangle = triangle.reshape(height, width).astype(np.int32)
    drawn = np.sort(rng.integers(0, width + 1, (height, 2)), axis=1)
    drawn[3] = 0
    runs, row_runs, seen, state = listed(triangle, drawn)
    columns = np.arange(width)
    expected = (columns >= drawn[:, :1]) & (columns < drawn[:, 1:]) & (triangle >= 0)
    found = np.zeros(height * width, bool)
    for row in range(height):
        for first, count in runs[row_runs[row] : row_runs[row + 1]]:
            assert first // width == row == (first + count - 1) // width
            assert 0 < count <= LANES
            assert len(np.unique(triangle.reshape(-1)[first : first + count])) == 1
            assert not found[first : first + count].any()
            found[first : first + count] = True
    np.testing.assert_array_equal(found.reshape(height, width), expected)
    np.testing.assert_array_equal(np.sort(seen), np.unique(triangle[expected]))
    np.testing.assert_array_equal(np.flatnonzero(state == SEEN), np.unique(triangle[expected]))


def test_nothing_drawn_gives_no_runs():
    triangle = np.full((2, 20), NOTHING, np.int32)
    for end in (0, 20):
        runs, _, seen, state = listed(triangle, np.tile((0, end), (2, 1)))
        assert len(runs) == len(seen) == 0
        assert (state == UNSEEN).all()
