"""Moving pictures of episodes: each is played to its end, then drawn, robot and object as large as can be.

Of several directions the camera stands in the one that shows object, moved part, handles, hands, robot and goal
best, judged by small pictures; from there it follows smoothly, without turning.
"""

import atexit
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.handles import is_handle_part
from artiskill.envs.core import ObservationContext
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.rendering import Viewpoint
from artiskill.errors import ConfigError, shown
from artiskill.evaluation.evaluate import BatchJob, check_plan_workers, run_batches, run_episode
from artiskill.evaluation.plan import EpisodeBatch, EvaluationPlan
from artiskill.evaluation.scene_pictures import PictureStyle, PointsPanel, SceneRenderer
from artiskill.evaluation.video import caption, caption_share, write_video
from artiskill.files import check_output_folder, output_path
from artiskill.geometry.kernel_cache import do_not_announce, has_compiled
from artiskill.geometry.meshes import convex_hull
from artiskill.geometry.rotations import transform_points
from artiskill.jobs.fork_server import ForkServer
from artiskill.jobs.worker import Send
from artiskill.scene.scene import Scene
from artiskill.sensors.camera import Camera
from artiskill.sensors.drawing import picture_shading
from artiskill.sensors.pictures.compose import beside
from artiskill.sensors.pictures.framing import following_cameras
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import BodyVisual, Renderer
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.task import Task

STEPS_PER_FRAME = 2
FRAMES_PER_S = 10.0  # with 20 environment steps per second, as fast as life
LAST_FRAME_S = 1.0

FOV_DEG = 35.0  # as of objects alone
CALM_FRAMES = 6  # moves of the camera take twice as long
# (azimuth, elevation). Cabinets face 180 degrees. What stands free is looked at from the side of the sun, and from
# higher up, to show what is over the platform.
_BEFORE_CABINETS = tuple((float(a), e) for a in range(124, 237, 14) for e in (16.0, 28.0))
_AROUND = tuple((float(a), e) for a in range(112, 333, 20) for e in (24.0, 34.0))
_TRIALS = 8  # moments at which directions are compared
_TRIAL_PX = 128, 96
_ANY_TASK = "OpenCabinetDrawer"  # what draws is compiled once for all
_HANDS = ("panda_hand", "panda_finger")
# shares of the picture: what something hidden counts as, four pixels of a trial, and what is seen well
_HIDDEN, _ENOUGH = 3e-4, 0.1


@dataclass(frozen=True)
class FrameDrawn:
    """How far the drawing of an episode has come, in environment steps."""

    steps: int
    done: bool


def record_video(
    plan: EvaluationPlan,
    path: Path | str,
    count: int = 1,
    workers: int = 1,
    on_frame: Callable[[FrameDrawn], None] | None = None,
    step_timeout_s: float | None = None,
) -> Path:
    """Play the first level of the first objects of a plan again, and write what it looks like.

    The episodes are those of the report, because a level determines everything; the report does not depend on
    them.

    Args:
        plan: which episodes.
        path: ends in .gif, .webp or .mp4.
        count: how many objects; at most all of the plan.
        workers: processes that draw.
        on_frame: called after each frame; an episode is played before it is drawn.
        step_timeout_s: for each action, as in `evaluate`.

    Raises:
        ConfigError: an illegal path or number.
        PolicyError: the policy raises, returns no legal action, takes too long, or ends its process.
    """
    path = Path(path)
    check_video(path, count)
    check_plan_workers(plan, workers, step_timeout_s)
    strips = run_batches(_record, plan, plan.batches[:count], workers, on_frame, step_timeout_s)
    frames = [frame for strip in strips for frame in strip]
    try:
        return write_video(path, frames, FRAMES_PER_S)
    except OSError as error:
        raise ConfigError(f"cannot write the video {str(path)!r}: {error.strerror or error}") from error


