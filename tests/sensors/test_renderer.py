import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from artiskill.errors import ConfigError, StateError, UnknownNameError
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import box, sphere
from artiskill.sensors.camera import Camera
from artiskill.sensors.drawing.backdrop import FLOOR, NOTHING
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import CHANNELS, Renderer

GEOMETRY = ("depth", "position_w", "geom", "body")
NO_FLOOR = {"floor.enabled": False}
AHEAD = Camera.look_at((-2, 0, 1), (0, 0, 1), width=64, height=48, near_m=0.1, far_m=10)


def fast(visuals, **overrides):
    return Renderer(visuals, load_render_config("fast", overrides.get("overrides")))


def draw(visuals, camera, channels=CHANNELS, overrides=None):
    return fast(visuals, overrides=overrides).render(np.zeros((0, 3)), np.zeros((0, 4)), [camera], channels)


def rays(camera):
    """Directions (H, W, 3) in the world, of length 1 along the optical axis."""
    rows, columns = np.indices((camera.height, camera.width)) + 0.5
    pixels = np.stack((columns, rows, np.ones_like(rows)), axis=-1)
    return pixels @ np.linalg.inv(camera.intrinsics).T @ camera.extrinsics[:3, :3]


def first_hits(origin, directions, corners):
    """Möller-Trumbore over all pairs: depth (R,) and triangle (R,), -1 for none."""
    a, b, c = (corners[:, i] for i in range(3))
    best, which = np.full(len(directions), np.inf), np.full(len(directions), -1)
    for i, direction in enumerate(directions):
        p = np.cross(direction, c - a)
        det = ((b - a) * p).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = origin - a
            u = (s * p).sum(axis=1) / det
            q = np.cross(s, b - a)
            v = (q @ direction) / det
            t = ((c - a) * q).sum(axis=1) / det
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        if hit.any():
            which[i] = np.argmin(np.where(hit, t, np.inf))
            best[i] = t[which[i]]
    return best, which


def test_floor_has_its_analytic_depth_and_position():
    camera = Camera.look_at((0.3, -0.2, 1.4), (2.0, 1.0, 0.2), width=80, height=60, far_m=6.0)
    images = draw([], camera, GEOMETRY)
    directions = rays(camera)
    depth = np.where(directions[..., 2] < 0, -1.4 / directions[..., 2], np.inf)
    seen = (depth < 6.0) & (depth > 0)
    np.testing.assert_array_equal(images.geom[0], np.where(seen, FLOOR, NOTHING))
    np.testing.assert_array_equal(images.body[0], images.geom[0])
    np.testing.assert_allclose(images.depth[0], np.where(seen, depth, 0), rtol=1e-6)
    points = camera.position_w + directions * np.where(seen, depth, 0)[..., None]
    np.testing.assert_allclose(images.position_w[0], np.where(seen[..., None], points, 0), atol=1e-5)


def test_floor_is_not_seen_from_below_nor_when_switched_off():
    below = Camera.look_at((0, 0, -1), (1, 0, 1), width=8, height=8)
    assert (draw([], below).geom == NOTHING).all()
    assert (draw([], AHEAD, overrides=NO_FLOOR).geom == NOTHING).all()


def test_sphere_has_its_analytic_depth(make):
    ball = make.visual(sphere(0.5, 192, 65).transformed((0, 0, 1)))
    images = draw([ball], AHEAD, GEOMETRY, NO_FLOOR)
    directions = rays(AHEAD).reshape(-1, 3)
    offset = AHEAD.position_w - (0, 0, 1)
    half_b = directions @ offset
    squares = (directions**2).sum(axis=1)
    root = half_b**2 - squares * (offset @ offset - 0.25)
    depth = ((-half_b - np.sqrt(np.maximum(root, 0))) / squares).reshape(48, 64)
    well_inside = root.reshape(48, 64) > 0.05
    assert well_inside.sum() > 200
    np.testing.assert_allclose(images.depth[0][well_inside], depth[well_inside], atol=5e-4)
    assert (images.geom[0][root.reshape(48, 64) < -0.02] == NOTHING).all()


