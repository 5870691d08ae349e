import numpy as np
import pytest

from artiskill.errors import AssetError
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import box, sphere
from artiskill.sensors.drawing.scene_tables import build_triangle_soup


def build(*visuals, max_px=512):
    return build_triangle_soup(visuals, np.radians(40), max_px)


def test_ids_follow_the_order_of_the_visuals(make):
    soup = build(make.visual(box((1, 1, 1)), 4), make.visual(sphere(0.1), -1), make.visual(make.sheet(), 2))
    assert soup.body_count == 5
    counts = np.bincount(soup.face_geom)
    assert counts.tolist() == [12, len(sphere(0.1).faces), 2]
    assert [soup.face_body[soup.face_geom == g][0] for g in range(3)] == [4, -1, 2]
    assert [bool(soup.face_two_sided[soup.face_geom == g][0]) for g in range(3)] == [False, False, True]
    np.testing.assert_array_equal(soup.vertex_pose[soup.faces[:, 0]], soup.face_body + 1)
    np.testing.assert_allclose(soup.vertices[soup.faces[-2:]], make.sheet().vertices[make.sheet().faces])


def test_shared_textures_are_stored_once_and_large_ones_shrunk(make):
    texture = np.full((40, 20, 3), 7, dtype=np.uint8)
    soup = build(
        make.visual(make.sheet(), texture=texture),
        make.visual(make.sheet(), texture=texture),
        make.visual(make.sheet()),
        max_px=10,
    )
    assert soup.textures[:, 0].tolist() == [[0, 10, 5], [0, 10, 5], [0, 0, 0]]
    assert soup.texels.shape == (10 * 5 + 5 * 2 + 2 * 1 + 1, 3)
    assert (soup.texels == 7).all()


def test_a_texture_without_coordinates_is_not_used(make):
    soup = build(make.visual(box((1, 1, 1)), texture=np.zeros((4, 4, 3), dtype=np.uint8)))
    assert soup.textures[0, 0, 1] == 0


def test_nothing_at_all_is_legal():
    soup = build()
    assert soup.faces.shape == (0, 3)
    assert soup.body_count == 0


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