def check_video(path: Path | str, count: int = 1) -> None:
    """See whether a video could be written, before anything is simulated.

    Raises:
        ConfigError: an unknown suffix, a folder that cannot be written to, or an illegal count.
        MissingExtraError: a format whose writer is not installed.
    """
    path = output_path(path)
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise ConfigError(f"the number of episodes in a video must be at least 1, not {shown(count)}")
    if path.is_dir():
        raise ConfigError(f"cannot write the video {str(path)!r}: it is a folder")
    check_output_folder(path.parent)
    with tempfile.TemporaryDirectory() as folder:  # the writer itself knows best what it can write
        write_video(Path(folder) / path.name, [np.zeros((16, 16, 3), np.uint8)], FRAMES_PER_S)


def prepare_films() -> None:
    """Have a process of its own compile what draws films, unless that is compiled on this machine.

    Returns at once: meanwhile the episodes are played, which compiles other kernels.
    """
    if has_compiled(picture_shading.__name__):
        return
    server = ForkServer()
    atexit.register(server.close)
    server.prepare(_compile_drawing)


def _compile_drawing() -> None:
    """Draw a moment, without the robot's cameras: what these need is compiled where the episodes are played."""
    do_not_announce()  # they say it
    env, recorder = ManipulationEnv(_ANY_TASK), EpisodeRecorder(PictureStyle())
    env.reset(seed=0)
    recorder.record(env, 0, True)
    recorder.draw()


def _record(job: BatchJob, send: Send) -> list[np.ndarray]:
    recorder = EpisodeRecorder(film_style(job.batch))
    with closing(job.load_policy(send)) as actor:
        run_episode(job.batch.make_env(), actor, job.batch.levels[0], recorder.record)
    return recorder.draw(send)


def film_style(batch: EpisodeBatch, width: int | None = None, height: int | None = None) -> PictureStyle:
    """Return how a batch's episodes are filmed: with the points that its policy is given, if it is given any."""
    view = "points" if batch.obs_mode == "pointcloud" else "world"
    return PictureStyle(view, width=width, height=height, sampling=batch.sampling)


class EpisodeRecorder:
    """Records the moments of one episode while it is played, and draws them.

    Args:
        style: how they are drawn.
        steps_per_frame: environment steps from one moment to the next.

    Attributes:
        moments: what is drawn: every so many steps, and the last.
    """

    def __init__(self, style: PictureStyle, steps_per_frame: int = STEPS_PER_FRAME) -> None:
        self.moments: list[ObservationContext] = []
        self._style, self._steps_per_frame = style, steps_per_frame
        self._captions: list[str] = []
        self._env: ManipulationEnv | None = None

    def record(self, env: ManipulationEnv, steps: int, done: bool) -> None:
        """Keep a moment, as `on_step` of `run_episode`."""
        self._env = env
        if done or steps % self._steps_per_frame == 0:
            level = env.save_state().level
            self.moments.append(ObservationContext(env.snapshot, env.goal, 0, level, steps))
            self._captions.append(episode_caption(env, done))

    def draw(self, on_frame: Callable[[FrameDrawn], Any] | None = None) -> list[np.ndarray]:
        """Draw the frames, (H, W, 3) uint8 each; the last one stays for `LAST_FRAME_S`.

        Args:
            on_frame: called after each frame.
        """
        assert self._env is not None, "an episode is drawn after it was played"
        env, last, frames = self._env, len(self.moments) - 1, []
        drawn = draw_moments(
            env.task, env.scene, env.save_state().target, self.moments, self._style, self._captions, CALM_FRAMES
        )
        for k, frame in enumerate(drawn):
            frames.append(frame)
            if on_frame is not None:
                on_frame(FrameDrawn(self.moments[k].elapsed, k == last))
        return frames + [frames[-1]] * round(LAST_FRAME_S * FRAMES_PER_S)


