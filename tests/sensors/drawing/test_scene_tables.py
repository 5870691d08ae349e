import numpy as np
import pytest

from artiskill.errors import AssetError
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import box, sphere
from artiskill.sensors.camera import Camera
from artiskill.sensors.drawing.scene_tables import (
    MIP_LEVELS,
    build_scene_tables,
    have_opposite_faces,
    pack_textures,
)
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import Renderer


def build(*visuals, max_px=512):
    return build_scene_tables(visuals, np.radians(40), max_px)


def test_ids_follow_the_order_of_the_visuals(make):
    tables = build(make.visual(box((1, 1, 1)), 4), make.visual(sphere(0.1), -1), make.visual(make.sheet(), 2))
    counts = np.bincount(tables.face_geom)
    assert counts.tolist() == [12, len(sphere(0.1).faces), 2]
    assert tables.geom_body.tolist() == [4, -1, 2]
    assert tables.geom_body_id.tolist() == [4, -2, 2]
    assert [bool(tables.two_sided[tables.face_geom == g][0]) for g in range(3)] == [False, False, True]
    assert np.diff(tables.geom_vertices).tolist() == [len(box((1, 1, 1)).vertices), len(sphere(0.1).vertices), 4]
    np.testing.assert_allclose(tables.vertices[tables.faces[-2:]], make.sheet().vertices[make.sheet().faces])


def test_shared_textures_are_stored_once_and_large_ones_shrunk(make):
    texture = np.full((40, 20, 3), 7, dtype=np.uint8)
    tables = build(
        make.visual(make.sheet(), texture=texture),
        make.visual(make.sheet(), texture=texture),
        make.visual(make.sheet()),
        max_px=10,
    )
    assert tables.textures[:, 0].tolist() == [[0, 10, 5], [0, 10, 5], [0, 0, 0]]
    assert tables.texels.shape == (10 * 5 + 5 * 2 + 2 * 1 + 1, 3)
    assert (tables.texels == 7).all()


def test_a_texture_without_coordinates_is_not_used(make):
    tables = build(make.visual(box((1, 1, 1)), texture=np.zeros((4, 4, 3), dtype=np.uint8)))
    assert tables.textures[0, 0, 1] == 0


def test_nothing_at_all_is_legal():
    tables = build()
    assert tables.faces.shape == (0, 3)
    assert tables.face_rows.shape == (0, 8)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (lambda make: make.visual(box((1, 1, 1)), -2), "body index"),
        (lambda make: make.visual(TriMesh(np.full((3, 3), np.nan), np.array([[0, 1, 2]]))), "not finite"),
        (lambda make: make.visual(TriMesh(np.zeros((3, 3)), np.array([[0, 1, 3]]))), "outside 0 .. 2"),
        (lambda make: make.visual(make.sheet(), texture=np.zeros((4, 4, 4), dtype=np.uint8)), "uint8"),
        (lambda make: make.visual(make.sheet(), texture=np.zeros((4, 4, 3))), "uint8"),
        (lambda make: make.visual(make.sheet(), colour=(0, np.nan, 0)), "material"),
    ],
)
def test_what_cannot_be_drawn_is_named(make, bad, message):
    with pytest.raises(AssetError, match=message):
        build(make.visual(make.sheet()), bad(make))


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


PLACES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=float)
WORLD = np.zeros(7, dtype=np.int32)


@pytest.mark.parametrize(
    ("faces", "expected"),
    [
        ([[0, 1, 2], [2, 1, 0]], [True, True]),
        ([[0, 1, 2], [4, 6, 5]], [True, True]),  # other vertices at the same places
        ([[0, 1, 2], [1, 2, 0]], [False, False]),  # the same way round: one is a copy
        ([[0, 1, 2], [1, 0, 3]], [False, False]),
        ([[0, 1, 2], [4, 5, 6], [6, 5, 4]], [True, True, True]),
        ([[0, 1, 1], [1, 1, 0]], [False, False]),  # no area
        ([[0, 4, 2], [2, 4, 0]], [False, False]),
    ],
)
def test_faces_back_to_back(faces, expected):
    assert have_opposite_faces(PLACES, WORLD, np.array(faces)).tolist() == expected


def test_faces_of_different_bodies_are_not_back_to_back():
    poses = np.array([0, 0, 0, 0, 1, 1, 1])
    assert not have_opposite_faces(PLACES, poses, np.array([[0, 1, 2], [4, 6, 5]])).any()
    assert have_opposite_faces(PLACES[:0], poses[:0], np.zeros((0, 3), dtype=int)).tolist() == []


def inside_out(mesh: TriMesh) -> TriMesh:
    return TriMesh(mesh.vertices, mesh.faces[:, ::-1], mesh.uvs)


@pytest.mark.parametrize("quality", ["fast", "picture"])
@pytest.mark.parametrize("order", [1, -1])
def test_each_side_has_its_own_colour(make, quality, order):
    """Red from the front and blue from the back, in whatever order the two are given."""
    front, back = make.sheet(0.5), inside_out(make.sheet(0.5))
    pair = [make.visual(front, colour=(0.8, 0, 0)), make.visual(back, colour=(0, 0, 0.8))][::order]
    renderer = Renderer(pair, load_render_config(quality, {"floor.enabled": False}))
    for eye, stronger in (((-2, 0.3, 0.2), 0), ((2, 0.3, 0.2), 2)):
        camera = Camera.look_at(eye, (0, 0, 0), width=40, height=30)
        rgb = renderer.render(np.zeros((0, 3)), np.zeros((0, 4)), [camera]).rgb[0]
        seen = rgb[renderer.render(np.zeros((0, 3)), np.zeros((0, 4)), [camera], ("geom",)).geom[0] >= 0]
        assert len(seen) > 100
        assert (seen[:, stronger] > seen[:, 2 - stronger]).all()


def test_a_closed_body_lined_from_within_shows_no_lining(make):
    shell = make.visual(box((0.3, 0.3, 0.3)), colour=(0.8, 0, 0))
    lining = make.visual(inside_out(box((0.3, 0.3, 0.3))), colour=(0, 0, 0.8))
    for pair in ([shell, lining], [lining, shell]):
        renderer = Renderer(pair, load_render_config("fast"))
        camera = Camera.look_at((-2, 0.7, 0.9), (0, 0, 0), width=60, height=60)
        ids = renderer.render(np.zeros((0, 3)), np.zeros((0, 4)), [camera], ("geom",)).geom
        assert set(np.unique(ids)) <= {-2, -1, pair.index(shell)}


def test_a_single_open_face_is_still_seen_from_behind(make):
    tables = build_scene_tables([make.visual(make.sheet())], 0.7, 64)
    assert tables.two_sided.all()
