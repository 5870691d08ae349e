"""Distances to triangles and meshes, against closed forms."""

import pickle

import numpy as np
import pytest

from artiskill.geometry.primitives import box, sphere
from artiskill.geometry.surfaces import make_surface, point_triangle_distance

TRIANGLE = np.array(((0.0, 0, 0), (1, 0, 0), (0, 1, 0)))


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((0.2, 0.2, 0.5), 0.5),  # over the inside
        ((0.2, 0.2, 0.0), 0.0),
        ((0.5, -0.3, 0.4), 0.5),  # beside an edge
        ((2.0, 0.0, 0.0), 1.0),  # beyond a corner
        ((1.0, 1.0, 0.0), np.sqrt(0.5)),  # beside the long edge
    ],
)
def test_one_triangle(point: tuple[float, ...], expected: float) -> None:
    assert point_triangle_distance(np.array(point), TRIANGLE) == pytest.approx(expected)
    assert point_triangle_distance(np.array(point), TRIANGLE[::-1]) == pytest.approx(expected)


def test_a_triangle_without_area_is_a_segment() -> None:
    needle = np.array(((0.0, 0, 0), (1, 0, 0), (1, 0, 0)))
    assert point_triangle_distance(np.array((0.5, 0.2, 0)), needle) == pytest.approx(0.2)


def test_meshes(rng: np.random.Generator) -> None:
    surface = make_surface(box((0.3, 0.4, 0.5)), 3000, rng)
    points = rng.uniform(-1, 1, (300, 3))
    outside = np.maximum(np.abs(points) - (0.3, 0.4, 0.5), 0)
    far = np.linalg.norm(outside, axis=1) > 0
    np.testing.assert_allclose(surface.distances(points)[far], np.linalg.norm(outside, axis=1)[far], atol=0.01)
    again = pickle.loads(pickle.dumps(surface))
    np.testing.assert_array_equal(again.distances(points), surface.distances(points))


def test_samples_are_even(rng: np.random.Generator) -> None:
    surface = make_surface(sphere(1.0, 48, 25), 4000, rng)
    assert (surface.samples[:, 2] > 0).mean() == pytest.approx(0.5, abs=0.01)
    np.testing.assert_allclose(np.linalg.norm(surface.samples, axis=1), 1.0, atol=0.01)