def test_ids_depth_and_positions_agree_with_ray_casting(little_scene, rng):
    scene = little_scene
    renderer = Renderer(scene.visuals, load_render_config("fast", {**NO_FLOOR}))
    images = renderer.render(scene.positions_w, scene.quaternions_w, [scene.camera], GEOMETRY)
    geom, depth = images.geom[0], images.depth[0]
    calm = np.zeros(geom.shape, dtype=bool)  # away from silhouettes: all neighbours show the same
    calm[1:-1, 1:-1] = np.all(
        [geom[1 + i : 119 + i, 1 + j : 159 + j] == geom[1:-1, 1:-1] for i in (-1, 0, 1) for j in (-1, 0, 1)],
        axis=0,
    )
    rows, columns = rng.integers(0, 120, 400), rng.integers(0, 160, 400)
    rows, columns = (
        np.append(rows, np.argwhere(geom == 1)[:20, 0]),
        np.append(columns, np.argwhere(geom == 1)[:20, 1]),
    )
    keep = calm[rows, columns]
    rows, columns = rows[keep], columns[keep]
    directions = rays(scene.camera)[rows, columns]
    corners, corner_geom = scene.triangles_w()
    expected, which = first_hits(scene.camera.position_w, directions, corners)
    ids = np.where(which >= 0, corner_geom[which], NOTHING)
    assert len(rows) > 250
    assert len(np.unique(ids)) >= 6
    np.testing.assert_array_equal(geom[rows, columns], ids)
    bodies = np.array([item.body for item in scene.visuals])
    world_fixed = np.where(bodies[ids] < 0, FLOOR, bodies[ids])
    np.testing.assert_array_equal(images.body[0][rows, columns], np.where(ids >= 0, world_fixed, NOTHING))
    hit = ids >= 0
    np.testing.assert_allclose(depth[rows, columns][hit], expected[hit], rtol=2e-5)
    points = scene.camera.position_w + directions[hit] * expected[hit, None]
    np.testing.assert_allclose(images.position_w[0][rows, columns][hit], points, atol=1e-4)
    assert (depth[rows, columns][~hit] == 0).all()


def test_neighbouring_triangles_leave_no_gap(make, rng):
    """A crumpled sheet that fills the view shows no pixel of what is behind it."""
    n = 40
    grid = np.stack(np.meshgrid(np.linspace(-4, 4, n), np.linspace(-4, 4, n), indexing="ij"), axis=-1)
    grid = grid + rng.uniform(-0.06, 0.06, grid.shape)
    vertices = np.column_stack((rng.uniform(0, 0.02, n * n), grid.reshape(-1, 2) + np.array((0, 1))))
    quads = np.arange(n * n).reshape(n, n)
    a, b, c, d = (q.reshape(-1) for q in (quads[:-1, :-1], quads[1:, :-1], quads[1:, 1:], quads[:-1, 1:]))
    mesh = TriMesh(vertices, np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1))))
    images = draw([make.visual(mesh)], replace(AHEAD, width=640, height=480), ("geom",), NO_FLOOR)
    assert (images.geom == 0).all()


def test_what_crosses_the_near_plane_is_cut_there(make):
    plank = make.visual(box((3.0, 0.3, 0.01)).transformed((0, 0, 0.7)))
    images = draw([plank], AHEAD, GEOMETRY, NO_FLOOR)
    seen = images.geom[0] == 0
    assert seen[-1].any()  # it runs below the camera, out of the picture
    np.testing.assert_allclose(images.position_w[0][seen][:, 2], 0.71, atol=1e-4)
    assert images.depth[0][seen].min() >= AHEAD.near_m


def test_a_camera_inside_a_closed_body_sees_through_it(make):
    around = make.visual(box((0.3, 0.3, 0.3)).transformed((-2, 0, 1)))
    ball = make.visual(sphere(0.5).transformed((0, 0, 1)))
    images = draw([around, ball], AHEAD, GEOMETRY, NO_FLOOR)
    assert set(np.unique(images.geom)) == {NOTHING, 1}


