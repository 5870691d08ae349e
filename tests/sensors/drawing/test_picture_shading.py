import numpy as np
import pytest

from artiskill.assets.articulated_object import ROOM_WALL
from artiskill.geometry.primitives import box
from artiskill.sensors.camera import Camera
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import Renderer

ABOVE = Camera.look_at((0, 0, 4), (0, 0, 0), width=80, height=80)  # image up is +x, image right is -y
PLAIN = {"floor.contrast": 0.0, "occlusion.enabled": False}


def picture(visuals, camera, overrides=None):
    renderer = Renderer(visuals, load_render_config("picture", {**PLAIN, **(overrides or {})}))
    return renderer.render(np.zeros((0, 3)), np.zeros((0, 4)), [camera]).rgb[0].astype(int)


def pixel(x, y):
    """Row and column under which ABOVE sees the floor at (x, y)."""
    p = ABOVE.intrinsics @ (ABOVE.extrinsics @ np.array([x, y, 0.0, 1.0]))[:3]
    return int(p[1] / p[2]), int(p[0] / p[2])


@pytest.fixture
def plate(make):
    """A thin plate 1 m above the floor; with the sun at 45 degrees in +x its shadow is 1 m away in -x."""
    return make.visual(box((0.15, 0.15, 0.01)).transformed((0.5, 0, 1)))


SUN = {"sun.azimuth_deg": 0.0, "sun.elevation_deg": 45.0}


def test_shadow_falls_where_geometry_says(plate):
    rgb = picture([plate], ABOVE, SUN)
    lit = rgb[pixel(-0.5, 0.6)].sum()
    assert rgb[pixel(-0.5, 0.0)].sum() < 0.8 * lit
    for x, y in ((-0.8, 0.0), (-0.2, 0.0), (-0.5, 0.3), (-0.5, -0.3)):
        assert rgb[pixel(x, y)].sum() == pytest.approx(lit, rel=0.02)
    without = picture([plate], ABOVE, {**SUN, "shadows.enabled": False})
    assert without[pixel(-0.5, 0.0)].sum() == pytest.approx(lit, rel=0.02)


def test_a_wall_of_the_room_receives_shadows_and_casts_none(make, plate):
    """It would make the map coarse that all shadows are looked up in: the plate's stay what they are."""
    wall = make.visual(box((0.1, 6.0, 0.5)).transformed((-1.6, 0, 0.5)), part=ROOM_WALL)
    alone, both = picture([plate], ABOVE, SUN), picture([plate, wall], ABOVE, SUN)
    low, high = pixel(-1.3, 0)[0], pixel(1.6, 0)[0]
    np.testing.assert_array_equal(both[high:low], alone[high:low])
    sunny = {**SUN, "sun.azimuth_deg": 180.0}  # from behind it
    np.testing.assert_array_equal(picture([wall], ABOVE, sunny)[high:low], picture([], ABOVE, sunny)[high:low])
    front = Camera.look_at((3, 0, 0.5), (0, 0, 0.5), width=80, height=80)
    near = make.visual(box((0.01, 0.2, 0.2)).transformed((-1.2, 0, 0.9)))  # its shadow falls on the wall's face
    face = picture([near, wall], front, SUN)
    p = front.intrinsics @ (front.extrinsics @ np.array([-1.5, 0.0, 0.6, 1.0]))[:3]
    row, column = int(p[1] / p[2]), int(p[0] / p[2])
    assert face[row, column].sum() < 0.8 * face[row, column + 12].sum()


def test_shadow_edges_are_soft(plate):
    line = [picture([plate], ABOVE, {**SUN, "shadows.softness_m": s}) for s in (0.0, 0.2)]
    _, column = pixel(-0.5, 0.0)
    low, high = pixel(-0.2, 0)[0], pixel(-0.8, 0)[0]
    distinct = [len(np.unique(rgb[low:high, column, 0])) for rgb in line]
    assert distinct[1] > distinct[0]


def test_lit_surfaces_do_not_shade_themselves(little_scene):
    """With the sun behind the camera a convex body shows no shadow: the picture is the one without shadows."""
    alone = [little_scene.visuals[0]]
    poses = little_scene.positions_w[:1], little_scene.quaternions_w[:1]
    camera = Camera.look_at((-2, -1.5, 2), (0, 0, 0.6), width=160, height=120)
    a, b = (
        Renderer(alone, load_render_config("picture", {**PLAIN, "shadows.enabled": on}))
        .render(*poses, [camera], ("rgb", "geom"))
        for on in (True, False)
    )  # fmt: skip
    difference = np.abs(a.rgb.astype(int) - b.rgb).max(axis=-1)[a.geom == 0]
    assert (difference > 2).mean() < 0.01


def test_ambient_light_is_dimmer_under_a_roof(make):
    roof = make.visual(box((1.0, 1.0, 0.01)).transformed((0, 0, 0.5)))
    under = Camera.look_at((-0.9, 0, 0.3), (0, 0, 0), width=40, height=40)
    dark = {"sun.strength": 0.0, "occlusion.enabled": True}
    assert picture([roof], under, dark)[20, 20].sum() < 0.7 * picture([], under, dark)[20, 20].sum()


def test_edges_are_antialiased(make):
    tilted = make.visual(
        make.sheet(0.4).transformed((0, 0, 1), (np.cos(0.1), np.sin(0.1), 0, 0)), colour=(0, 0, 0), shininess=0.0
    )
    camera = Camera.look_at((-2, 0, 1), (0, 0, 1), width=64, height=64)
    grey = {"background.horizon": [1, 1, 1], "background.zenith": [1, 1, 1], "floor.enabled": False}
    shades = [len(np.unique(picture([tilted], camera, {**grey, "samples_per_axis": s}))) for s in (1, 2, 4)]
    assert shades[0] == 2  # the sheet and the background
    assert shades[0] < shades[1] < shades[2]


def test_floor_shows_tiles_near_and_melts_into_the_horizon_far_away():
    camera = Camera.look_at((0, 0, 1.2), (3, 0, 0.9), width=120, height=90, far_m=200)
    renderer = Renderer([], load_render_config("picture", {"floor.contrast": 0.5}))
    images = renderer.render(np.zeros((0, 3)), np.zeros((0, 4)), [camera], ("rgb", "position_w", "geom"))
    rgb, distance = images.rgb[0].astype(int), np.linalg.norm(images.position_w[0][..., :2], axis=-1)
    floor = images.geom[0] == -2
    near, far = rgb[floor & (distance < 2)], rgb[floor & (distance > 12)]
    assert near[:, 0].std() > 8
    horizon = np.round(np.array(renderer.config.background.horizon) * 255)
    assert np.abs(far - horizon).max() <= 1


def test_a_state_without_anything_in_view_is_the_background():
    camera = Camera.look_at((0, 0, 1), (0.001, 0, 2), width=6, height=4)
    rgb = picture([], camera)
    zenith = np.round(np.array(load_render_config().background.zenith) * 255)
    assert np.abs(rgb - zenith).max() <= 1
