"""Bodies of known form: closed, facing outwards, and as large as they should be."""

import numpy as np
import pytest

from artiskill.geometry.meshes import TriMesh, triangle_areas
from artiskill.geometry.primitives import (
    box,
    capsule,
    cylinder,
    extrude,
    frustum,
    lathe,
    loft,
    path_sweep,
    ring_sweep,
    rounded_box,
    rounded_rectangle,
    sphere,
    strip,
    superellipse,
    superellipse_loft,
    torus,
    tube,
    upright_prism,
)

SQUARE = np.array(((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)))
CIRCLE = np.stack([f(np.arange(96) * 2 * np.pi / 96) for f in (np.cos, np.sin)], axis=-1)
PIPE = [(0.2, 0.0), (0.2, 0.5), (0.1, 0.5), (0.1, 0.0)]
BODIES = {
    "box": (box((0.1, 0.2, 0.3)), 8 * 0.006),
    "bevelled box": (box((0.1, 0.2, 0.3), 0.001), 8 * 0.006),
    "cylinder": (cylinder(0.1, 0.2, 64), np.pi * 0.01 * 0.4),
    "capsule": (capsule(0.1, 0.2, 48, 12), np.pi * 0.01 * 0.4 + 4 / 3 * np.pi * 0.001),
    "sphere": (sphere(0.1, 48, 14), 4 / 3 * np.pi * 0.001),
    "lathe": (lathe([(0, 0), (0.2, 0), (0, 0.3)], 64), np.pi * 0.04 * 0.3 / 3),
    "extrude": (extrude([(0, 0), (1, 0), (0, 1)], 0.5), 0.5),
    "tube": (tube([(0, 0, z) for z in np.linspace(0, 1, 5)], 0.1, 64), np.pi * 0.01),
    "superellipse_loft": (
        superellipse_loft([(0, 0, 0, 0.1, 0.2, 2), (1, 0.3, 0.1, 0.1, 0.2, 2)], 64),
        np.pi * 0.02,
    ),
    "rounded_box": (
        rounded_box((0.1, 0.2, 0.3), 0.03, arc=9, bevel_m=1e-4),
        1.2 * (0.08 - (4 - np.pi) * 0.0009) / 2,
    ),
}


def edge_counts(mesh: TriMesh) -> tuple[np.ndarray, set[tuple[int, int]]]:
    edges = np.concatenate([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)])
    unique, counts = np.unique(edges, axis=0, return_counts=True)
    return counts, {(int(a), int(b)) for a, b in unique}


