"""Pictures and films of a report's page: objects, and episodes that are played again by their actions."""

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import object_id_of, object_of
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError
from artiskill.evaluation.evaluate import prepare_workers, run_episode
from artiskill.evaluation.plan import EpisodeBatch, EvaluationPlan
from artiskill.evaluation.policies import Actor
from artiskill.evaluation.recording import FRAMES_PER_S, EpisodeRecorder, film_style
from artiskill.evaluation.statistics import EpisodeResult
from artiskill.jobs.parallel import run_jobs
from artiskill.jobs.worker import Send
from artiskill.sensors.pictures.objects import CLOSED, ObjectView, OrbitView

FILM_SPEED = 2  # times as fast as life
_STEPS_PER_FRAME = 4
_WIDTH, _HEIGHT, _QUALITY = 360, 270, 58  # of a film; of each of two pictures side by side
_OBJECT_WIDTH, _OBJECT_HEIGHT, _OBJECT_QUALITY, _OPEN = 240, 180, 78, 0.4
_EFFORT = 4  # of WebP's encoder, 0 to 6


@dataclass(frozen=True, eq=False)
class Film:
    """An episode as a page shows it.

    Attributes:
        episode: what happened.
        film: animated WebP, which every browser plays.
        poster: the last moment, WebP.
    """

    episode: EpisodeResult
    film: bytes
    poster: bytes


@dataclass(frozen=True, eq=False)
class FilmJob:
    """An episode that is to be played again and drawn.

    Attributes:
        batch: that it is of.
        episode: as the report says.
        actions: (T, A).
    """

    batch: EpisodeBatch
    episode: EpisodeResult
    actions: np.ndarray


class _ReplayActor(Actor):
    """Acts as a report says."""

    name = "replay"

    def __init__(self, actions: np.ndarray) -> None:
        self._actions = iter(actions)

    def reset(self, env: ManipulationEnv, observation: object, info: dict[str, object]) -> None:
        """Begin the episode."""

    def act(self, env: ManipulationEnv, observation: object) -> np.ndarray:
        """Return the next action; zeros, if there are no more."""
        return next(self._actions, np.zeros(env.control.size))

    def close(self) -> None:
        """Nothing has to be ended."""


def choose_films(
    plan: EvaluationPlan, episodes: Sequence[EpisodeResult], actions: Sequence[np.ndarray], most: int
) -> list[FilmJob]:
    """Return the first success and the first failure of each of the first rows, but none that a fault ended.

    Args:
        plan: of the report.
        episodes: all of them, in its order.
        actions: of each.
        most: rows.
    """
    chosen, first = [], 0
    for batch in plan.batches[:most]:
        numbers = range(first, first + len(batch.levels))
        first = numbers.stop
        for wanted in (True, False):
            found = next((k for k in numbers if episodes[k].success is wanted and not episodes[k].fault), None)
            if found is not None:
                chosen.append(FilmJob(batch, episodes[found], actions[found]))
    return chosen


def draw_films(jobs: Sequence[FilmJob], workers: int, on_film: Callable[[EpisodeResult], None]) -> list[Film]:
    """Play episodes again, and draw them.

    Args:
        jobs: which.
        workers: processes.
        on_film: called after each, in no fixed order.

    Raises:
        ConfigError: one of them does not happen as the report says.
    """
    if min(workers, len(jobs)) > 1:
        prepare_workers(replace(jobs[0].batch, obs_mode="state", sampling=None))
    return run_jobs(_draw_film, jobs, workers, on_film, lambda job: job.batch.label)


def _draw_film(job: FilmJob, send: Send) -> Film:
    env = replace(job.batch, obs_mode="state", sampling=None).make_env()
    recorder = EpisodeRecorder(film_style(job.batch, _WIDTH, _HEIGHT), _STEPS_PER_FRAME)
    played = run_episode(env, _ReplayActor(job.actions), job.episode.level, recorder.record)
    if played != job.episode or len(job.actions) != played.length:
        where = f"{played.object}, level {played.level}"
        raise ConfigError(
            f"{where}: played again, the episode comes out otherwise than reported: the report is forged, or of "
            "other versions; `artiskill report verify` says which"
        )
    frames = recorder.draw()
    send(job.episode)
    return Film(job.episode, _webp(frames, _QUALITY), _webp(frames[-1:], _QUALITY))


def _webp(frames: Sequence[np.ndarray], quality: int) -> bytes:
    """Return pictures (H, W, 3) uint8 as a film, or a single one as a picture."""
    file, images = io.BytesIO(), [Image.fromarray(np.ascontiguousarray(frame)) for frame in frames]
    moving = {"save_all": True, "append_images": images[1:], "duration": round(1000 / FRAMES_PER_S), "loop": 0}
    images[0].save(file, "WEBP", quality=quality, method=_EFFORT, **(moving if len(images) > 1 else {}))
    return file.getvalue()


def draw_objects(items: Sequence[str | ArticulatedObject], workers: int) -> dict[str, bytes]:
    """Return a small picture of each object, WebP, by id."""
    return dict(run_jobs(_draw_object, items, workers, None, object_id_of))


def _draw_object(item: str | ArticulatedObject, send: Send) -> tuple[str, bytes]:
    obj = object_of(item)
    view = ObjectView(obj)
    camera = view.camera((CLOSED, _OPEN), OrbitView(_OBJECT_WIDTH, _OBJECT_HEIGHT))
    return obj.id, _webp([view.draw(_OPEN, camera)], _OBJECT_QUALITY)
