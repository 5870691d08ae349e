"""Long imports: on several processes, with news, and again from where they were ended; meshes that are hard."""

import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.partnet_folders import (
    OBJECTS,
    ToyLink,
    block,
    bow,
    carving,
    disturbed,
    doubled,
    panel,
    shell,
    write_object,
)

from artiskill.assets.partnet import hull_cache, import_partnet
from artiskill.assets.partnet.collisions import BODY_CONFIG, HANDLE_CONFIG
from artiskill.assets.partnet.decompose import (
    DecompositionConfig,
    DecompositionPart,
    bisect_hulls,
    decompose,
    hull_distance,
)
from artiskill.assets.partnet.hull_cache import decompose_cached
from artiskill.assets.partnet.importer import ProgressLines
from artiskill.assets.partnet.meshes import distance_to_surface, join_hulls, weld
from artiskill.assets.partnet.simplify import collapse, lighten
from artiskill.errors import AssetError
from artiskill.geometry.meshes import TriMesh, convex_hull, depth_inside, merge, sample_surface
from artiskill.geometry.primitives import box, tube
from artiskill.geometry.surfaces import point_triangle_distance

TOLERANCE_M = 0.006  # of the body's tolerance of 4 mm: a decomposition is judged by all of its hulls together


def drawer(seed: int = 0) -> list[ToyLink]:
    """A frame, and a drawer whose front, box and handle are open, doubled or turned inside out."""
    front = panel((0.9, 0.3), 0.03, 0.03, 12).transformed((-0.53, 0, 0))
    parts = [
        ("drawer_front", disturbed(front, seed, 0.02)),
        ("drawer_box", disturbed(shell((-0.5, -0.4, -0.12), (0.4, 0.4, 0.1), 5), seed)),
        ("handle", disturbed(bow(0.2, 0.08, 0.012, 10, 16).transformed((-0.53, 0, 0)), seed, 0.02)),
    ]
    walls = [block((-0.5, s * 0.5 - 0.02, -0.2), (0.5, s * 0.5 + 0.02, 0.2), 0.005) for s in (-1, 1)]
    frame = [("frame", merge(walls)), ("frame", doubled(block((-0.5, -0.5, -0.22), (0.5, 0.5, -0.2)), 0.001))]
    moving = ToyLink("link_1", "link_0", "prismatic", parts, axis=(-1, 0, 0), limits=(0, 0.5))
    return [ToyLink("link_0", "base", "fixed", frame), moving]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_object(tmp_path_factory.mktemp("drawer") / "drawer", "StorageFurniture", drawer())


