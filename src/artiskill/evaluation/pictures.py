"""Still and moving pictures of one episode, or of an object alone, written to a file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object, resolve_objects
from artiskill.envs.control import JOINT
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.observation import ObservationContext
from artiskill.envs.rendering import HEIGHT, WIDTH, Viewpoint
from artiskill.errors import ConfigError, shown
from artiskill.evaluation.episodes import play_steps, run_episode
from artiskill.evaluation.film import FRAMES_PER_S, LAST_FRAME_S, Film, draw_instants
from artiskill.evaluation.policies import load_policy
from artiskill.evaluation.recording import check_video
from artiskill.evaluation.report_files import check_folder
from artiskill.evaluation.scene_pictures import PictureStyle, check_size
from artiskill.evaluation.video import write_video
from artiskill.files import atomic_write, output_path
from artiskill.sensors.pictures.objects import AZIMUTH_DEG, CLOSED, ELEVATION_DEG, ObjectView
from artiskill.sensors.render_config import RenderConfig
from artiskill.tasks.levels import check_level

STILL_SUFFIXES = (".png", ".jpg")
MOVING_SUFFIXES = (".gif", ".webp", ".mp4")
_SWEEP_FRAMES = 20  # of an object's joints, one way


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
    check_folder(path.parent)
    return False


def picture_episode(path: Path | str, episode: EpisodeChoice, style: PictureStyle, step: int = 0) -> Path:
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
        raise ConfigError("a step is for still pictures; a moving one shows the whole episode")
    level = check_level(episode.level)
    actor = load_policy(episode.policy) if moving or step else None
    obj = _one_object(episode.object, episode.task)
    env = ManipulationEnv(
        task=episode.task,
        objects=[obj],
        target=episode.target,
        obs_mode=getattr(actor, "obs_mode", None) or "state",
        control_mode=getattr(actor, "control_mode", None) or JOINT,
        config=episode.config,
    )
    if not moving or actor is None:
        play_steps(env, actor, level, step)
        instants = [ObservationContext(env.snapshot, env.goal, 0, level, step)]
        return write_picture(path, *draw_instants(env.task, env.scene, env.save_state().target, instants, style))
    film = Film(style)
    run_episode(env, actor, level, film.watch)
    return _write_frames(path, film.draw())


def picture_object(
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
        path: as in `picture_episode`.
        obj: id, name or path of an object, or one.
        opened: shares of the joints' ranges, as `joint_fractions` of `render_object`; None for closed in a still
            picture and wide open in the middle of a moving one.
        width: pixels; None for the usual.
        height: pixels, likewise.
        viewpoint: by default in front, and as near as the whole object allows.
        look: how it is drawn; None for the usual.

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
    view, place = ObjectView(found, look), viewpoint or Viewpoint()
    camera = view.camera(
        (CLOSED, opened),
        width or WIDTH,
        height or HEIGHT,
        AZIMUTH_DEG if place.azimuth_deg is None else place.azimuth_deg,
        ELEVATION_DEG if place.elevation_deg is None else place.elevation_deg,
        distance_m=place.distance_m,
        target_w=place.target_w,
    )
    if not moving:
        return write_picture(path, view.draw(opened, camera))
    shares = (1.0 - np.cos(np.linspace(0.0, np.pi, _SWEEP_FRAMES))) / 2.0  # starts and ends gently
    there = [view.draw(np.asarray(opened) * share, camera) for share in shares.tolist()]
    pause = round(LAST_FRAME_S * FRAMES_PER_S)
    return _write_frames(path, [*there, *[there[-1]] * pause, *there[::-1]])


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
