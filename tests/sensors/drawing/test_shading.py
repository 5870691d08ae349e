import math

import numpy as np
import pytest

from artiskill.errors import ConfigError
from artiskill.geometry.primitives import sphere
from artiskill.sensors.camera import Camera
from artiskill.sensors.drawing.shading import lights, point_irradiance
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import Renderer

UP = (0.0, 0.0, 1.0)
ABOVE = Camera.look_at((0, 0, 4), (0, 0, 0), width=61, height=61)
DARK = {"sun.strength": 0.0, "ambient.sky": [0.02] * 3, "ambient.ground": [0.02] * 3, "floor.contrast": 0.0}


def lamp(**changes):
    return {"position_w": [0, 0, 1], "colour": [1, 1, 1], "strength": 1.0, "range_m": 50.0, **changes}


def light_of(*lamps):
    return lights(load_render_config("fast", {"lamps": list(lamps)}))


def picture(visuals, quality, *lamps, camera=ABOVE, **overrides):
    config = load_render_config(quality, {**DARK, "lamps": list(lamps), "occlusion.enabled": False, **overrides})
    return Renderer(visuals, config).render(np.zeros((0, 3)), np.zeros((0, 4)), [camera]).rgb[0].astype(int)


def test_light_falls_with_the_square_and_follows_the_cosine():
    light = light_of(lamp(strength=2.0, colour=[1.0, 0.5, 0.0]))
    np.testing.assert_allclose(point_irradiance((0.0, 0.0, 0.0), UP, light), (2.0, 1.0, 0.0), rtol=1e-5)
    np.testing.assert_allclose(point_irradiance((0.0, 0.0, -1.0), UP, light), (0.5, 0.25, 0.0), rtol=1e-5)
    # 1 m to the side: twice the squared distance, at 45 degrees
    np.testing.assert_allclose(point_irradiance((1.0, 0.0, 0.0), UP, light)[0], math.sqrt(0.5), rtol=1e-5)
    assert point_irradiance((0.0, 0.0, 2.0), UP, light) == (0.0, 0.0, 0.0)  # the lamp is behind the surface


def test_light_ends_smoothly_at_the_range():
    light = light_of(lamp(position_w=[0, 0, 0], range_m=2.0))
    values = [point_irradiance((0.0, 0.0, -d), UP, light)[0] for d in np.linspace(0.5, 2.2, 50)]
    assert (np.diff(values) <= 0).all()
    assert values[-1] == 0.0
    assert 0 < point_irradiance((0.0, 0.0, -1.98), UP, light)[0] < 1e-3


def test_lamps_add_up_and_stay_finite():
    one, two = lamp(), lamp(position_w=[1, 0, 1])
    place = (0.3, 0.2, 0.0)
    total = np.array(point_irradiance(place, UP, light_of(one, two)))
    parts = [np.array(point_irradiance(place, UP, light_of(single))) for single in (one, two)]
    np.testing.assert_allclose(total, parts[0] + parts[1], rtol=1e-12)
    assert np.isfinite(point_irradiance((0.0, 0.0, 1.0), UP, light_of(one))).all()  # in the lamp itself
    assert max(point_irradiance((0.0, 0.0, 1.0 - 1e-9), UP, light_of(one))) < 1000


@pytest.mark.parametrize("quality", ["fast", "picture"])
def test_the_floor_is_brightest_below_the_lamp(quality):
    rgb = picture([], quality, lamp(position_w=[0, 0, 0.5]))
    middle, corner = rgb[30, 30], rgb[2, 2]
    assert middle.min() > corner.max() + 60
    np.testing.assert_array_equal(picture([], quality, lamp(range_m=0.5)), picture([], quality))  # out of reach


@pytest.mark.parametrize("quality", ["fast", "picture"])
def test_a_ball_is_lit_from_the_lamps_side(make, quality):
    ball = make.visual(sphere(0.4, 48, 24).transformed((0, 0, 0.6)), colour=(0.7, 0.7, 0.7), shininess=0.0)
    camera = Camera.look_at((-3, 0, 0.6), (0, 0, 0.6), width=80, height=60)
    without = picture([ball], quality, camera=camera)
    rgb = picture([ball], quality, lamp(position_w=[-1, 1.5, 0.6], colour=[1, 0, 0]), camera=camera)
    left, right = rgb[30, 34], rgb[30, 46]  # +y is to the left
    assert left[0] > right[0] + 20
    gained = rgb[25:35, 35:45] - without[25:35, 35:45]
    assert gained[..., 0].mean() > 10
    assert np.abs(gained[..., 1:]).max() <= 1  # red light


@pytest.mark.parametrize("quality", ["fast", "picture"])
def test_both_qualities_agree_on_the_floor(quality):
    """Within what a picture's antialiasing and rounding may differ."""
    rgb = [picture([], q, lamp(strength=0.6)) for q in ("fast", quality)]
    assert np.abs(rgb[0] - rgb[1]).max() <= 2


def test_turned_camera_sees_the_same_light(make):
    """Lit points are placed in the world, whatever the camera."""
    ball = make.visual(sphere(0.4, 48, 24).transformed((0, 0, 0.6)), colour=(0.7, 0.7, 0.7))
    cameras = [
        Camera.look_at((-3, 0, 0.6), (0, 0, 0.6), (0, s, c), width=81, height=81)
        for s, c in ((0.0, 1.0), (1.0, 0.0))
    ]
    upright, turned = (
        picture([ball], "fast", lamp(position_w=[-1, 1.5, 0.6]), camera=c, **{"floor.enabled": False})
        for c in cameras
    )
    assert np.abs(np.rot90(upright, -1) - turned)[20:61, 20:61].max() <= 6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"position_w": [0, 0]}, "position_w"),
        ({"position_w": [0, 0, math.nan]}, "position_w"),
        ({"colour": [1, -1, 0]}, "colour"),
        ({"strength": -1}, "strength"),
        ({"range_m": 0}, "range_m"),
        ({"range": 1}, "unknown key 'range'; did you mean 'range_m'"),
    ],
)
def test_bad_lamps_are_named(change, message):
    with pytest.raises(ConfigError, match=message):
        load_render_config("fast", {"lamps": [lamp(**change)]})