def test_an_open_sheet_is_seen_and_lit_from_both_sides(make):
    sheet = make.visual(make.sheet().transformed((0, 0, 1)))
    behind = Camera.look_at((2, 0, 1), (0, 0, 1), width=64, height=48)
    for camera in (AHEAD, behind):
        images = draw([sheet], camera)
        assert images.geom[0, 24, 32] == 0
        assert images.rgb[0, 24, 32].min() > 40


def test_hostile_triangles_are_survived(make):
    huge, tiny = 1e12, 1e-14
    vertices = np.array(
        [
            [0, 0, 1],
            [0, 1, 1],
            [0, 0, 1],
            [-2, 0, 1],
            [-2, 0, 1 + tiny],
            [huge, huge, 1],
            [-huge, 3, huge],
            [1, -huge, 2],
        ]
    )
    faces = np.array([[0, 1, 2], [0, 0, 0], [3, 4, 5], [5, 6, 7], [3, 6, 7], [0, 3, 5], [1, 5, 6]])
    for camera in (AHEAD, replace(AHEAD, width=1, height=1), replace(AHEAD, near_m=1e-9, far_m=1e9)):
        images = draw([make.visual(TriMesh(vertices, faces))], camera)
        for channel in CHANNELS:
            assert np.isfinite(images[channel]).all()


def test_one_pixel_and_empty_scenes():
    camera = Camera.look_at((0, 0, 1), (1, 0, 0), width=1, height=1)
    images = draw([], camera)
    assert images.rgb.shape == (1, 1, 1, 3)
    assert images.depth[0, 0, 0] == pytest.approx(math.sqrt(2))
    images = draw([], Camera.look_at((0, 0, 1), (0, 0, 2), width=5, height=3))
    assert (images.geom == NOTHING).all()
    assert (images.depth == 0).all()
    assert (images.position_w == 0).all()


def test_texture_stands_upright(make):
    texture = np.zeros((2, 2, 3), dtype=np.uint8)
    texture[0, 0], texture[0, 1], texture[1, 0], texture[1, 1] = (
        (255, 0, 0),
        (0, 255, 0),
        (0, 0, 255),
        (255, 255, 0),
    )
    texture = texture.repeat(8, axis=0).repeat(8, axis=1)
    sheet = make.visual(make.sheet().transformed((0, 0, 1)), colour=(1, 1, 1), texture=texture)
    for quality in ("fast", "picture"):
        renderer = Renderer([sheet], load_render_config(quality, {"shadows.enabled": False}))
        rgb = renderer.render(np.zeros((0, 3)), np.zeros((0, 4)), [AHEAD]).rgb[0].astype(int)
        top_left, top_right, low_left, low_right = rgb[18, 26], rgb[18, 38], rgb[30, 26], rgb[30, 38]
        assert top_left[0] > 2 * max(top_left[1:])
        assert top_right[1] > 2 * max(top_right[0], top_right[2])
        assert low_left[2] > 2 * max(low_left[:2])
        assert min(low_right[:2]) > 2 * low_right[2]


def test_smooth_surfaces_are_shaded_smoothly(make):
    ball = make.visual(sphere(0.5, 24, 7).transformed((0, 0, 1)))
    row = (
        draw([ball], replace(AHEAD, width=640, height=480), ("rgb",), NO_FLOOR).rgb[0, 200, 250:390, 0].astype(int)
    )
    assert np.abs(np.diff(row)).max() <= 6
    assert np.ptp(row) > 20


def test_only_what_is_asked_for_is_there(little_scene):
    scene = little_scene
    renderer = fast(scene.visuals)
    images = renderer.render(scene.positions_w, scene.quaternions_w, [scene.camera] * 2, ("depth",))
    assert images.depth.shape == (2, 120, 160)
    assert images.depth.dtype == np.float32
    with pytest.raises(UnknownNameError, match=r"'rgb'.*depth"):
        _ = images.rgb


