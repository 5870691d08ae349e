"""Bars along a path, rings, prisms and frustums: closed, outward-facing, and as large as they should be."""

import numpy as np
import pytest

from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.strips import frustum, strip, torus, upright_prism

SQUARE = np.array(((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)))


def volume(mesh: TriMesh) -> float:
    """Positive where faces look outwards."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


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
