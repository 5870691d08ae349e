"""Many states at once: the same pixels as one at a time, by any number of threads."""

import hashlib
import math
from dataclasses import replace

import numpy as np
import pytest

from artiskill.errors import ConfigError, StateError
from artiskill.sensors.camera import Camera, CameraBatch
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import CHANNELS, Images, Renderer

# first 48 bits of SHA-256 of the little scene's channels, in the fast quality: the same on every machine
GOLDEN = {
    "little": {
        "rgb": 116255455093550,
        "depth": 52887537399295,
        "position_w": 206917723261050,
        "geom": 83031268106330,
        "body": 1568742838580,
        "part": 97552231487221,
    },
    "inside": {
        "rgb": 102067446297919,
        "depth": 247956475717474,
        "position_w": 90697792778003,
        "geom": 55436841162792,
        "body": 55436841162792,
        "part": 93484311151935,
    },
}


@pytest.fixture(scope="module")
def renderer(little_scene):
    return Renderer(little_scene.visuals, load_render_config("fast"))


def states(scene, count):
    """Poses (B, N, 3), (B, N, 4) and cameras (B, 2)."""
    shifts = 0.05 * np.arange(count)[:, None, None] * np.array([1.0, -1.0, 0.5])
    quaternions = np.repeat(scene.quaternions_w[None], count, axis=0)
    cameras = [
        [scene.camera, Camera.look_at((0.1 * b, -2, 1), (0, 0, 0.5), width=160, height=120)] for b in range(count)
    ]
    return scene.positions_w + shifts, quaternions, cameras


def test_a_batch_is_its_states_one_by_one(little_scene, renderer):
    positions, quaternions, cameras = states(little_scene, 3)
    batch = renderer.render_batch(positions, quaternions, cameras, CHANNELS)
    assert batch.rgb.shape == (3, 2, 120, 160, 3)
    assert batch.part.shape == (3, 2, 120, 160)
    for b in range(3):
        alone = renderer.render(positions[b], quaternions[b], cameras[b], CHANNELS)
        for channel in CHANNELS:
            np.testing.assert_array_equal(batch[channel][b], alone[channel])


def test_threads_do_not_change_a_bit(little_scene, renderer):
    positions, quaternions, cameras = states(little_scene, 9)
    one, *more = (
        renderer.render_batch(positions, quaternions, cameras, CHANNELS, threads=threads)
        for threads in (1, 2, 3, 40)
    )
    for channel in CHANNELS:
        for other in more:
            assert one[channel].tobytes() == other[channel].tobytes()


def test_cameras_as_arrays_are_the_same_cameras(little_scene, renderer):
    positions, quaternions, cameras = states(little_scene, 2)
    cameras = [[replace(camera, fov_rad=1.0) for camera in one] for one in cameras]
    batch = CameraBatch(
        np.array([[c.position_w for c in one] for one in cameras]),
        np.array([[c.rotation_w for c in one] for one in cameras]),
        160,
        120,
        fov_rad=1.0,
    )
    a = renderer.render_batch(positions, quaternions, batch, CHANNELS)
    b = renderer.render_batch(positions, quaternions, cameras, CHANNELS)
    for channel in CHANNELS:
        np.testing.assert_array_equal(a[channel], b[channel])


def test_pictures_come_in_batches_too(little_scene):
    scene, picture = little_scene, Renderer(little_scene.visuals, load_render_config("picture"))
    positions, quaternions, cameras = states(scene, 2)
    batch = picture.render_batch(positions, quaternions, cameras, ("rgb", "geom"), threads=2)
    for b in range(2):
        alone = picture.render(positions[b], quaternions[b], cameras[b], ("rgb",))
        np.testing.assert_array_equal(batch.rgb[b], alone.rgb)


def test_results_may_be_written_over_earlier_ones(little_scene, renderer):
    poses, cameras = (little_scene.positions_w, little_scene.quaternions_w), [little_scene.camera]
    first = renderer.render(*poses, cameras, ("rgb", "depth"))
    expected = first.rgb.copy()
    first.rgb[:] = 7
    again = renderer.render(*poses, cameras, ("rgb",), out=first)
    assert again.rgb is first.rgb
    np.testing.assert_array_equal(again.rgb, expected)
    with pytest.raises(
        StateError, match=r"out\['rgb'\] must be a contiguous uint8 array of shape \(2, 120, 160, 3\)"
    ):
        renderer.render(*poses, cameras * 2, ("rgb",), out=first)
    flipped = Images({"depth": first.depth[:, ::-1]})
    with pytest.raises(StateError, match="contiguous"):
        renderer.render(*poses, cameras, ("depth",), out=flipped)


