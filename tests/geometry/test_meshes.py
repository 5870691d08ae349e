import numpy as np
import pytest

from artiskill.geometry.meshes import (
    TriMesh,
    box,
    capsule,
    cylinder,
    extrude,
    lathe,
    loft,
    merge,
    rounded_box,
    rounded_rectangle,
    sample_surface,
    sphere,
    superellipse,
    superellipse_loft,
    triangle_areas,
    tube,
)

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


def test_mirroring_keeps_faces_outwards():
    mesh, expected = BODIES["box"]
    assert volume(mesh.scaled((-1, 1, 1))) == pytest.approx(expected)


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