def draw_moments(
    task: Task,
    scene: Scene,
    target: str,
    moments: Sequence[ObservationContext],
    style: PictureStyle,
    captions: Sequence[str] = (),
    calm_frames: int = 0,
) -> Iterator[np.ndarray]:
    """Draw moments of an episode from one direction, one after the other.

    Args:
        task: what is asked.
        scene: of the episode.
        target: the target link.
        moments: in order.
        style: how they are drawn.
        captions: a line for each; none for no captions.
        calm_frames: see `following_cameras`; 0 for pictures that stand beside one another.

    Raises:
        ConfigError: a size or viewpoint out of range.
    """
    height = style.size[1]
    below = caption_share(height) if style.view == "points" or (captions and style.view != "all") else 0.0
    cameras: Sequence[Camera | None] = [None] * len(moments)
    if style.view != "sensor":
        snapshots = [moment.snapshot for moment in moments]
        cameras = episode_cameras(task, scene, target, snapshots, style.viewpoint, style.size, below, calm_frames)
    painter, panel = SceneRenderer(task, scene, target, style), None
    if style.view == "points" and cameras[0] is not None:
        panel = PointsPanel(task, scene, target, style.sampling, moments, cameras[0], below)
    for k, (moment, camera) in enumerate(zip(moments, cameras, strict=True)):
        picture = painter.draw(moment, camera)
        picture = caption(picture, captions[k]) if captions else picture
        yield picture if panel is None else beside([picture, panel.draw(k)])


def episode_caption(env: ManipulationEnv, done: bool) -> str:
    """Return a caption: object, target link but the root, how far the episode has come, and how it ended."""
    state = env.save_state()
    parts = [state.object]
    if state.target != env.scene.object.links[0].name:  # the root is the whole object
        parts.append(state.target)
    if env.task.describe_progress is not None:
        parts.append(env.task.describe_progress(env.snapshot, env.goal))
    if done:
        parts.append("success" if state.streaks.min() >= env.task.hold_steps else "not solved")
    return "  ·  ".join(parts)


def episode_cameras(
    task: Task,
    scene: Scene,
    target: str,
    snapshots: Sequence[Snapshot],
    viewpoint: Viewpoint,
    size: tuple[int, int],
    free_below: float = 0.0,
    calm_frames: int = 0,
) -> list[Camera]:
    """Return a camera for each moment of an episode.

    Args:
        task: what is asked.
        scene: of the episode.
        target: the target link.
        snapshots: of all moments, B = 1 each.
        viewpoint: a direction that is given is kept; a distance or a middle fixes the camera: `Viewpoint.camera`.
        size: width and height, pixels.
        free_below: see `following_cameras`.
        calm_frames: likewise.

    Raises:
        ConfigError: a size or viewpoint out of range.
    """
    if viewpoint.distance_m is not None or viewpoint.target_w is not None:
        return [viewpoint.camera(task.world_camera, *size)] * len(snapshots)
    points = shown_points(scene, snapshots)
    films = [
        following_cameras(points, *direction, *size, FOV_DEG, free_below=free_below, calm_frames=calm_frames)
        for direction in _directions(scene, viewpoint)
    ]
    return films[_best(scene, target, snapshots, films)] if len(films) > 1 else films[0]


def shown_points(scene: Scene, snapshots: Sequence[Snapshot]) -> list[np.ndarray]:
    """Return by moment, (N, 3) world: an outline of robot, object and props, as far as they stand above the floor.

    The lift's column goes into the floor. A wall that the object hangs on is left out.
    """
    outlines = _outlines(scene)
    found = []
    for snapshot in snapshots:
        positions, quaternions = snapshot.body_position_w[0], snapshot.body_quaternion_w[0]
        points = [transform_points(positions[body], quaternions[body], at) for body, at in outlines.items()]
        found.append(np.concatenate(points))
        np.maximum(found[-1][:, 2], 0.0, out=found[-1][:, 2])
    return found