def test_parts_are_named(little_scene, make):
    visuals = [
        make.visual(item.visual.mesh, item.body, part=f"p{i % 2}") for i, item in enumerate(little_scene.visuals)
    ]
    renderer = Renderer(visuals, load_render_config("fast"))
    poses = little_scene.positions_w, little_scene.quaternions_w
    images = renderer.render(*poses, [little_scene.camera], ("part", "geom"))
    assert renderer.part_names == ("p0", "p1")
    np.testing.assert_array_equal(images.part, np.where(images.geom >= 0, images.geom % 2, images.geom))
    assert len(np.unique(images.part)) >= 3


def test_wrong_batches_are_named(little_scene, renderer):
    positions, quaternions, cameras = states(little_scene, 2)
    with pytest.raises(StateError, match="poses of 2 environments given, and cameras for 1"):
        renderer.render_batch(positions, quaternions, cameras[:1])
    with pytest.raises(ConfigError, match="same number of cameras"):
        renderer.render_batch(positions, quaternions, [cameras[0], cameras[1][:1]])
    with pytest.raises(StateError, match=r"shapes \(B, N, 3\)"):
        renderer.render_batch(positions[0], quaternions[0], cameras)
    with pytest.raises(ConfigError, match="threads must be at least 1, not 0"):
        renderer.render_batch(positions, quaternions, cameras, threads=0)
    positions[1, 4, 0] = np.inf
    with pytest.raises(StateError, match="body 4 is not finite in environment 1"):
        renderer.render_batch(positions, quaternions, cameras)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"positions_w": np.zeros((2, 3))}, "shapes"),
        ({"positions_w": np.full((2, 1, 3), np.nan)}, "finite"),
        ({"rotations_w": np.full((2, 1, 3, 3), np.nan)}, "rotation"),
        ({"rotations_w": np.tile(np.diag((1.0, 1.0, -1.0)), (2, 1, 1, 1))}, "rotation"),
        ({"width": 0}, "width"),
        ({"near_m": 20.0}, "near_m < far_m"),
    ],
)
def test_illegal_camera_arrays_are_named(change, message):
    legal = {
        "positions_w": np.zeros((2, 1, 3)),
        "rotations_w": np.tile(np.eye(3), (2, 1, 1, 1)),
        "width": 8,
        "height": 8,
    }
    with pytest.raises(ConfigError, match=message):
        CameraBatch(**{**legal, **change})


def digest(array):
    return int.from_bytes(hashlib.sha256(np.ascontiguousarray(array).tobytes()).digest()[:6], "big")


@pytest.mark.parametrize("scene", ["little", "inside"])
def test_pixels_are_the_golden_ones(little_scene, renderer, scene):
    """Whoever changes a pixel on purpose writes the new numbers down here."""
    inside = Camera.look_at(
        (-0.5, 0.9, 0.7), (0.0, 1.3, 0.7), width=200, height=80, fov_rad=math.radians(80), near_m=0.2
    )
    camera = little_scene.camera if scene == "little" else inside
    images = renderer.render(little_scene.positions_w, little_scene.quaternions_w, [camera], CHANNELS)
    assert {channel: digest(images[channel]) for channel in CHANNELS} == GOLDEN[scene]


def state_of(part: object) -> object:
    """Everything that can be reached from an object of ours, arrays as their place in memory and their bytes."""
    if isinstance(part, np.ndarray):
        return id(part), part.shape, part.tobytes()
    if isinstance(part, tuple | list):
        return [state_of(one) for one in part]
    if isinstance(part, dict):
        return {key: state_of(value) for key, value in part.items()}
    if type(part).__module__.startswith("artiskill"):
        return state_of(vars(part))
    return id(part)


@pytest.mark.parametrize("quality", ["fast", "picture"])
def test_drawing_changes_nothing_of_a_renderer(little_scene, quality):
    """So that any number of threads may share one: what is drawn on belongs to the thread."""
    renderer = Renderer(little_scene.visuals, load_render_config(quality))
    before = state_of(renderer)
    images = renderer.render(little_scene.positions_w, little_scene.quaternions_w, [little_scene.camera], CHANNELS)
    assert images.rgb.any()
    assert state_of(renderer) == before
