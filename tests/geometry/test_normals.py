import numpy as np
import pytest

from artiskill.geometry.meshes import TriMesh, merge
from artiskill.geometry.normals import corner_normals, face_normals, is_closed
from artiskill.geometry.primitives import box, capsule, cylinder, sphere, tube


def test_a_box_stays_flat():
    mesh = box((0.1, 0.2, 0.3))
    expected = np.repeat(face_normals(mesh)[:, None], 3, axis=1)
    np.testing.assert_allclose(corner_normals(mesh, np.radians(40)), expected, atol=1e-12)


def test_a_sphere_is_smooth():
    mesh = sphere(0.5, 32, 13)
    radial = mesh.vertices[mesh.faces] / 0.5
    assert (corner_normals(mesh, np.radians(40)) * radial).sum(axis=-1).min() > 0.995
    assert (corner_normals(mesh, 0.0) * radial).sum(axis=-1).min() < 0.995


def test_a_cylinder_is_smooth_around_and_sharp_at_its_rims():
    normals = corner_normals(cylinder(0.1, 0.2, 24), np.radians(40)).reshape(-1, 3)
    level, upright = np.abs(normals[:, 2]) < 1e-9, np.abs(normals[:, 2]) > 1 - 1e-9
    assert (level | upright).all()


def test_vertices_split_by_texture_coordinates_are_one():
    mesh = sphere(0.5, 32, 13)
    split = TriMesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
    np.testing.assert_allclose(corner_normals(split, 0.7), corner_normals(mesh, 0.7), atol=1e-12)
    assert is_closed(split)


def test_zero_area_faces_have_no_normal_and_do_no_harm():
    mesh = TriMesh(
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0.0]]), np.array([[0, 1, 2], [0, 1, 3], [1, 1, 2]])
    )
    normals = corner_normals(mesh, np.radians(40))
    np.testing.assert_allclose(normals[0], [[0, 0, 1]] * 3)
    assert np.isfinite(normals).all()


@pytest.mark.parametrize(
    "mesh",
    [
        box((0.1, 0.2, 0.3)),
        box((0.1, 0.2, 0.3), 0.01),
        cylinder(0.1, 0.2),
        sphere(0.1),
        capsule(0.1, 0.1),
        tube([(0, 0, 0), (0, 0, 1), (0, 1, 2)], 0.1),
        merge((sphere(0.1), sphere(0.1).transformed((1, 0, 0)))),
    ],
)
def test_primitives_are_closed(mesh):
    assert is_closed(mesh)
    assert not is_closed(TriMesh(mesh.vertices, mesh.faces[:, ::-1]))
    assert not is_closed(TriMesh(mesh.vertices, mesh.faces[1:]))


def test_no_faces_are_not_closed():
    assert not is_closed(TriMesh(np.zeros((3, 3)), np.zeros((0, 3))))
