"""Motions of the hand: curves keep their speed and never lead away."""

import numpy as np
import pytest

from artiskill.experts.frames import curved


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
