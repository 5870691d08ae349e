import os
import re
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from artiskill.assets.articulated_object import ROOM_WALL, Link, Material, VisualMesh
from artiskill.assets.catalog import load_object
from artiskill.envs.core import ObservationContext
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.rendering import Viewpoint
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ConfigError
from artiskill.evaluation.evaluate import run_episode, run_evaluation
from artiskill.evaluation.pictures import EpisodeChoice, save_episode_picture
from artiskill.evaluation.plan import plan_evaluation
from artiskill.evaluation.policies import load_policy
from artiskill.evaluation.recording import (
    CALM_FRAMES,
    EpisodeRecorder,
    FrameDrawn,
    check_video,
    episode_cameras,
    episode_caption,
    record_video,
    shown_points,
)
from artiskill.evaluation.scene_pictures import PictureStyle, given_points
from artiskill.evaluation.statistics import EpisodeResult
from artiskill.evaluation.video import caption_share
from artiskill.geometry.primitives import box
from artiskill.geometry.rotations import transform_points
from artiskill.scene.scene import Scene, cached_scene
from artiskill.sensors.camera import Camera
from artiskill.sensors.pictures.compose import GAP_PX
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import BodyVisual, Renderer
from artiskill.sim.snapshot import Snapshot

_PREPARE = """
from artiskill.evaluation.pictures import EpisodeChoice, save_episode_picture
from artiskill.evaluation.recording import prepare_films
from artiskill.evaluation.scene_pictures import PictureStyle
from artiskill.geometry.kernel_cache import has_compiled, kernel_folder
from artiskill.jobs import fork_server

def kept():
    return {path.name for path in kernel_folder().glob("*artiskill.sensors.drawing*.nbc")}

started, ForkServer = [], fork_server.ForkServer
prepare = ForkServer.prepare
ForkServer.prepare = lambda self, call: (started.append(self), prepare(self, call))
assert not has_compiled("artiskill.sensors.drawing.picture_shading")
prepare_films()
[server] = started
server.start()  # it forks when it has done what it was told
prepared = kept()
prepare_films()
save_episode_picture("look.png", EpisodeChoice("OpenCabinetDrawer", "cabinet-0005"), PictureStyle())
print(len(started), len(prepared) > 10, kept() == prepared)
"""


