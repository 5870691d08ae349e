"""Meshes and convex hulls of known bodies, samples of surfaces, and signed distances against brute force."""

import array_api_strict
import numpy as np
import pytest

from artiskill.geometry.meshes import TriMesh, convex_hull, depth_inside, merge, sample_surface
from artiskill.geometry.primitives import box

CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def volume(mesh: TriMesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def test_mirroring_keeps_faces_outwards():
    mesh = box((0.1, 0.2, 0.3))
    assert volume(mesh.scaled((-1, 1, 1))) == pytest.approx(8 * 0.006)


def test_merge_keeps_parts_and_uvs_only_where_all_have_them():
    plain = box((1, 1, 1))
    textured = TriMesh(plain.vertices, plain.faces, np.zeros((len(plain.vertices), 2), np.float32))
    assert merge([plain, textured]).uvs is None
    both = merge([textured, textured])
    assert both.uvs is not None
    assert volume(both) == pytest.approx(16)


def test_surface_samples_lie_on_the_surface_and_follow_area():
    rng = np.random.default_rng(0)
    points = sample_surface([box((1, 1, 1)), box((0.1, 0.1, 0.1)).transformed((5, 0, 0))], 4000, rng)
    near = points[:, 0] < 3
    assert np.abs(points[near]).max(axis=1) == pytest.approx(np.ones(near.sum()))
    assert (~near).mean() == pytest.approx(0.01 / 1.01, abs=0.005)


def test_a_cube() -> None:
    inner = np.random.default_rng(0).uniform(-0.9, 0.9, size=(50, 3))
    hull = convex_hull(np.concatenate((inner, CUBE)))
    assert hull.volume_m3 == pytest.approx(8.0)
    assert hull.planes.shape == (6, 4)
    assert len(hull.mesh.faces) == 12
    assert {tuple(v) for v in hull.mesh.vertices} == {tuple(v) for v in CUBE}
    np.testing.assert_allclose(np.linalg.norm(hull.planes[:, :3], axis=1), 1.0)


def test_faces_look_outwards(rng: np.random.Generator) -> None:
    points = rng.normal(size=(80, 3)) + np.array((5, -3, 2))
    hull = convex_hull(points)
    a, b, c = (hull.mesh.vertices[hull.mesh.faces[:, i]] for i in range(3))
    # the signed volume of the tetrahedra over the origin is the hull's volume only if every face is turned right
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(hull.volume_m3)
    middle = points.mean(axis=0)
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), a - middle) > 0).all()


def test_all_points_are_inside(rng: np.random.Generator) -> None:
    points = rng.normal(size=(200, 3))
    assert depth_inside(convex_hull(points).planes, points).min() >= -1e-8


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 3)),
        np.zeros((3, 3)),
        np.zeros((10, 3)),
        np.column_stack((np.random.default_rng(0).normal(size=(20, 2)), np.zeros(20))),
        np.full((8, 3), np.nan),
    ],
    ids=["empty", "three", "one point", "plane", "nan"],
)
def test_no_volume_no_hull(points: np.ndarray) -> None:
    with pytest.raises(ValueError, match=f"no convex hull: {len(points)} points"):
        convex_hull(points)


def distance_to_triangles(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distance to the nearest of many triangles (T, 3, 3), by a fine grid of points on each: brute force."""
    steps = np.linspace(0, 1, 60)
    u, v = (g.ravel() for g in np.meshgrid(steps, steps))
    u, v = u[u + v <= 1], v[u + v <= 1]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    grid = a[:, None] + u[None, :, None] * (b - a)[:, None] + v[None, :, None] * (c - a)[:, None]
    return np.array([np.linalg.norm(grid - p, axis=-1).min() for p in points])


def test_depth_against_brute_force(rng: np.random.Generator) -> None:
    hull = convex_hull(rng.normal(size=(12, 3)))
    points = rng.normal(size=(300, 3)) * 0.8
    depth = depth_inside(hull.planes, points)
    distance = distance_to_triangles(points, hull.mesh.vertices[hull.mesh.faces])
    inside = depth > 0
    assert inside.sum() > 30
    assert (~inside).sum() > 30
    np.testing.assert_allclose(depth[inside], distance[inside], atol=0.02)
    assert (-depth[~inside] <= distance[~inside] + 1e-9).all(), "outside, it must not say more than the distance"


def test_depth_of_a_cube() -> None:
    planes = convex_hull(CUBE).planes
    points = np.array([[0, 0, 0], [0.75, 0, 0], [1, 0, 0], [3, 0, 0], [0, -4, 0.5]])
    np.testing.assert_allclose(depth_inside(planes, points), [1, 0.25, 0, -2, -3], atol=1e-12)


def test_depth_of_a_batch_in_any_array_library(rng: np.random.Generator) -> None:
    planes = np.stack([convex_hull(CUBE * s).planes for s in (1.0, 2.0, 0.5)])
    points = rng.normal(size=(3, 11, 3))
    together = depth_inside(planes, points)
    assert together.shape == (3, 11)
    for i in range(3):
        np.testing.assert_array_equal(together[i], depth_inside(planes[i], points[i]))
    strict = depth_inside(array_api_strict.asarray(planes), array_api_strict.asarray(points))
    np.testing.assert_allclose(np.asarray(strict), together)
