import numpy as np
import pytest

from artiskill.sensors.camera import Camera
from artiskill.sensors.drawing.scene_tables import MIP_LEVELS, pack_textures
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import Renderer

NOWHERE = np.zeros((0, 3)), np.zeros((0, 4))


def checker(size: int) -> np.ndarray:
    squares = (np.indices((size, size)).sum(axis=0) % 2 * 255).astype(np.uint8)
    return np.repeat(squares[..., None], 3, axis=2)


def test_versions_halve_and_keep_the_mean(make, rng):
    texture = rng.integers(0, 256, (40, 16, 3)).astype(np.uint8)
    visual = make.visual(make.sheet(), texture=texture).visual
    rows, texels = pack_textures([visual, visual], 1000)
    sizes = [(40, 16), (20, 8), (10, 4), (5, 2), (2, 1), (1, 1)]
    assert rows.shape == (2, MIP_LEVELS, 3)
    assert rows[0, :, 1:].tolist() == [list(s) for s in sizes + [(1, 1)] * (MIP_LEVELS - len(sizes))]
    np.testing.assert_array_equal(rows[0], rows[1])
    assert len(texels) == sum(h * w for h, w in sizes)
    for first, height, width in rows[0]:
        mean = texels[first : first + height * width].mean(axis=0)
        np.testing.assert_allclose(mean, texture.mean(axis=(0, 1)), atol=5)  # each halving rounds


def test_who_has_no_texture_has_no_texels(make):
    rows, texels = pack_textures([make.visual(make.sheet()).visual], 64)
    assert not rows.any()
    assert texels.shape == (0, 3)


@pytest.mark.parametrize("quality", ["fast", "picture"])
def test_a_fine_pattern_is_grey_from_afar_and_crisp_from_nearby(make, quality):
    """A texel that is much smaller than a pixel must not decide about it: the picture would be noise."""
    sheet = make.visual(make.sheet(0.5), texture=checker(256), colour=(1, 1, 1), shininess=0.0)
    config = load_render_config(quality, {"floor.enabled": False, "occlusion.enabled": False})
    spread = {}
    for distance in (0.12, 2.5):
        camera = Camera.look_at((-distance, 0.0371, 0.0153), (0, 0.0371, 0.0153), width=64, height=48, near_m=0.01)
        images = Renderer([sheet], config).render(*NOWHERE, [camera], ("rgb", "geom"))
        rows, columns = np.nonzero(images.geom[0] == 0)
        inner = images.rgb[0, rows.min() + 2 : rows.max() - 1, columns.min() + 2 : columns.max() - 1, 0]
        assert inner.size > 50
        spread[distance] = inner.astype(float).std()
    assert spread[2.5] < 0.2 * spread[0.12]


def test_a_textured_face_through_the_near_plane_is_drawn(make):
    sheet = make.visual(make.sheet(0.5), texture=checker(64))
    camera = Camera.look_at((-0.05, 0, 0.3), (0.3, 0.2, 0), width=64, height=48, near_m=0.1)
    images = Renderer([sheet], load_render_config("fast")).render(*NOWHERE, [camera], ("rgb", "geom"))
    assert (images.geom == 0).any()
