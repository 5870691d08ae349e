"""Convex decomposition: hulls near the surface, few and small, cached atomically."""

import numpy as np
import pytest

from artiskill.assets.partnet import decompose as module
from artiskill.assets.partnet import hull_cache
from artiskill.assets.partnet.collisions import BODY_CONFIG, HANDLE_CONFIG
from artiskill.assets.partnet.decompose import DecompositionPart, decompose
from artiskill.assets.partnet.hull_cache import decompose_cached, default_cache_dir
from artiskill.assets.partnet.meshes import (
    components,
    distance_to_surface,
    flat_patches,
    limit_vertices,
    thick_hull,
    weld,
)
from artiskill.geometry.meshes import TriMesh, convex_hull, merge, sample_surface
from artiskill.geometry.primitives import box, cylinder, sphere, tube


def arch() -> TriMesh:
    """A round bent bar, 10 mm thick, 120 mm long: one connected piece, not convex, without flat faces."""
    t = np.linspace(0, np.pi, 25)
    return tube(np.stack((0.06 * np.cos(t), 0 * t, 0.04 * np.sin(t)), axis=1), 0.005)


def test_distance_to_surface_of_a_box(rng):
    points = rng.uniform(-3, 3, (200, 3))
    outside = np.abs(points) - 1
    expected = np.where(
        (outside <= 0).all(axis=1), -outside.max(axis=1), np.linalg.norm(np.maximum(outside, 0), axis=1)
    )
    np.testing.assert_allclose(distance_to_surface(points, box((1, 1, 1))), expected, atol=1e-12)


def test_weld_joins_seams_and_twin_faces():
    cube = box((0.1, 0.1, 0.1))
    twin = TriMesh(cube.vertices, cube.faces[:, ::-1])
    welded = weld(merge((cube, twin)))
    assert len(welded.vertices) == 8
    assert len(welded.faces) == 12
    assert len(components(welded)) == 1
    assert len(flat_patches(welded)) == 6
    assert len(components(weld(merge((cube, twin.transformed((1, 0, 0))))))) == 2


@pytest.mark.parametrize("mesh", [box((0.2, 0.1, 0.01)), cylinder(0.02, 0.1), sphere(0.03)])
def test_convex_parts_need_no_coacd(mesh, monkeypatch):
    monkeypatch.setattr(module, "_run_coacd", lambda *_: pytest.fail("coacd was used"))
    (hull,) = decompose(DecompositionPart((mesh,), BODY_CONFIG))
    assert len(hull) <= BODY_CONFIG.max_vertices
    assert convex_hull(hull).volume_m3 <= convex_hull(mesh.vertices).volume_m3 + 1e-12


@pytest.mark.parametrize("extent", [(0.2, 0.1, 0.0), (0.2, 0.0, 0.0), (0.0, 0.0, 0.0)])
def test_thin_points_get_a_volume(extent):
    hull, thickened = thick_hull(box((0.5, 0.5, 0.5)).vertices * extent, 0.003)
    assert thickened
    np.testing.assert_allclose(np.sort(np.ptp(hull.mesh.bounds, axis=0)), np.sort(np.maximum(extent, 0.003)))


def test_bent_sheet_becomes_slabs():
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1)]
    faces = [(0, 1, 2), (0, 2, 3), (0, 4, 5), (0, 5, 1)]
    hulls = decompose(DecompositionPart((TriMesh(np.array(points) * 0.3, np.array(faces)),), BODY_CONFIG))
    assert len(hulls) == 2
    assert all(convex_hull(h).volume_m3 == pytest.approx(0.3 * 0.3 * 0.003) for h in hulls)


def test_limit_vertices_loses_little():
    ball = sphere(0.05, 48, 24).vertices
    kept = limit_vertices(ball, 32)
    assert len(kept) == 32
    assert convex_hull(kept).volume_m3 > 0.8 * convex_hull(ball).volume_m3


@pytest.mark.filterwarnings("ignore")
def test_coacd_follows_a_bent_bar_closely_and_repeats(rng):
    part = DecompositionPart((arch(),), HANDLE_CONFIG)
    hulls = decompose(part)
    assert 3 <= len(hulls) <= HANDLE_CONFIG.max_hulls
    assert max(map(len, hulls)) <= HANDLE_CONFIG.max_vertices
    meshes = [convex_hull(h).mesh for h in hulls]
    probes = sample_surface([arch()], 1000, rng)
    to_hulls = np.min([distance_to_surface(probes, m) for m in meshes], axis=0)
    assert np.quantile(to_hulls, 0.95) < 0.004
    # the arch stays open: nothing fills the room in which a finger hooks
    middle = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.015]])
    assert min(distance_to_surface(middle, m).min() for m in meshes) > 0.01
    for first, second in zip(hulls, decompose(part), strict=True):
        np.testing.assert_array_equal(first, second)


