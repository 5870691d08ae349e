"""Films of episodes: played to the end, then drawn, robot and object as large as can be.

Of several directions the one is taken in which object, moved part, handles, hands, robot and goal are seen best,
which small pictures tell; from there the camera follows smoothly, without turning.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from artiskill.assets.handles import is_handle_part
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.observation import ObservationContext
from artiskill.envs.rendering import Viewpoint
from artiskill.evaluation.scene_pictures import PictureStyle, ScenePainter
from artiskill.evaluation.video import caption, caption_share
from artiskill.geometry.meshes import convex_hull
from artiskill.geometry.rotations import transform_points
from artiskill.scene.scene import Scene
from artiskill.sensors.camera import Camera
from artiskill.sensors.pictures.framing import following_cameras
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import BodyVisual, Renderer
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.free_object import ObjectPose
from artiskill.tasks.move_bucket import BucketGoal
from artiskill.tasks.open_cabinet import CabinetGoal
from artiskill.tasks.push_chair import ChairGoal
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
_HANDS = ("panda_hand", "panda_finger")
# shares of the picture: what something hidden counts as, four pixels of a trial, and what is seen well
_HIDDEN, _ENOUGH = 3e-4, 0.1


@dataclass(frozen=True)
class FrameDrawn:
    """News of a film: how far the drawing of its episode has come, in environment steps."""

    steps: int
    done: bool


class Film:
    """Collects the moments of one episode while it is played, and draws them.

    Args:
        style: how they are drawn.

    Attributes:
        instants: what is drawn: every second step, and the last.
    """

    def __init__(self, style: PictureStyle) -> None:
        self.instants: list[ObservationContext] = []
        self._style = style
        self._captions: list[str] = []
        self._env: ManipulationEnv | None = None

    def watch(self, env: ManipulationEnv, steps: int, done: bool) -> None:
        """See `run_episode`."""
        self._env = env
        if done or steps % STEPS_PER_FRAME == 0:
            level = env.save_state().level
            self.instants.append(ObservationContext(env.snapshot, env.goal, 0, level, steps))
            self._captions.append(episode_caption(env, done))

    def draw(self, on_frame: Callable[[FrameDrawn], Any] | None = None) -> list[np.ndarray]:
        """The frames, (H, W, 3) uint8 each; the last one stays for `LAST_FRAME_S`.

        Args:
            on_frame: called after each frame.
        """
        assert self._env is not None, "a film is drawn after its episode"
        env, last, frames = self._env, len(self.instants) - 1, []
        drawn = draw_instants(
            env.task, env.scene, env.save_state().target, self.instants, self._style, self._captions, CALM_FRAMES
        )
        for k, frame in enumerate(drawn):
            frames.append(frame)
            if on_frame is not None:
                on_frame(FrameDrawn(self.instants[k].elapsed, k == last))
        return frames + [frames[-1]] * round(LAST_FRAME_S * FRAMES_PER_S)


def draw_instants(
    task: Task,
    scene: Scene,
    target: str,
    instants: Sequence[ObservationContext],
    style: PictureStyle,
    captions: Sequence[str] = (),
    calm_frames: int = 0,
) -> Iterator[np.ndarray]:
    """Pictures of an episode from one direction, one after the other.

    Args:
        task: what is asked.
        scene: of the episode.
        target: the target link.
        instants: in order.
        style: how they are drawn.
        captions: a line for each; none for no captions.
        calm_frames: see `following_cameras`; 0 for pictures that stand beside one another.

    Raises:
        ConfigError: a size or viewpoint out of range.
    """
    height = style.size[1]
    below = caption_share(height) if captions and style.view != "all" else 0.0
    cameras: Sequence[Camera | None] = [None] * len(instants)
    if style.view != "sensor":
        moments = [instant.snapshot for instant in instants]
        cameras = film_cameras(task, scene, target, moments, style.viewpoint, style.size, below, calm_frames)
    painter = ScenePainter(task, scene, target, style)
    for k, (instant, camera) in enumerate(zip(instants, cameras, strict=True)):
        picture = painter.draw(instant, camera)
        yield caption(picture, captions[k]) if captions else picture


def episode_caption(env: ManipulationEnv, done: bool) -> str:
    """Object, target, how far open or how far from its goal, and how it ended."""
    state = env.save_state()
    parts = [state.object, state.target]
    goal = env.goal
    if isinstance(goal, CabinetGoal):
        opened = (env.snapshot.object_qpos[0, goal.joint[0]] - goal.lower[0]) / (goal.upper[0] - goal.lower[0])
        parts.append(f"{round(100 * max(0.0, opened))} % open")  # a closed drawer gives a little: no "-0 %"
    elif isinstance(goal, BucketGoal | ChairGoal):
        parts[1] = f"{ObjectPose(env.snapshot).distance_m[0]:.2f} m from its goal"
    if done:
        parts.append("success" if state.streaks.min() >= env.task.hold_steps else "not solved")
    return "  ·  ".join(parts)


# -- where the camera stands --------------------------------------------------------------------------------------


def film_cameras(
    task: Task,
    scene: Scene,
    target: str,
    moments: Sequence[Snapshot],
    viewpoint: Viewpoint,
    size: tuple[int, int],
    free_below: float = 0.0,
    calm_frames: int = 0,
) -> list[Camera]:
    """A camera for each moment of an episode.

    Args:
        task: what is asked.
        scene: of the episode.
        target: the target link.
        moments: all that are drawn, B = 1 each.
        viewpoint: a direction that is given is kept; a distance or a middle fixes the camera: `Viewpoint.camera`.
        size: width and height, pixels.
        free_below: see `following_cameras`, as the next one.
        calm_frames: .

    Raises:
        ConfigError: a size or viewpoint out of range.
    """
    if viewpoint.distance_m is not None or viewpoint.target_w is not None:
        return [viewpoint.camera(task.world_camera, *size)] * len(moments)
    points = shown_points(scene, moments)
    films = [
        following_cameras(points, *direction, *size, FOV_DEG, free_below=free_below, calm_frames=calm_frames)
        for direction in _directions(scene, viewpoint)
    ]
    return films[_best(scene, target, moments, films)] if len(films) > 1 else films[0]


def shown_points(scene: Scene, moments: Sequence[Snapshot]) -> list[np.ndarray]:
    """By moment, (N, 3) world: an outline of robot, object and props, as far as they stand above the floor.

    The lift's column goes into the floor. A wall that the object hangs on is left out.
    """
    outlines = _outlines(scene)
    found = []
    for moment in moments:
        positions, quaternions = moment.body_position_w[0], moment.body_quaternion_w[0]
        points = [transform_points(positions[body], quaternions[body], at) for body, at in outlines.items()]
        found.append(np.concatenate(points))
        np.maximum(found[-1][:, 2], 0.0, out=found[-1][:, 2])
    return found


def _outlines(scene: Scene) -> dict[int, np.ndarray]:
    """By body, the corners of the convex hull of what is drawn of it, in its frame."""
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
    """Azimuths and elevations, degrees, of which the best is chosen; what is given of them is kept."""
    found = [
        (
            azimuth if viewpoint.azimuth_deg is None else viewpoint.azimuth_deg,
            elevation if viewpoint.elevation_deg is None else viewpoint.elevation_deg,
        )
        for azimuth, elevation in (_AROUND if _is_free(scene) else _BEFORE_CABINETS)
    ]
    return list(dict.fromkeys(found))


def _best(scene: Scene, target: str, moments: Sequence[Snapshot], films: Sequence[Sequence[Camera]]) -> int:
    """Which of several films sees best what matters, by the sum of the logarithms of its shares of the pictures.

    By the logarithm, what is nearly hidden in one film weighs more than what is large in another; more than enough
    is worth no more, so that no robot stands before its cabinet for being large.
    """
    renderer = Renderer([BodyVisual(body, visual) for body, visual in scene.visuals], load_render_config("fast"))
    matters, (width, height) = _what_matters(scene, target), _TRIAL_PX
    merits = np.zeros(len(films))
    for k in np.linspace(0, len(moments) - 1, min(_TRIALS, len(moments))).astype(int).tolist():
        pose = moments[k].body_position_w[0], moments[k].body_quaternion_w[0]
        cameras = [replace(film[k], width=width, height=height) for film in films]
        geom = renderer.render(*pose, cameras, ("geom",)).geom.reshape(len(films), -1)
        for visuals in matters:
            merits += np.log(np.clip(np.isin(geom, visuals).mean(axis=1), _HIDDEN, _ENOUGH))
    return int(merits.argmax())


def _what_matters(scene: Scene, target: str) -> list[np.ndarray]:
    """Numbers of the visuals that must be seen: the object, what moves, its handles, hands, robot, and goal."""
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
    """Of the object's links, but not of a wall that it hangs on."""
    first = scene.index.object_bodies.start
    return [first + number for number in scene.object.own_links]


def _is_free(scene: Scene) -> bool:
    """Whether the object's root can move."""
    return scene.index.root_qpos.start < scene.index.root_qpos.stop
