"""Signed distances to collision shapes, against closed forms and against the drawn mesh of the same shape."""

import numpy as np
import pytest

from artiskill.assets.articulated_object import CollisionShape
from artiskill.checks.surfaces import CollisionSurface
from artiskill.geometry.primitives import box
from artiskill.geometry.rotations import quat_from_rpy, transform_points

TURN = quat_from_rpy((0.3, -0.5, 1.1))
PLACE = np.array((0.2, -0.1, 0.4))


def placed(kind: str, size: tuple[float, ...], vertices: np.ndarray | None = None) -> CollisionSurface:
    return CollisionSurface([CollisionShape(kind, size, PLACE, TURN, vertices)])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("kind", "size", "point", "expected"),
    [
        ("box", (0.1, 0.2, 0.3), (0.1 + 0.03, 0.2 + 0.04, 0), 0.05),
        ("box", (0.1, 0.2, 0.3), (0.09, 0, 0), -0.01),
        ("sphere", (0.1,), (0, 0.06, 0.08 + 0.05), np.hypot(0.06, 0.13) - 0.1),
        ("cylinder", (0.1, 0.2), (0.13, 0, 0.24), 0.05),
        ("cylinder", (0.1, 0.2), (0.05, 0, 0.19), -0.01),
        ("capsule", (0.1, 0.2), (0, 0, 0.32), 0.02),
        ("capsule", (0.1, 0.2), (0.04, 0, 0.1), -0.06),
    ],
)
def test_primitives(kind: str, size: tuple[float, ...], point: tuple[float, ...], expected: float) -> None:
    world = transform_points(PLACE, TURN, np.array([point]))
    assert placed(kind, size).signed_distances(world)[0] == pytest.approx(expected)


def test_a_hull_is_a_box_of_the_same_corners(rng: np.random.Generator) -> None:
    half = (0.1, 0.2, 0.3)
    points = rng.uniform(-0.8, 0.8, (200, 3))
    hull = placed("hull", (), box(half).vertices)
    np.testing.assert_allclose(
        hull.signed_distances(points), placed("box", half).signed_distances(points), atol=1e-9
    )


def test_samples_lie_on_the_outside(rng: np.random.Generator) -> None:
    identity = np.array((1.0, 0, 0, 0))
    first = CollisionShape("box", (0.1, 0.1, 0.1), np.zeros(3), identity)
    second = CollisionShape("box", (0.1, 0.1, 0.1), np.array((0.1, 0, 0)), identity)
    samples = CollisionSurface([first, second]).samples(500, rng)
    assert 300 < len(samples) < 500
    assert np.abs(CollisionSurface([first, second]).signed_distances(samples)).max() < 0.0021


def test_nothing_is_far_from_no_shapes() -> None:
    assert np.isinf(CollisionSurface([]).signed_distances(np.zeros((2, 3)))).all()
