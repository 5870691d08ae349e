"""Drawn surfaces made lighter: how many triangles, the same surface, textures and both sides kept."""

import numpy as np
import pytest
from benchmarks.partnet_folders import block, carving, fine_ogee, moulding

from artiskill.assets.articulated_object import Link, Material, VisualMesh
from artiskill.assets.partnet.meshes import distance_to_surface
from artiskill.assets.partnet.simplify import MOST_TRIANGLES, cluster, share_out, thin_out
from artiskill.geometry.meshes import TriMesh, sample_surface
from artiskill.geometry.primitives import box, sphere
from artiskill.sensors.drawing.scene_tables import have_opposite_faces


def link(*visuals: VisualMesh) -> Link:
    still = np.array((1.0, 0.0, 0.0, 0.0))
    return Link("base", -1, np.zeros(3), still, None, visuals, (), 600.0, np.zeros((0, 3)))


def visual(mesh: TriMesh, red: float = 0.5) -> VisualMesh:
    return VisualMesh(mesh, Material("paint", (red, 0.5, 0.5, 1.0)), "frame")


def triangles(links: tuple[Link, ...]) -> int:
    return sum(len(v.mesh.faces) for one in links for v in one.visuals)


def test_few_triangles_stay_as_they_are():
    links = (link(visual(carving((1.0, 0.5), 0.02, 60, 1))),)
    assert thin_out(links, "cabinet") == (links, [])


def test_shares_go_with_the_root_and_the_small_keep_all():
    assert share_out([12, 12, 10_000, 40_000], 3_024) == [12, 12, 1_000, 2_000]
    assert share_out([500, 500], 2_000) == [500, 500]
    assert sum(share_out([900, 30, 5_000, 7], 1_000)) <= 1_000


@pytest.mark.parametrize(
    "mesh",
    [
        carving((1.0, 0.5), 0.03, 120, 1),
        block((-0.3, -0.6, -0.7), (0.3, -0.57, 0.7), 0.006, 5),
        pytest.param(
            moulding(np.array([(0.3, -0.6), (-0.3, -0.6), (-0.3, 0.6), (0.3, 0.6)]), fine_ogee(1000)),
            marks=pytest.mark.slow,
        ),
    ],
    ids=["carving", "board of needles", "moulding of needles"],
)
def test_the_surface_stays_where_it_was(mesh, rng):
    (found,), (said,) = thin_out((link(visual(mesh)),), "cabinet")
    light = found.visuals[0].mesh
    assert len(light.faces) <= MOST_TRIANGLES["cabinet"]
    assert said.startswith(f"drawn with {len(light.faces):,} triangles of {len(mesh.faces):,}: more than 15,000")
    for one, other in ((mesh, light), (light, mesh)):
        assert distance_to_surface(sample_surface([one], 300, rng), other).max() < 0.004
    (again,), _ = thin_out((link(visual(mesh)),), "cabinet")
    np.testing.assert_array_equal(again.visuals[0].mesh.vertices, light.vertices)


def test_texture_coordinates_follow_the_surface():
    """They are an affine function of the place here, which every vertex must keep, seams or not."""
    plate = carving((1.0, 0.5), 0.004, 110, 1)
    uvs = plate.vertices[:, 1:] @ np.array([[2.0, 0.5], [-0.5, 3.0]])
    drawn = TriMesh(plate.vertices, plate.faces, uvs.astype(np.float32))
    (found,), _ = thin_out((link(visual(drawn)),), "cabinet")
    mesh = found.visuals[0].mesh
    assert len(mesh.faces) <= 15_000
    expected = mesh.vertices[:, 1:] @ np.array([[2.0, 0.5], [-0.5, 3.0]])
    assert np.quantile(np.abs(mesh.uvs - expected), 0.99) < 0.02


def test_both_sides_of_a_surface_stay_back_to_back():
    ball = sphere(0.3, 200, 50)
    inside = TriMesh(ball.vertices, ball.faces[:, ::-1])
    (found,), _ = thin_out((link(visual(ball, 1.0), visual(inside, 0.0)),), "cabinet")
    outer, inner = (v.mesh for v in found.visuals)
    assert len(outer.faces) + len(inner.faces) <= 15_000
    assert [v.material.rgba[0] for v in found.visuals] == [1.0, 0.0]
    vertices = np.concatenate((outer.vertices, inner.vertices))
    faces = np.concatenate((outer.faces, inner.faces + len(outer.vertices)))
    assert have_opposite_faces(vertices, np.zeros(len(vertices), dtype=int), faces).all()
    for mesh, sign in ((outer, 1.0), (inner, -1.0)):
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        assert (sign * np.sum(np.cross(b - a, c - a) * (a + b + c), axis=1) > 0).all()


def test_cluster_moves_vertices_by_less_than_a_cell():
    mesh = carving((0.4, 0.2), 0.01, 40, 1)
    light = cluster(mesh, 0.01)
    assert len(light.faces) < 0.7 * len(mesh.faces)
    assert distance_to_surface(mesh.vertices, light).max() < 0.01 * np.sqrt(3)
    assert len(cluster(box((1, 1, 1)), 10.0).faces) == 0


def test_buckets_have_a_measure_of_their_own():
    links = (link(visual(carving((1.0, 0.5), 0.02, 70, 1))),)
    assert triangles(links) > 6_000
    assert triangles(thin_out(links, "bucket")[0]) <= 6_000