@pytest.fixture(scope="module")
def content_hash(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Of the object, imported with one worker."""
    return import_partnet(folder, cache_dir=tmp_path_factory.mktemp("one"), workers=1).content_hash


def test_the_number_of_workers_changes_no_bit(folder, content_hash, tmp_path):
    assert import_partnet(folder, cache_dir=tmp_path, workers=3).content_hash == content_hash


@pytest.mark.parametrize("workers", [0, -1, 1.5, True])
def test_workers_must_be_a_number_of_processes(folder, workers):
    with pytest.raises(AssetError, match=f"workers must be a positive number of processes, not {workers!r}"):
        import_partnet(folder, workers=workers)


def test_a_killed_import_goes_on_from_there(folder, content_hash, tmp_path):
    code = f"""if True:
        import os, signal
        from pathlib import Path
        from artiskill import import_partnet
        def kill(done, total):
            if done >= 4:  # of 5, the last on its way
                os.kill(os.getpid(), signal.SIGKILL)
        import_partnet({str(folder)!r}, cache_dir=Path({str(tmp_path)!r}), workers=1, on_progress=kill)
    """
    killed = subprocess.run([sys.executable, "-c", code], timeout=120, check=False)
    assert killed.returncode == -signal.SIGKILL
    kept = {file: file.stat().st_mtime_ns for file in (tmp_path / "partnet").glob("*.npz")}
    assert len(kept) >= 4
    news: list[tuple[int, int]] = []
    found = import_partnet(folder, cache_dir=tmp_path, on_progress=lambda *counts: news.append(counts))
    assert found.content_hash == content_hash
    assert min(done for done, _ in news or [(5, 5)]) >= 4
    assert all(file.stat().st_mtime_ns == old for file, old in kept.items())


def test_a_script_without_main_guard_may_import(folder, content_hash, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "from pathlib import Path\nfrom artiskill import import_partnet\n"
        f"print(import_partnet({str(folder)!r}, cache_dir=Path({str(tmp_path)!r}), workers=2).content_hash)\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout.split() == [content_hash]


def test_a_worker_that_ends_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(hull_cache, "_COMMAND", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV); {}")
    parts = [DecompositionPart((bow(0.1, 0.03, 0.005),), HANDLE_CONFIG)]
    with pytest.raises(AssetError, match=r"ended unexpectedly \(SIGSEGV\)"):
        decompose_cached(parts, tmp_path)


def test_errors_of_a_worker_arrive(tmp_path, monkeypatch):
    command = "import sys; sys.modules['coacd'] = None; " + hull_cache._COMMAND
    monkeypatch.setattr(hull_cache, "_COMMAND", command)
    with pytest.raises(ImportError, match="import"):
        decompose_cached([DecompositionPart((coil(),), HANDLE_CONFIG)], tmp_path)


def test_progress_is_told_only_of_what_takes_long(capsys, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("artiskill.assets.partnet.importer.time.perf_counter", lambda: now[0])
    told = ProgressLines("40147")
    for seconds, done in ((0.1, 10), (0.9, 20), (1.5, 30), (2.0, 31), (12.0, 40), (14.0, 50)):
        now[0] = seconds
        told(done, 50)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "40147: finding collision shapes, once: 30 of 50 parts, 2 s, about 2 s left",
        "40147: finding collision shapes, once: 40 of 50 parts, 12 s, about 4 s left",
        "40147: finding collision shapes, once: 50 of 50 parts, 14 s",
    ]
    now[0] = 100.0
    quick = ProgressLines("40147")
    now[0] = 100.9
    quick(50, 50)
    assert capsys.readouterr().err == ""


def coil() -> TriMesh:
    """A bar that turns three times: more than ten convex pieces can follow."""
    t = np.linspace(0, 6 * np.pi, 90)
    return tube(np.stack((0.05 * np.cos(t), 0.05 * np.sin(t), 0.004 * t), axis=1), 0.004)


def test_halves_of_halves_follow_a_closed_ring(rng):
    t = np.linspace(0, 2 * np.pi * 31 / 32, 32)
    ring = tube(np.stack((0.06 * np.cos(t), 0.06 * np.sin(t), 0 * t), axis=1), 0.006)
    config = DecompositionConfig(tolerance_m=0.0015, thickness_m=0.002, max_hulls=10, max_vertices=32)
    hulls, error_m = bisect_hulls(ring, config)
    assert 6 <= len(hulls) <= 10
    assert error_m < 0.004
    (whole,), far_m = bisect_hulls(ring, replace(config, max_hulls=1))
    assert far_m > 0.03
    assert error_m == pytest.approx(hull_distance(hulls, ring))
    drawn = sample_surface([ring], 300, rng)
    planes = [convex_hull(hull).planes for hull in hulls]
    assert np.min([-depth_inside(one, drawn) for one in planes], axis=0).max() < 1e-3
    assert len(whole) <= 32


def test_nearest_triangles_of_many(rng):
    """Small and large triangles, needles and points without area, against all pairs."""
    centres = rng.uniform(-1, 1, (900, 1, 3))
    corners = centres + rng.normal(size=(900, 3, 3)) * 10.0 ** rng.uniform(-4, 0, (900, 1, 1))
    corners[:50, 2] = corners[:50, 1]
    corners[50:60] = corners[50:60, :1]
    mesh = TriMesh(corners.reshape(-1, 3), np.arange(2700).reshape(-1, 3))
    points = rng.uniform(-1.5, 1.5, (300, 3))
    expected = point_triangle_distance(points[:, None], corners[None]).min(axis=1)
    np.testing.assert_allclose(distance_to_surface(points, mesh), expected, atol=1e-12)


@pytest.mark.parametrize("mesh", [carving((0.4, 0.12), 0.012, 100, 1), panel((0.23, 0.19), 0.012, 0.012, 36)])
def test_a_lighter_mesh_lies_where_the_drawn_one_does(mesh, rng):
    mesh = weld(mesh)
    light = lighten(mesh, 0.001)
    assert len(light.faces) < 0.5 * len(mesh.faces)
    for one, other in ((mesh, light), (light, mesh)):
        assert np.quantile(distance_to_surface(sample_surface([one], 500, rng), other), 0.97) <= 0.001
    again = lighten(mesh, 0.001)
    np.testing.assert_array_equal(light.vertices, again.vertices)
    np.testing.assert_array_equal(light.faces, again.faces)


def test_collapse_is_the_same_for_a_speck_and_a_house():
    mesh = carving((0.4, 0.12), 0.012, 40, 1)
    house = collapse(mesh.scaled(1024.0), 800)
    speck = collapse(mesh.scaled(1 / 1024), 800)
    np.testing.assert_array_equal(house.faces, speck.faces)
    np.testing.assert_allclose(house.vertices / 1024, speck.vertices * 1024, rtol=0, atol=1e-12)


def test_far_hulls_are_not_joined_while_near_ones_can_be():
    """Two small bars in line would make a thin hull, cheap by its volume, right across the room between."""
    bars = [box((0.05, 0.001, 0.001)).transformed((x, 0, 0)).vertices for x in (0.0, 1.0)]
    blocks = [box((0.02, 0.02, 0.02)).transformed((0.5, 0.2, z)).vertices for z in (0.0, 0.045)]
    (joined,) = join_hulls([[*bars, *blocks]], [0], 3)
    assert len(joined) == 3
    assert max(np.ptp(hull[:, 0]) for hull in joined) == pytest.approx(0.1)
    (all_joined,) = join_hulls([[*bars, *blocks]], [0], 1)
    assert len(all_joined) == 1


@pytest.mark.parametrize(
    "mesh",
    [
        disturbed(carving((0.3, 0.3), 0.012, 64, 2), 1, 0.02),
        doubled(panel((0.3, 0.2), 0.012, 0.02, 30), 0.0004),
        disturbed(shell((-0.2, -0.2, -0.05), (0.2, 0.2, 0.05), 12), 3, 0.01),
    ],
    ids=["open carving", "doubled panel", "holed shell"],
)
def test_hard_meshes_are_followed(mesh, rng):
    hulls = [convex_hull(hull) for hull in decompose(DecompositionPart((mesh,), BODY_CONFIG))]
    assert 1 <= len(hulls) <= BODY_CONFIG.max_hulls
    drawn = sample_surface([mesh], 400, rng)
    outside = np.min([-depth_inside(hull.planes, drawn) for hull in hulls], axis=0)
    assert np.quantile(outside, 0.95) < 0.001
    probes = np.concatenate([sample_surface([hull.mesh], 200, rng) for hull in hulls])
    hidden = sum((depth_inside(hull.planes, probes) > -1e-6).astype(int) for hull in hulls) > 1
    assert np.quantile(distance_to_surface(probes[~hidden], mesh), 0.95) < TOLERANCE_M


def test_a_soup_of_loose_triangles_is_one_piece_and_quick(rng):
    """Every face its own component: thousands of pieces, none of which is looked at."""
    centres = rng.uniform(-0.2, 0.2, (6_000, 1, 3)) * (1, 1, 0.02)
    mesh = TriMesh(
        (centres + rng.normal(size=(6_000, 3, 3)) * 0.003).reshape(-1, 3), np.arange(18_000).reshape(-1, 3)
    )
    hulls = decompose(DecompositionPart((mesh,), BODY_CONFIG))
    assert 1 <= len(hulls) <= BODY_CONFIG.max_hulls


@pytest.mark.slow
@pytest.mark.parametrize("name", OBJECTS)
def test_large_objects_are_imported(name, tmp_path):
    """How long it takes is measured by benchmarks/partnet_import.py."""
    folder = write_object(tmp_path / name, "StorageFurniture", OBJECTS[name]())
    obj = import_partnet(folder, cache_dir=tmp_path / "cache")
    assert sum(len(link.collisions) for link in obj.links) <= 80
