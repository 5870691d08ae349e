"""Motions of the hand: curves keep their speed and never lead away."""

import numpy as np
import pytest

from artiskill.experts.frames import axis_rotation, cross, curved, rotation_error
from artiskill.geometry.rotations import quat_from_axis_angle, quat_to_matrix


def test_no_curve_changes_no_bit() -> None:
    velocity = np.array((0.3, -0.1234567))
    assert curved(velocity, 0.0).tobytes() == velocity.tobytes()


@pytest.mark.parametrize("angle", [-5.0, -0.3, 0.3, 5.0])
def test_a_curve_keeps_the_speed_and_comes_nearer(angle: float) -> None:
    velocity = np.array((0.3, -0.1))
    turned = curved(velocity, angle)
    assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(velocity))
    assert turned @ velocity > 0
    across = velocity[0] * turned[1] - velocity[1] * turned[0]
    assert np.sign(across) == np.sign(angle), "counter-clockwise"


@pytest.mark.parametrize("angle_rad", [0.0, 1e-9, 1e-5, 1e-4, 0.3, 2.0, 3.0, np.pi - 1e-5, np.pi - 1e-9])
def test_an_error_is_the_rotation_vector_that_mends_it(angle_rad: float, rng: np.random.Generator) -> None:
    """Against the quaternions of `geometry`."""
    for _ in range(10):
        axis = rng.normal(size=3)
        current = axis_rotation(rng.normal(size=3), rng.uniform(-3, 3))
        np.testing.assert_allclose(
            axis_rotation(axis, angle_rad), quat_to_matrix(quat_from_axis_angle(axis, angle_rad)), atol=1e-14
        )
        found = rotation_error(current, axis_rotation(axis, angle_rad) @ current)
        np.testing.assert_allclose(found, angle_rad * axis / np.linalg.norm(axis), atol=1e-9)


def test_a_cross_product_has_the_bits_of_numpys() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        a, b = rng.normal(size=(2, 3)) * 10 ** rng.uniform(-5, 5, (2, 1))
        assert cross(a, b).tobytes() == np.cross(a, b).tobytes()
