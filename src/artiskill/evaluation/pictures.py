"""Still and moving pictures of one episode, of an object alone, or of demonstrations, written to a file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object, resolve_objects
from artiskill.config import check, merge_overrides
from artiskill.demos.demo_file import DemoFile, Trajectory
from artiskill.envs.control import JOINT
from artiskill.envs.core import ObservationContext
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.rendering import HEIGHT, WIDTH, Viewpoint
from artiskill.errors import ConfigError, shown
from artiskill.evaluation.evaluate import run_episode
from artiskill.evaluation.policies import Actor, load_policy, policy_of_task
from artiskill.evaluation.recording import FRAMES_PER_S, LAST_FRAME_S, EpisodeRecorder, check_video, draw_moments
from artiskill.evaluation.scene_pictures import PictureStyle, check_size
from artiskill.evaluation.video import write_video
from artiskill.files import atomic_write, check_output_folder, output_path
from artiskill.geometry.rotations import quat_to_matrix
from artiskill.sensors.camera import Camera
from artiskill.sensors.pictures.compose import below, beside
from artiskill.sensors.pictures.objects import AZIMUTH_DEG, CLOSED, ELEVATION_DEG, ObjectView, OrbitView
from artiskill.sensors.render_config import RenderConfig
from artiskill.tasks.levels import check_level

STILL_SUFFIXES = (".png", ".jpg")
MOVING_SUFFIXES = (".gif", ".webp", ".mp4")
_SWEEP_FRAMES = 20  # of an object's joints, one way
_SAMPLES = 10  # of a trajectory, when it is compared with others
_HAND_SHARE = 0.3  # weight of joints, in radians, beside the base's place in metres


@dataclass(frozen=True)
class EpisodeChoice:
    """Which episode is shown; the fields are as in `evaluate`.

    Attributes:
        task: name of the task.
        object: id, name or path of an object.
        target: the target link; None if the level draws one.
        level: of the episode.
        policy: `expert`, `random`, `still` (action zero), or a solution file.
        config: changed values of the task's configuration.
    """

    task: str
    object: str | ArticulatedObject
    target: str | None = None
    level: int = 0
    policy: Any = "expert"
    config: Mapping[str, Any] = field(default_factory=dict)

    def make_env(self, actor: Actor | None = None) -> ManipulationEnv:
        """Return an environment in which the actor sees and acts as it declares; None for nobody.

        Raises:
            UnknownNameError: an unknown task, object or target link.
            ConfigError: several objects, or an illegal configuration value.
            AssetError: an object that cannot be read or used for the task.
        """
        env = ManipulationEnv(
            task=self.task,
            objects=[_one_object(self.object, self.task)],
            target=self.target,
            obs_mode=getattr(actor, "obs_mode", None) or "state",
            control_mode=getattr(actor, "control_mode", None) or JOINT,
            config=merge_overrides(getattr(actor, "observation_config", None) or {}, self.config),
        )
        sampling = getattr(actor, "sampling", None)
        if sampling is not None:  # the wrapper changes the environment itself
            sampling.wrap(env)
        return env


def check_picture(path: Path | str) -> bool:
    """See whether a picture could be written; returns whether it is a moving one.

    Raises:
        ConfigError: an unknown suffix, a folder, or one that cannot be written to.
        MissingExtraError: a format whose writer is not installed.
    """
    path = output_path(path)
    suffix = path.suffix.lower()
    if suffix in MOVING_SUFFIXES:
        check_video(path)
        return True
    if suffix not in STILL_SUFFIXES:
        legal = ", ".join((*STILL_SUFFIXES, *MOVING_SUFFIXES))
        raise ConfigError(f"a picture's name must end in {legal}, not {shown(path.name)}")
    if path.is_dir():
        raise ConfigError(f"cannot write the picture {str(path)!r}: it is a folder")
    check_output_folder(path.parent)
    return False


def save_episode_picture(path: Path | str, episode: EpisodeChoice, style: PictureStyle, step: int = 0) -> Path:
    """Write a still picture of an episode after some steps, or a moving one of all of it.

    Args:
        path: ends in .png or .jpg for a still picture, in .gif, .webp or .mp4 for a moving one.
        episode: which episode.
        style: what is shown.
        step: of a still picture: how many steps the policy has acted.

    Raises:
        UnknownNameError: an unknown task, object, target link or policy.
        ConfigError: a path, level, step, size or configuration value that is not legal.
        AssetError: an object that cannot be read or used for the task.
        PolicyError: a policy that cannot be used.
    """
    moving = check_picture(path)
    if moving and step:
        raise ConfigError("a step is only for still pictures; a video shows the whole episode")
    level = check_level(episode.level)
    plays = moving or step > 0 or style.view == "points"  # which shows what the policy is given
    actor = load_policy(policy_of_task(episode.policy, episode.task), episode.task) if plays else None
    style = replace(style, sampling=getattr(actor, "sampling", None)) if style.sampling is None else style
    env = episode.make_env(actor)
    if not moving or actor is None:
        _run_steps(env, actor, level, step)
        contexts = [ObservationContext(env.snapshot, env.goal, 0, level, step)]
        return write_picture(path, *draw_moments(env.task, env.scene, env.save_state().target, contexts, style))
    recorder = EpisodeRecorder(style)
    run_episode(env, actor, level, recorder.record)
    return _write_frames(path, recorder.draw())


def _run_steps(env: ManipulationEnv, actor: Actor | None, level: int, steps: int) -> None:
    """Run the first steps of an episode; the environment is left there.

    Args:
        env: as in `run_episode`.
        actor: the policy; None for 0 steps.
        level: which episode.
        steps: how many.

    Raises:
        ConfigError: a negative number, or the episode is over before.
        PolicyError: the policy raises or returns no legal action.
    """
    if steps < 0:
        raise ConfigError(f"the number of steps must not be negative, not {steps}")
    observation, info = env.reset(options={"level": level})
    if steps == 0 or actor is None:
        return
    actor.reset(env, observation, info)
    for step in range(1, steps + 1):
        observation, _, terminated, truncated, info = env.step(actor.act(env, observation))
        if (terminated or truncated) and step < steps:
            how = "solved" if info["success"] else "cut off"
            raise ConfigError(f"step {steps} does not exist: the episode is {how} after {step} steps")


def save_object_picture(
    path: Path | str,
    obj: str | Path | ArticulatedObject,
    opened: float | Sequence[float] | None = None,
    width: int | None = None,
    height: int | None = None,
    viewpoint: Viewpoint | None = None,
    look: RenderConfig | None = None,
) -> Path:
    """Write a still picture of an object alone, or a moving one in which its joints go there and back.

    Args:
        path: as in `save_episode_picture`.
        obj: id, name or path of an object, or one.
        opened: shares of the joints' ranges, as `joint_fractions` of `render_object`; None for closed in a still
            picture and wide open in the middle of a moving one.
        width: pixels; None for the default.
        height: pixels; None for the default.
        viewpoint: by default in front, and as near as the whole object allows.
        look: how it is drawn; None for the default.

    Raises:
        UnknownNameError: no such object.
        ConfigError: a path, share or size that is not legal.
        AssetError: an object that cannot be read or drawn.
    """
    moving = check_picture(path)
    check_size(width, height)
    if opened is None:
        opened = 1.0 if moving else CLOSED
    found = obj if isinstance(obj, ArticulatedObject) else load_object(obj)
    view = ObjectView(found, look)
    camera = _object_camera(view, opened, width or WIDTH, height or HEIGHT, viewpoint or Viewpoint())
    if not moving:
        return write_picture(path, view.draw(opened, camera))
    shares = (1.0 - np.cos(np.linspace(0.0, np.pi, _SWEEP_FRAMES))) / 2.0  # starts and ends gently
    there = [view.draw(np.asarray(opened) * share, camera) for share in shares.tolist()]
    pause = round(LAST_FRAME_S * FRAMES_PER_S)
    return _write_frames(path, [*there, *[there[-1]] * pause, *there[::-1]])


def _object_camera(
    view: ObjectView, opened: float | Sequence[float], width: int, height: int, place: Viewpoint
) -> Camera:
    """Return the camera that shows an object whole, closed and opened, where the viewpoint leaves that open."""
    azimuth_deg = AZIMUTH_DEG if place.azimuth_deg is None else place.azimuth_deg
    elevation_deg = ELEVATION_DEG if place.elevation_deg is None else place.elevation_deg
    found = OrbitView(
        width, height, azimuth_deg, elevation_deg, distance_m=place.distance_m, target_w=place.target_w
    )
    return view.camera((CLOSED, opened), found)


def save_demos_picture(
    path: Path | str,
    file: DemoFile,
    style: PictureStyle,
    count: int = 5,
    moments: int = 5,
    target: str | None = None,
    given: ArticulatedObject | None = None,
) -> list[int]:
    """Write a picture of the most different demonstrations of an object: a row each, time from left to right.

    Args:
        path: ends in .png or .jpg.
        file: of the object's demonstrations.
        style: how each moment is drawn.
        count: rows; all demonstrations, where there are fewer.
        moments: of each, evenly spaced from its begin to its end.
        target: only demonstrations of this link.
        given: the object, where no name leads to it.

    Returns:
        The numbers of the demonstrations, in order.

    Raises:
        ConfigError: an illegal path or number, or no demonstrations of the target.
        DemoError: the file is damaged, or of another catalogue.
    """
    check(not check_picture(path), f"strips are still pictures, .png or .jpg, not {Path(path).name!r}")
    check(count >= 1, f"the number of demonstrations must be at least 1, not {count}")
    check(moments >= 2, f"the number of moments must be at least 2, not {moments}")
    numbers = [k for k in range(len(file)) if target is None or file.trajectory(k).target == target]
    check(bool(numbers), f"{str(file.path)!r} has no demonstrations of {target or 'anything'}")
    chosen = most_different(file, numbers, count)
    obj = file.load_object(given)
    rows = [_strip(file.trajectory(number), file, obj, style, moments) for number in chosen]
    write_picture(path, below(rows))
    return chosen


def most_different(file: DemoFile, numbers: list[int], count: int) -> list[int]:
    """Return the numbers of demonstrations: the first, then always the one farthest from all chosen before.

    Far is how the robot goes: its base in the object's frame at the begin, and its joints.
    """
    ways = np.stack([_way(file.trajectory(number)) for number in numbers])
    chosen, nearest = [0], np.linalg.norm(ways - ways[0], axis=1)
    while len(chosen) < min(count, len(numbers)):
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(ways - ways[chosen[-1]], axis=1))
    return sorted(numbers[k] for k in chosen)


def _way(trajectory: Trajectory) -> np.ndarray:
    """Return some moments of a trajectory, side by side."""
    states = trajectory.states
    steps = np.linspace(0, len(trajectory), _SAMPLES).astype(int)
    robot = states["robot_qpos"][steps].astype(np.float64)
    turn = quat_to_matrix(states["root_quaternion_w"][0].astype(np.float64))[:2, :2]
    base = (robot[:, :2] - states["root_position_w"][0, :2]) @ turn
    return np.concatenate((base, _HAND_SHARE * robot[:, 3:]), axis=1).ravel()


def _strip(
    trajectory: Trajectory, file: DemoFile, obj: ArticulatedObject, style: PictureStyle, moments: int
) -> np.ndarray:
    """Simulate a demonstration again and draw its moments side by side, from one direction."""
    env = file.make_env(obj=obj)
    env.reset(options={"level": trajectory.level, "object": obj, "target": trajectory.target})
    steps = np.linspace(0, len(trajectory), moments).astype(int).tolist()
    contexts = [ObservationContext(env.snapshot, env.goal, 0, trajectory.level, 0)]
    for step, action in enumerate(trajectory.actions, start=1):
        env.step(action)
        if step in steps:
            contexts.append(ObservationContext(env.snapshot, env.goal, 0, trajectory.level, step))
    seconds = [context.elapsed * env.snapshot.step_s for context in contexts]
    captions = [f"level {trajectory.level}, {trajectory.target}, {time_s:.1f} s" for time_s in seconds]
    return beside(list(draw_moments(env.task, env.scene, trajectory.target, contexts, style, captions)))


def write_picture(path: Path | str, picture: np.ndarray) -> Path:
    """Write (H, W, 3) uint8 as PNG or JPEG, by the suffix; the file appears whole or not at all.

    Raises:
        ConfigError: it cannot be written.
    """
    path = output_path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as temporary:
            Image.fromarray(np.ascontiguousarray(picture)).save(temporary, optimize=True, quality=92)
    except OSError as error:
        raise ConfigError(f"cannot write the picture {str(path)!r}: {error.strerror or error}") from error
    return path


def _write_frames(path: Path | str, frames: list[np.ndarray]) -> Path:
    try:
        return write_video(path, frames, FRAMES_PER_S)
    except OSError as error:
        raise ConfigError(f"cannot write the picture {str(path)!r}: {error.strerror or error}") from error


def _one_object(given: str | ArticulatedObject, task: str) -> ArticulatedObject:
    found = resolve_objects(given, task=task)
    if len(found) != 1:
        raise ConfigError(f"a picture shows one object, not {shown(given)}, which names {len(found)}")
    return load_object(found[0]) if isinstance(found[0], str) else found[0]