def _outlines(scene: Scene) -> dict[int, np.ndarray]:
    """Return by body the corners of its drawn parts' convex hull, in its frame."""
    first, last = scene.index.object_bodies.start, scene.index.object_bodies.stop
    own = set(_object_bodies(scene))
    vertices: dict[int, list[np.ndarray]] = {}
    for body, visual in scene.visuals:
        if (body in own or not first <= body < last) and len(visual.mesh.vertices):
            vertices.setdefault(body, []).append(visual.mesh.vertices)
    return {body: _hull_corners(np.concatenate(meshes)) for body, meshes in vertices.items()}


def _hull_corners(points: np.ndarray) -> np.ndarray:
    try:
        return convex_hull(points).mesh.vertices
    except ValueError:  # flat: a drawn plate
        return points


def _directions(scene: Scene, viewpoint: Viewpoint) -> list[tuple[float, float]]:
    """Return azimuths and elevations (degrees) to choose from; those that are given are kept."""
    found = [
        (
            azimuth if viewpoint.azimuth_deg is None else viewpoint.azimuth_deg,
            elevation if viewpoint.elevation_deg is None else viewpoint.elevation_deg,
        )
        for azimuth, elevation in (_AROUND if _is_free(scene) else _BEFORE_CABINETS)
    ]
    return list(dict.fromkeys(found))


def _best(scene: Scene, target: str, snapshots: Sequence[Snapshot], films: Sequence[Sequence[Camera]]) -> int:
    """Return which camera path shows best what matters, by the sum of the logarithms of picture shares.

    By the logarithm, what is nearly hidden in one film weighs more than what is large in another; more than enough
    is worth no more, so that no robot stands before its cabinet for being large.
    """
    renderer = Renderer([BodyVisual(body, visual) for body, visual in scene.visuals], load_render_config("fast"))
    matters, (width, height) = _what_matters(scene, target), _TRIAL_PX
    merits = np.zeros(len(films))
    for k in np.linspace(0, len(snapshots) - 1, min(_TRIALS, len(snapshots))).astype(int).tolist():
        pose = snapshots[k].body_position_w[0], snapshots[k].body_quaternion_w[0]
        cameras = [replace(film[k], width=width, height=height) for film in films]
        geom = renderer.render(*pose, cameras, ("geom",)).geom.reshape(len(films), -1)
        for visuals in matters:
            merits += np.log(np.clip(np.isin(geom, visuals).mean(axis=1), _HIDDEN, _ENOUGH))
    return int(merits.argmax())


def _what_matters(scene: Scene, target: str) -> list[np.ndarray]:
    """Return numbers of visuals that must be seen: object, moved part, handles, hands, robot and goal."""
    bodies = np.array([body for body, _ in scene.visuals])
    robot = scene.robot.bodies
    number = {name: scene.model.body(name).id for name in (*robot, *(prop.body for prop in scene.props))}
    whole = np.isin(bodies, _object_bodies(scene))
    moved = bodies == scene.index.object_bodies.start + scene.object.link_index(target)
    handles = moved & np.array([is_handle_part(visual.part) for _, visual in scene.visuals])
    hands = np.isin(bodies, [number[name] for name, part in robot.items() if part in _HANDS])
    goals = np.isin(bodies, [number[prop.body] for prop in scene.props if prop.motion != "free"])
    groups = [whole, hands, np.isin(bodies, [number[name] for name in robot]), goals]
    if not _is_free(scene):
        groups += [moved, handles]
    return [np.flatnonzero(group) for group in groups if group.any()]


def _object_bodies(scene: Scene) -> list[int]:
    """Return the bodies of the object's links, without a wall that it hangs on."""
    first = scene.index.object_bodies.start
    return [first + number for number in scene.object.own_links]


def _is_free(scene: Scene) -> bool:
    """Whether the object's root can move."""
    return scene.index.root_qpos.start < scene.index.root_qpos.stop