@pytest.mark.parametrize("quality", ["fast", "picture"])
def test_drawing_twice_gives_the_same_bits(little_scene, quality):
    scene = little_scene
    first, second = (Renderer(scene.visuals, load_render_config(quality)) for _ in range(2))
    other = np.roll(scene.positions_w, 1, axis=0)
    second.render(other, scene.quaternions_w, [AHEAD])  # an earlier state leaves no trace
    for channel in CHANNELS:
        a, b = (
            r.render(scene.positions_w, scene.quaternions_w, [scene.camera], CHANNELS)[channel]
            for r in (first, second)
        )
        assert a.tobytes() == b.tobytes()


def test_geometry_is_the_same_in_both_qualities(little_scene):
    scene = little_scene
    a, b = (
        Renderer(scene.visuals, load_render_config(q)).render(
            scene.positions_w, scene.quaternions_w, [scene.camera], CHANNELS
        )
        for q in ("fast", "picture")
    )
    for channel in GEOMETRY:
        np.testing.assert_array_equal(a[channel], b[channel])


def test_wrong_requests_are_named(little_scene):
    scene = little_scene
    renderer = fast(scene.visuals)
    poses = scene.positions_w, scene.quaternions_w
    with pytest.raises(UnknownNameError, match="did you mean 'depth'"):
        renderer.render(*poses, [scene.camera], ("dept",))
    with pytest.raises(ConfigError, match="no camera"):
        renderer.render(*poses, [])
    with pytest.raises(ConfigError, match="64 x 48, 160 x 120"):
        renderer.render(*poses, [scene.camera, AHEAD])
    with pytest.raises(StateError, match=r"\(7, 3\) and \(6, 4\)"):
        renderer.render(poses[0], poses[1][:6], [scene.camera])
    with pytest.raises(StateError, match="poses of 3 bodies"):
        renderer.render(poses[0][:3], poses[1][:3], [scene.camera])
    broken = poses[0].copy()
    broken[4, 1] = np.nan
    with pytest.raises(StateError, match="body 4 is not finite"):
        renderer.render(broken, poses[1], [scene.camera])


_DIGEST = """
import hashlib
import numpy as np
from artiskill.assets.articulated_object import Material, VisualMesh
from artiskill.geometry.primitives import box, sphere
from artiskill.sensors.camera import Camera
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import CHANNELS, Renderer
from artiskill.sensors.renderer import BodyVisual

def digest():
    red = Material("red", (0.8, 0.1, 0.1, 1.0))
    visuals = [BodyVisual(0, VisualMesh(m, red, "p")) for m in (box((0.3, 0.2, 0.5)), sphere(0.45))]
    camera = Camera.look_at((-2, -1, 1.5), (0, 0, 0.5), width=96, height=64)
    total = hashlib.sha256()
    for quality in ("fast", "picture"):
        renderer = Renderer(visuals, load_render_config(quality))
        images = renderer.render(np.array([(0, 0, 0.5)]), np.array([(0.8, 0, 0, 0.6)]), [camera], CHANNELS)
        for channel in CHANNELS:
            total.update(images[channel].tobytes())
    return total.hexdigest()
"""


def test_two_processes_give_the_same_bits():
    here: dict = {}
    exec(_DIGEST, here)
    there = subprocess.run(
        [sys.executable, "-c", _DIGEST + "\nprint(digest())"], capture_output=True, text=True, check=True
    )
    assert there.stdout.strip() == here["digest"]()


@pytest.mark.slow
def test_no_kernel_leaves_its_arrays(root, tmp_path):
    """Numba's bounds check turns a stray index into an error: run this file and the pictures' with it."""
    environment = {**os.environ, "NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    tests = [
        str(root / "tests" / "sensors" / name)
        for name in (
            "test_renderer.py",
            "test_batch.py",
            "drawing/test_picture_shading.py",
            "observations/test_raster_buffers.py",
        )
    ]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", *tests], env=environment, cwd=root, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout
