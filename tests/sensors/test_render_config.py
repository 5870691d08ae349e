import numpy as np
import pytest

from artiskill.errors import ConfigError
from artiskill.sensors.render_config import load_render_config


def test_both_qualities_load_and_share_their_light():
    fast, picture = load_render_config("fast"), load_render_config()
    assert (fast.quality, picture.quality) == ("fast", "picture")
    assert fast.sun == picture.sun
    assert np.linalg.norm(picture.sun.direction_w) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"quality": "pretty"}, "'picture', 'fast', not 'pretty'"),
        ({"sun.strenght": 1.0}, "did you mean 'strength'"),
        ({"sun.strength": -1.0}, "strength must not be negative"),
        ({"sun.elevation_deg": 0.0}, "elevation_deg"),
        ({"sun.azimuth_deg": float("inf")}, "azimuth_deg"),
        ({"sun.colour": [1.0, 1.0]}, "three numbers"),
        ({"ambient.sky": [1.0, -1.0, 0.0]}, "sky"),
        ({"shadows.resolution": 8}, "resolution"),
        ({"occlusion.strength": 2.0}, "strength"),
        ({"floor.tile_m": 0.0}, "tile_m"),
        ({"floor.contrast": 2.0}, "contrast"),
        ({"floor.fade_end_m": 1.0}, "fade_start_m"),
        ({"background.zenith": [2.0, 0.0, 0.0]}, "background"),
        ({"samples_per_axis": 5}, "samples_per_axis"),
        ({"crease_angle_deg": 181.0}, "crease_angle_deg"),
        ({"max_texture_px": 0}, "max_texture_px"),
    ],
)
def test_illegal_values_are_named(overrides, message):
    with pytest.raises(ConfigError, match=message):
        load_render_config(overrides=overrides)
