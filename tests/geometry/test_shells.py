"""Swept skins: closed, outward, of the right volume, with texture coordinates that fit."""

import numpy as np
import pytest

from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.shells import path_sweep, ring_sweep

CIRCLE = np.stack([f(np.arange(96) * 2 * np.pi / 96) for f in (np.cos, np.sin)], axis=-1)
PIPE = [(0.2, 0.0), (0.2, 0.5), (0.1, 0.5), (0.1, 0.0)]


def volume(mesh: TriMesh) -> float:
    corners = mesh.vertices[mesh.faces]
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


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
