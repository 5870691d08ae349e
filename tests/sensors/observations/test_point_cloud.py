import math

import numpy as np
import pytest

from artiskill.errors import ConfigError
from artiskill.sensors.observations.point_cloud import mask_codes, move_to_frame


def test_at_most_seven_masks() -> None:
    assert mask_codes(np.ones((7, 2), np.bool_)).tolist() == [0, 0, 127, 127]
    with pytest.raises(ConfigError, match="7 masks, not 8"):
        mask_codes(np.ones((8, 2), np.bool_))


def test_moving_to_a_frame_and_back() -> None:
    angle = 0.4
    rotation = np.array(
        ((math.cos(angle), -math.sin(angle), 0.0), (math.sin(angle), math.cos(angle), 0.0), (0.0, 0.0, 1.0))
    )
    origin = np.array((1.0, -2.0, 0.5))
    in_frame = np.random.default_rng(1).normal(size=(20, 3))
    xyz = (in_frame @ rotation.T + origin).astype(np.float32)
    move_to_frame(xyz, origin, rotation)
    np.testing.assert_allclose(xyz, in_frame, atol=1e-6)
