import numpy as np
import pytest

from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import box
from artiskill.sensors.camera import Camera
from artiskill.sensors.drawing.scene_tables import build_triangle_soup, have_opposite_faces
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import Renderer

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
def test_who_has_a_twin(faces, expected):
    assert have_opposite_faces(PLACES, WORLD, np.array(faces)).tolist() == expected


def test_faces_of_different_bodies_are_no_twins():
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
    soup = build_triangle_soup([make.visual(make.sheet())], 0.7, 64)
    assert soup.face_two_sided.all()