@pytest.mark.slow
def test_what_draws_films_is_compiled_ahead_once(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    command = [sys.executable, "-c", _PREPARE]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert (done.stdout, done.returncode) == ("1 True True\n", 0), done.stderr


def test_a_short_film_that_changes_no_number(tmp_path: Path) -> None:
    plan = plan_evaluation(
        "OpenCabinetDrawer", "expert", ["cabinet-0005", "cabinet-0010"], 1, config={"episode_steps": 5}
    )
    before = run_evaluation(plan)
    news: list[FrameDrawn] = []
    path = record_video(plan, tmp_path / "film.gif", count=1, on_frame=news.append)
    after = run_evaluation(plan)
    assert before.episodes == after.episodes
    assert [item.steps for item in news] == [0, 2, 4, 5]
    assert [item.done for item in news] == [False, False, False, True]
    with Image.open(path) as image:
        assert image.size == (640, 480)
        duration = 0
        for k in range(getattr(image, "n_frames", 1)):
            image.seek(k)
            duration += image.info["duration"]
    assert duration == 100 * 4 + 1000  # milliseconds: every second step, and the end for a second longer


@pytest.mark.parametrize(("name", "count"), [("film.avi", 1), ("film", 1), ("film.gif", 0), ("film.gif", 1.5)])
def test_impossible_films_are_refused_beforehand(tmp_path: Path, name: str, count: int) -> None:
    with pytest.raises(ConfigError):
        check_video(tmp_path / name, count)
    assert not list(tmp_path.iterdir())


def test_a_folder_is_no_film(tmp_path: Path) -> None:
    (tmp_path / "film.gif").mkdir()
    with pytest.raises(ConfigError, match="it is a folder"):
        check_video(tmp_path / "film.gif")


@pytest.mark.parametrize(
    ("task", "object_id", "says"),
    [
        ("OpenCabinetDrawer", "cabinet-0005", r"cabinet-0005  ·  link_\d  ·  0 % open"),
        ("PushChair", "chair-0029", r"chair-0029  ·  [01]\.\d\d m from its goal"),
        ("MoveBucket", "bucket-0004", r"bucket-0004  ·  [01]\.\d\d m from its goal"),
    ],
)
def test_captions_say_what_and_how_far(task: str, object_id: str, says: str) -> None:
    env = ManipulationEnv(task, objects=object_id)
    env.reset(seed=0)
    assert re.fullmatch(says, episode_caption(env, done=False))
    assert re.fullmatch(says + "  ·  not solved", episode_caption(env, done=True))
    env.task = replace(env.task, describe_progress=None)
    assert re.fullmatch(r"\w+-\d+(  ·  link_\d)?", episode_caption(env, done=False))


EPISODES = {
    "OpenCabinetDrawer": ("cabinet-0005", 1),
    "OpenCabinetDoor": ("cabinet-0056", 0),
    "PushChair": ("chair-0029", 4),
    "MoveBucket": ("bucket-0004", 5),
}
SIZE = 160, 120
CAPTION = caption_share(SIZE[1])
# what robot, object and goal fill of each frame: of its width or its height, and of its area
SIDE_SHARE, AREA_SHARE = 0.65, 0.3


@dataclass(frozen=True)
class Played:
    """An expert's episode."""

    env: ManipulationEnv
    film: EpisodeRecorder
    result: EpisodeResult

    @property
    def moments(self) -> list[Snapshot]:
        return [instant.snapshot for instant in self.film.moments]

    def cameras(self, viewpoint: Viewpoint | None = None) -> list[Camera]:
        where = self.env.task, self.env.scene, self.result.target, self.moments
        return episode_cameras(*where, viewpoint or Viewpoint(), SIZE, CAPTION, CALM_FRAMES)


@pytest.fixture(scope="module", params=EPISODES)
def played(request: pytest.FixtureRequest) -> Played:
    object_id, level = EPISODES[request.param]
    env, film = (
        ManipulationEnv(request.param, objects=object_id),
        EpisodeRecorder(PictureStyle(width=SIZE[0], height=SIZE[1])),
    )
    return Played(env, film, run_episode(env, load_policy("expert"), level, film.record))


def bounds(camera: Camera, scene: Scene, moment: Snapshot, props: bool = True) -> np.ndarray:
    """(2, 2) least and greatest x and y of every drawn vertex above the floor, as shares of the picture."""
    left_out = set() if props else {scene.model.body(prop.body).id for prop in scene.props}
    points = np.concatenate(
        [
            transform_points(moment.body_position_w[0, b], moment.body_quaternion_w[0, b], v.mesh.vertices)
            for b, v in scene.visuals
            if b not in left_out
        ]
    )
    points[:, 2] = np.maximum(points[:, 2], 0.0)  # the lift's column goes into the floor
    seen = (points @ camera.extrinsics[:3, :3].T + camera.extrinsics[:3, 3]) @ camera.intrinsics.T
    places = seen[:, :2] / seen[:, 2:] / (camera.width, camera.height)
    return np.stack((places.min(axis=0), places.max(axis=0)))


def test_every_frame_is_filled_and_nothing_leaves_it(played: Played) -> None:
    for camera, moment in zip(played.cameras(), played.moments, strict=True):
        low, high = bounds(camera, played.env.scene, moment)
        assert (low >= 0.0).all()
        assert high[0] <= 1.0
        assert high[1] <= 1.0 - CAPTION, "the caption hides nothing"
        assert (high - low).max() >= SIDE_SHARE
        assert (high - low).prod() >= AREA_SHARE


def test_the_camera_moves_gently_and_never_turns(played: Played) -> None:
    cameras = played.cameras()
    path = np.array([camera.position_w for camera in cameras])
    assert all((camera.rotation_w == cameras[0].rotation_w).all() for camera in cameras)
    speed = np.diff(path, axis=0)  # metres per frame of 0.1 s
    assert np.linalg.norm(speed, axis=1).max() < 0.2
    assert np.linalg.norm(np.diff(speed, axis=0), axis=1).max() < 0.03


def test_what_is_moved_is_seen(played: Played) -> None:
    """The target link, or all of what stands free, and the hands, in nine of ten frames."""
    scene, target = played.env.scene, played.result.target
    renderer = Renderer([BodyVisual(b, v) for b, v in scene.visuals], load_render_config("fast"))
    bodies, first = np.array([b for b, _ in scene.visuals]), scene.index.object_bodies.start
    links = range(len(scene.object.links)) if scene.props else [scene.object.link_index(target)]
    moved = np.flatnonzero(np.isin(bodies, [first + link for link in links]))
    parts = scene.robot.bodies.items()
    hands = np.flatnonzero(np.isin(bodies, [scene.model.body(n).id for n, part in parts if part == "panda_hand"]))
    for visuals in (moved, hands):
        shares = [
            np.isin(
                renderer.render(m.body_position_w[0], m.body_quaternion_w[0], [c], ("geom",)).geom, visuals
            ).mean()
            for c, m in zip(played.cameras(), played.moments, strict=True)
        ]
        assert np.quantile(shares, 0.1) > 0.001


def test_the_last_moment_is_the_success(played: Played) -> None:
    last = played.film.moments[-1]
    assert played.result.success
    assert last.elapsed == played.result.length
    assert all(bool(flag[0]) for flag in played.env.task.flags(last.snapshot, last.goal).values())
    if played.env.task.name == "MoveBucket":
        x, y, z = last.snapshot.link_position_w[0, 0].tolist()
        platform = next(prop for prop in played.env.scene.props if prop.name == "platform")
        assert max(abs(x), abs(y)) < platform.size[0]
        assert z > 2 * platform.position_m[2]


def test_a_direction_that_is_given_is_kept(played: Played) -> None:
    given = played.cameras(Viewpoint(azimuth_deg=170.0, elevation_deg=40.0))
    backward = given[0].rotation_w[:, 2]
    assert np.degrees(np.arctan2(backward[1], backward[0])) == pytest.approx(170.0)
    assert np.degrees(np.arcsin(backward[2])) == pytest.approx(40.0)
    low, high = bounds(given[-1], played.env.scene, played.moments[-1])
    assert low.min() >= 0.0
    assert high.max() <= 1.0
    orbit = played.cameras(Viewpoint(distance_m=4.0))
    home = Viewpoint(distance_m=4.0).camera(played.env.task.world_camera, *SIZE)
    assert all((camera.position_w == home.position_w).all() for camera in orbit)


def test_a_film_ends_with_the_success_for_a_second(tmp_path: Path) -> None:
    """The frames of the file, from the caption's "success" on."""
    object_id, level = EPISODES["MoveBucket"]
    style = PictureStyle(width=80, height=60)
    path = save_episode_picture(tmp_path / "a.webp", EpisodeChoice("MoveBucket", object_id, level=level), style)
    env, film = ManipulationEnv("MoveBucket", objects=object_id), EpisodeRecorder(style)
    assert run_episode(env, load_policy("expert"), level, film.record).success
    frames = film.draw()
    assert all((frame == frames[-1]).all() for frame in frames[-10:])
    with Image.open(path) as image:
        shown = [(np.asarray(f.convert("RGB")), f.info["duration"]) for f in ImageSequence.Iterator(image)]
    assert np.abs(shown[-1][0].astype(int) - frames[-1]).mean() < 3.0  # WebP loses a little
    assert sum(duration for _, duration in shown) == pytest.approx(100 * len(frames), abs=1)


def test_a_wall_may_leave_the_picture() -> None:
    env = ManipulationEnv("OpenCabinetDoor", objects="cabinet-0056")
    env.reset(seed=0)
    obj = load_object("cabinet-0056")
    surface = VisualMesh(box((0.05, 2.0, 1.2)), Material("paint", (0.9, 0.9, 0.9, 1.0)), "wall")
    upright, origin = np.array((1.0, 0.0, 0.0, 0.0)), np.array((0.6, 0.0, 1.2))
    wall = Link(ROOM_WALL, 0, origin, upright, None, (surface,), (), 1000.0, np.zeros((0, 3)))
    hung = replace(obj, links=(*obj.links, wall))
    scene = cached_scene(env.task.robot, hung, env.task.physics, env.task.props)
    with_wall = ManipulationEnv("OpenCabinetDoor", objects=[hung])
    with_wall.reset(seed=0)
    assert len(scene.visuals) == len(env.scene.visuals) + 1
    plain, walled = shown_points(env.scene, [env.snapshot])[0], shown_points(scene, [with_wall.snapshot])[0]
    np.testing.assert_allclose(walled.max(axis=0), plain.max(axis=0))
    np.testing.assert_allclose(walled.min(axis=0), plain.min(axis=0))


@pytest.mark.parametrize("sampling", [Sampling(64, "shares", "robot", {"shares": [32, 16, 8, 8]}), Sampling(96)])
def test_the_points_of_a_film_are_those_that_the_policy_was_given(sampling: Sampling) -> None:
    env = ManipulationEnv("OpenCabinetDrawer", ["cabinet-0005"], obs_mode="pointcloud")
    replace(sampling, frame="world").wrap(env)
    observation, _ = env.reset(options={"level": 3})
    given, moments = [], []
    for step in range(3):
        given.append({name: part.copy() for name, part in observation["pointcloud"].items()})
        moments.append(ObservationContext(env.snapshot, env.goal, 0, 3, step))
        observation, *_ = env.step(np.full(13, 0.5))
    shown = list(given_points(env.task, env.scene, env.save_state().target, sampling, moments))
    for cloud, wanted in zip(shown, given, strict=True):
        seen = wanted["xyz"].any(axis=1)
        assert 0 < seen.sum() == len(cloud["xyz"])
        assert all(np.array_equal(cloud[name], wanted[name][seen]) for name in wanted)


def test_a_cloud_policy_is_filmed_with_its_points(tmp_path: Path) -> None:
    plan = plan_evaluation(
        "MoveBucket", "still", ["bucket-0001"], 1, obs_mode="pointcloud", config={"episode_steps": 2}
    )
    film = record_video(plan, tmp_path / "film.webp")
    with Image.open(film) as image:
        width, height = image.size
        assert (width, height) == (2 * 480 + GAP_PX, 360)
        panel = np.asarray(image.convert("RGB"))[:, -480:].astype(int)
    share = (np.abs(panel - 28).max(axis=2) > 16).mean()
    assert 0.05 < share < 0.95, "squares before the dark"
