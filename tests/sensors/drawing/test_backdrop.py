"""The floor behind everything: as if computed pixel by pixel, and only where it is asked for."""

import numpy as np
import pytest

from artiskill.sensors.camera import Camera, View
from artiskill.sensors.drawing.backdrop import FLOOR, NOTHING, backdrop_of, fill_box, fill_rest, find_backdrop
from artiskill.sensors.drawing.buffers import allocate_scratch, buffers_at

HEIGHT, WIDTH = 50, 70


def view_of(eye, target, up=(0.0, 0.0, 1.0), far_m=6.0):
    camera = Camera.look_at(eye, target, up, width=WIDTH, height=HEIGHT, far_m=far_m)
    return View(camera.position_w, camera.rotation_w, camera.lens)


VIEWS = {
    "level": view_of((0.3, -0.2, 1.4), (2.0, 1.0, 0.2)),
    "up": view_of((0, 0, 1.0), (1, 0, 2.0)),
    "rolled": view_of((0, 0, 1.4), (2.0, 1.0, 0.9), up=(0.3, 0.9, 0.5)),
    "rolled the other way": view_of((0, 0, 1.4), (2.0, 1.0, 0.9), up=(0.3, -0.9, 0.5)),
    "on its side": view_of((0, 0, 1.4), (2.0, 0.0, 1.4), up=(0.0, 1.0, 0.0)),
    "too near": view_of((0, 0, 0.05), (0, 0, 0)),
    "from below": view_of((0, 0, -1), (1, 0, 1)),
    "hardly above": view_of((0, 0, 1e-320), (1, 0.5, -0.2), up=(0.1, 0.2, 0.9)),
}


def buffers():
    """A view's buffers with what must not be left, and nothing drawn yet."""
    made = buffers_at(allocate_scratch(1, HEIGHT, WIDTH, 0, 0, 0).views, 0)
    made.inverse_depth[:], made.triangle[:] = 7.0, 99
    return made


def expected(view):
    """The analytic floor, pixel by pixel."""
    focal, x, y, near, far = view.lens
    below = view.position[2]
    with np.errstate(all="ignore"):
        scale = 1.0 / (below * focal) if below > 0.0 else np.float64(0.0)
        slope_x, slope_y = -view.rotation[2, 0] * scale, view.rotation[2, 1] * scale
        corner = (0.5 - x) * slope_x + (0.5 - y) * slope_y + view.rotation[2, 2] * focal * scale
        rows = corner + np.arange(HEIGHT)[:, None] * slope_y
        w = (rows + np.arange(WIDTH) * slope_x).astype(np.float32)
    on_floor = (np.float32(1.0 / far) < w) & (w <= np.float32(1.0 / near))
    return np.where(on_floor, w, np.float32(1.0 / far)), np.where(on_floor, FLOOR, NOTHING)


@pytest.mark.parametrize("name", VIEWS)
def test_the_floor_is_the_analytic_one_bit_for_bit(name):
    view = VIEWS[name]
    made = buffers()
    find_backdrop(view, True, made)
    fill_rest(made)
    w, ids = expected(view)
    np.testing.assert_array_equal(made.triangle, ids)
    np.testing.assert_array_equal(made.inverse_depth, w)
    assert (made.drawn == (0, WIDTH)).all()


@pytest.mark.parametrize("name", VIEWS)
def test_what_was_found_is_remembered(name):
    made = buffers()
    for given, kept in zip(find_backdrop(VIEWS[name], True, made), backdrop_of(made), strict=True):
        np.testing.assert_array_equal(given, kept)


@pytest.mark.parametrize("name", ["level", "rolled"])
def test_boxes_are_filled_once_and_hold_all_between(name, rng):
    view = VIEWS[name]
    made = buffers()
    inverse_depth, triangle, drawn = made.inverse_depth, made.triangle, made.drawn
    backdrop = find_backdrop(view, True, made)
    w, ids = expected(view)
    columns = np.arange(WIDTH)
    for _ in range(12):
        x, y = np.sort(rng.uniform(-20, WIDTH + 20, 2)), np.sort(rng.uniform(-20, HEIGHT + 20, 2))
        fill_box(backdrop, (*x, *y), inverse_depth, triangle, drawn)
        inside = (columns >= drawn[:, :1]) & (columns < drawn[:, 1:])
        row, column = np.indices(ids.shape) + 0.5
        assert inside[(row >= y[0]) & (row <= y[1]) & (column >= x[0]) & (column <= x[1])].all()
        np.testing.assert_array_equal(np.where(inside, triangle, ids), ids)
        np.testing.assert_array_equal(np.where(inside, inverse_depth, w), w)
        assert (triangle[~inside] == 99).all(), "what is not asked for is not touched"
    triangle[20, drawn[20, 0]] = 5  # something was drawn there
    kept = drawn[20, 0] < drawn[20, 1]
    fill_rest(made)
    assert not kept or (triangle == 5).sum() == 1


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_boxes_without_end_are_survived(bad):
    made = buffers()
    inverse_depth, triangle, drawn = made.inverse_depth, made.triangle, made.drawn
    backdrop = find_backdrop(VIEWS["level"], True, made)
    fill_box(backdrop, (-abs(bad), bad, bad, -bad), inverse_depth, triangle, drawn)
    fill_box(backdrop, (bad, bad, bad, bad), inverse_depth, triangle, drawn)
    assert ((drawn >= 0) & (drawn <= WIDTH)).all()