def volume(mesh: TriMesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("name", BODIES)
def test_primitives_are_closed_and_face_outwards(name):
    mesh, _ = BODIES[name]
    counts, edges = edge_counts(mesh)
    assert counts.max() == 1
    assert all((b, a) in edges for a, b in edges)
    assert triangle_areas(mesh).min() > 0


@pytest.mark.parametrize("name", BODIES)
def test_primitives_have_the_volume_of_their_formula(name):
    mesh, expected = BODIES[name]
    assert volume(mesh) == pytest.approx(expected, rel=0.02)


def test_superellipse_points_satisfy_their_equation():
    points = superellipse(0.3, 0.2, 5.0, 24)
    assert np.sum((np.abs(points) / (0.3, 0.2)) ** 5.0, axis=1) == pytest.approx(np.ones(24))
    turn = np.cross(np.pad(points, ((0, 0), (0, 1))), np.pad(np.roll(points, -1, 0), ((0, 0), (0, 1))))[:, 2]
    assert turn.min() > 0  # counter-clockwise


def test_rounded_rectangle_stays_within_its_sides_and_touches_them():
    points = rounded_rectangle(0.3, 0.2, 0.05, arc=5)
    assert points.shape == (20, 2)
    assert np.abs(points).max(axis=0) == pytest.approx([0.3, 0.2])
    corner = points[np.all(points > 0, axis=1)] - (0.25, 0.15)
    assert np.linalg.norm(corner, axis=1) == pytest.approx(np.full(5, 0.05))


def test_rounded_box_has_the_size_asked_for():
    assert rounded_box((0.1, 0.2, 0.3), 0.02).bounds == pytest.approx(
        np.array([[-0.1, -0.2, -0.3], [0.1, 0.2, 0.3]])
    )


def test_loft_through_tilted_rings_is_closed():
    ring = superellipse(0.1, 0.1, 2.0, 12)
    upright = np.column_stack((ring, np.zeros(12)))
    # a quarter bend: from travelling along z to travelling along x about a pivot at x = 0.3
    bend = np.column_stack((0.3 + np.zeros(12), ring[:, 1], 0.3 - ring[:, 0]))
    mesh = loft([upright, bend])
    counts, edges = edge_counts(mesh)
    assert counts.max() == 1
    assert all((b, a) in edges for a, b in edges)
    assert volume(mesh) > 0


def test_a_flat_bar_keeps_its_thickness_round_a_mitred_corner() -> None:
    bar = strip([(0, 0, 0), (0, 0.1, 0), (-0.1, 0.1, 0)], (0, 0, 1), 0.01, 0.002)
    assert volume(bar) == pytest.approx(0.2 * 0.02 * 0.004)
    np.testing.assert_allclose(bar.bounds[:, 2], (-0.01, 0.01))
    assert bar.bounds[1, 1] == pytest.approx(0.102)


def test_a_round_bar() -> None:
    bar = strip([(0, 0, 0), (0.3, 0, 0)], (0, 0, 1), 0.01, 0.01, sides=64)
    assert volume(bar) == pytest.approx(0.3 * np.pi * 0.01**2, rel=0.01)


def test_the_plane_may_be_seen_from_either_side() -> None:
    path = [(0, 0, 0), (0, 0, 0.1), (-0.05, 0, 0.15)]
    assert volume(strip(path, (0, 1, 0), 0.01, 0.003)) > 0
    assert volume(strip(path, (0, -1, 0), 0.01, 0.003)) > 0


def test_a_ring() -> None:
    ring = torus(0.03, 0.004, 64, 24)
    assert volume(ring) == pytest.approx(2 * np.pi * 0.03 * np.pi * 0.004**2, rel=0.02)
    np.testing.assert_allclose(ring.bounds[1], (0.034, 0.034, 0.004), atol=1e-9)


def test_a_prism_stands_on_its_outline() -> None:
    prism = upright_prism(SQUARE, 0.2, 0.5)
    assert volume(prism) == pytest.approx(0.3)
    np.testing.assert_allclose(prism.bounds, ((0, 0, 0.2), (1, 1, 0.5)))


def test_a_frustum_narrows_towards_the_viewer() -> None:
    field = frustum(((0, 0), (1, 1)), ((0.1, 0.1), (0.9, 0.9)), depth=0.2, height=0.1)
    assert volume(field) == pytest.approx(0.1 * (1 + 0.64 + 0.8) / 3)
    np.testing.assert_allclose(field.bounds[:, 0], (0.1, 0.2))
    front = field.vertices[np.isclose(field.vertices[:, 0], 0.1)]
    np.testing.assert_allclose(np.ptp(front[:, 1:], axis=0), 0.8)


@pytest.mark.parametrize("tile_m", [0.0, 0.25])
def test_a_ring_has_the_volume_of_a_pipe(tile_m: float) -> None:
    assert volume(ring_sweep(CIRCLE, PIPE, tile_m)) == pytest.approx(np.pi * 0.03 * 0.5, rel=0.002)


def test_a_loop_may_differ_around_the_outline() -> None:
    loops = np.repeat(np.array(PIPE)[None], len(CIRCLE), axis=0)
    assert np.array_equal(ring_sweep(CIRCLE, loops).vertices, ring_sweep(CIRCLE, PIPE).vertices)
    loops[:10, 1, 1] = 0.6
    assert ring_sweep(CIRCLE, loops).bounds[1, 2] == pytest.approx(0.6)


def test_whole_tiles_go_around() -> None:
    uvs = ring_sweep(CIRCLE, PIPE, 0.25).uvs
    assert uvs is not None
    assert uvs[:, 0].max() == round(2 * np.pi * 0.2 / 0.25)
    assert uvs[:, 1].max() == pytest.approx((0.5 + 0.1) * 2 / 0.25, rel=1e-5)


def test_a_straight_sweep_is_a_prism() -> None:
    section = [(0.1, -0.02), (0.1, 0.02), (-0.1, 0.02), (-0.1, -0.02)]
    path = [(0.0, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 1.0, 0.0)]
    mesh = path_sweep(path, section, (1.0, 0.0, 0.0))
    assert volume(mesh) == pytest.approx(0.2 * 0.04 * 1.0)
    assert np.allclose(mesh.bounds, ((-0.1, 0.0, -0.02), (0.1, 1.0, 0.02)))