def test_cache(tmp_path, monkeypatch):
    parts = [
        DecompositionPart((box((0.2, 0.1, 0.01)),), BODY_CONFIG),
        DecompositionPart((cylinder(0.02, 0.1),), HANDLE_CONFIG),
    ]
    first = decompose_cached(parts, tmp_path)
    files = list((tmp_path / "partnet").iterdir())
    assert {file.suffix for file in files} == {".npz"}
    assert len(files) == 3  # each part, and the whole
    calls = []
    original = hull_cache.decompose_quickly
    monkeypatch.setattr(hull_cache, "decompose_quickly", lambda part: calls.append(part) or original(part))
    for old, new in zip(first, decompose_cached(parts, tmp_path), strict=True):
        np.testing.assert_array_equal(old[0], new[0])
    assert not calls
    decompose_cached([DecompositionPart(parts[0].meshes, HANDLE_CONFIG), parts[1]], tmp_path)
    assert len(calls) == 1
    assert len(list((tmp_path / "partnet").iterdir())) == 5


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 and then nothing", b"x" * 100])
def test_damaged_cache_is_computed_anew(tmp_path, damage):
    parts = [DecompositionPart((box((0.2, 0.1, 0.01)),), BODY_CONFIG)]
    first = decompose_cached(parts, tmp_path)
    files = {file: file.read_bytes() for file in (tmp_path / "partnet").iterdir()}
    for cut in (False, True):
        for file, whole in files.items():
            file.write_bytes(whole[: len(whole) // 2] if cut else damage)
        np.testing.assert_array_equal(decompose_cached(parts, tmp_path)[0][0], first[0][0])
        for file, whole in files.items():
            assert file.read_bytes()[:2] == b"PK"
            assert len(file.read_bytes()) == len(whole)


def test_changed_cache_is_noticed_and_computed_anew(tmp_path, caplog):
    """Whole files, as numpy sees it: one value, one name or one array is another."""
    folder = tmp_path / "partnet"
    parts = [DecompositionPart((box((0.2, 0.1, 0.01)),), BODY_CONFIG)]
    first = decompose_cached(parts, tmp_path)[0][0]
    assert not caplog.messages
    wholes = {file: file.read_bytes() for file in sorted(folder.iterdir())}  # the part and the object
    decompose_cached([DecompositionPart((box((0.1, 0.1, 0.3)),), BODY_CONFIG)], tmp_path)
    other = sorted(set(folder.iterdir()) - set(wholes))[0]
    changes = [
        lambda arrays: arrays | {"points": arrays["points"] + 1e-9},
        lambda arrays: arrays | {"points": arrays["points"] * np.nan},
        lambda arrays: arrays | {"points": np.zeros((10**7, 3))},
        lambda arrays: arrays | {"sizes": -arrays["sizes"]},
        lambda arrays: arrays | {"counts": arrays["counts"].astype(float)},
        lambda arrays: {name: value for name, value in arrays.items() if name != "digest"},
        lambda arrays: arrays | {"points": np.array([None], dtype=object)},
    ]
    for change in changes:
        for file in wholes:
            with np.load(file) as data:
                arrays = dict(data)
            np.savez_compressed(file, **change(arrays))
        caplog.clear()
        np.testing.assert_array_equal(decompose_cached(parts, tmp_path)[0][0], first)
        assert ["is made anew" in message for message in caplog.messages] == [True, True]
        assert {file: file.read_bytes() for file in wholes} == wholes
    for file, whole in wholes.items():
        file.write_bytes(other.read_bytes())
        np.testing.assert_array_equal(decompose_cached(parts, tmp_path)[0][0], first)
        for place in range(0, len(whole), 97):  # any byte
            file.write_bytes(whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :])
            np.testing.assert_array_equal(decompose_cached(parts, tmp_path)[0][0], first)


def test_unwritable_cache_only_costs_time(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    assert len(decompose_cached([DecompositionPart((box((0.1, 0.1, 0.1)),), BODY_CONFIG)], blocked)[0]) == 1
    assert blocked.read_text() == "in the way"


def test_default_cache_dir(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert default_cache_dir() == tmp_path / "artiskill"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert default_cache_dir().parts[-2:] == (".cache", "artiskill")
