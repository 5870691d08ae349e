import numpy as np
import pytest
from numba import njit

from artiskill.sensors.drawing.simd import (
    LANES,
    copy_simd,
    count_equal_simd,
    draw_simd,
    interleave_floats,
    interleave_pixels,
    shade_simd,
)

WIDTH = 3 * LANES


@njit
def draw(inverse_depth, triangle, index, column, count, w_row, dw_dx, t):
    draw_simd(inverse_depth, triangle, index, column, count, (w_row, dw_dx), t)


@njit
def equal(values, index):
    return count_equal_simd(values, index)


@njit
def copy(rgb, index, source, source_index):
    copy_simd(rgb, index, source, source_index)


@njit
def shade(rgb, depth, index, column, y, curved, red, green, blue):
    ray = np.float32(7.5), np.float32(0.01), y, curved
    shade_simd(rgb, depth, index, column, ray, (red, green, blue))


@pytest.mark.parametrize("count", [-3, 0, 1, 7, LANES, LANES + 5])
def test_drawing_is_a_depth_test_per_pixel(rng, count):
    inverse_depth = rng.uniform(0.2, 0.4, (2, WIDTH)).astype(np.float32)
    triangle = np.zeros((2, WIDTH), dtype=np.int32)
    inverse_depth[1, 9] = np.nan  # what is not less is not replaced
    expected, who = inverse_depth.copy(), triangle.copy()
    for column in range(5, 5 + min(count, LANES)):
        w = np.float32(0.1 + column * 0.02)
        if w > expected[1, column]:
            expected[1, column], who[1, column] = w, 8
    draw(inverse_depth, triangle, WIDTH + 5, 5, count, 0.1, 0.02, 8)
    np.testing.assert_array_equal(inverse_depth, expected)
    np.testing.assert_array_equal(triangle, who)


def test_equal_pixels_are_counted_up_to_the_last_lane():
    values = np.repeat(np.array([3, -2, 3, 9], dtype=np.int32), (5, 1, LANES, 2 * LANES)).reshape(-1, 2)
    counts = [equal(values, i) for i in (0, 4, 5, 6, 7, LANES + 6, LANES + 7)]
    assert counts == [5, 1, 1, LANES, LANES - 1, LANES, LANES]


def test_copying_takes_whole_pixels(rng):
    source = rng.integers(0, 256, (2, WIDTH, 3)).astype(np.uint8)
    rgb = np.zeros((2, WIDTH, 3), dtype=np.uint8)
    copy(rgb, WIDTH + 2, source, 4)
    assert (rgb[1, 2 : 2 + LANES] == source[0, 4 : 4 + LANES]).all()
    assert rgb.sum() == rgb[1, 2 : 2 + LANES].sum()


@pytest.mark.parametrize("curved", [0.0, 1.0])
def test_shading_is_the_scalar_formula_bit_for_bit(rng, curved):
    factors = rng.uniform(-150, 250, (3, 3)).astype(np.float32)
    if not curved:
        factors[:, :2] = 0.0  # a colour, not one over depth
    depth = rng.uniform(0.5, 3.0, (2, WIDTH)).astype(np.float32)
    rgb = np.zeros((2, WIDTH, 3), dtype=np.uint8)
    y, columns = np.float32(0.25), np.arange(3, 3 + LANES, dtype=np.float32)
    shade(rgb, depth, WIDTH + 3, 3, y, np.float32(curved), *(tuple(row) for row in factors))
    x = (columns - np.float32(7.5)) * np.float32(0.01)
    z = depth[1, 3 : 3 + LANES] if curved else np.float32(1.0)
    for k, (a, b, c) in enumerate(factors):
        value = z * ((a * x + b * y) + c)
        expected = np.clip(value, np.float32(0), np.float32(255)).astype(np.uint8)
        np.testing.assert_array_equal(rgb[1, 3 : 3 + LANES, k], expected)
    assert rgb.sum() == rgb[1, 3 : 3 + LANES].sum()


@njit
def interleave(out, index, source, first, second, third):
    interleave_floats(out, index, source, first, second, third)


@njit
def interleave_bytes(out, index, source, first, second, third):
    interleave_pixels(out, index, source, first, second, third)


def test_numbers_are_interleaved(rng):
    source = rng.uniform(0, 1, (3, WIDTH)).astype(np.float32)
    out = np.zeros(4 * WIDTH, dtype=np.float32)
    interleave(out, 5, source, 2, WIDTH + 7, 2 * WIDTH)
    expected = np.stack((source[0, 2 : 2 + LANES], source[1, 7 : 7 + LANES], source[2, :LANES]), axis=1)
    np.testing.assert_array_equal(out[5 : 5 + 3 * LANES], expected.reshape(-1))
    assert np.count_nonzero(out) == 3 * LANES


def test_pixels_are_interleaved(rng):
    source = rng.integers(1, 256, (3, WIDTH, 3)).astype(np.uint8)
    out = np.zeros((WIDTH, 3, 3), dtype=np.uint8)
    interleave_bytes(out, 4, source, 1, WIDTH + 3, 2 * WIDTH + 8)
    expected = np.stack((source[0, 1 : 1 + LANES], source[1, 3 : 3 + LANES], source[2, 8 : 8 + LANES]), axis=1)
    np.testing.assert_array_equal(out[4 : 4 + LANES], expected)
    assert np.count_nonzero(out) == 9 * LANES
