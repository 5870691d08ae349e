"""Moving pictures of episodes: what a report's numbers look like."""

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.errors import ConfigError
from artiskill.evaluation.episodes import run_episode
from artiskill.evaluation.evaluate import check_workers
from artiskill.evaluation.film import FRAMES_PER_S, Film, FrameDrawn
from artiskill.evaluation.plan import EpisodeBatch, Plan
from artiskill.evaluation.policies import load_policy
from artiskill.evaluation.report_files import check_folder
from artiskill.evaluation.scene_pictures import PictureStyle
from artiskill.evaluation.time_limit import TimedActor
from artiskill.evaluation.video import write_video
from artiskill.jobs.parallel import run_jobs


def record_video(
    plan: Plan,
    path: Path | str,
    count: int = 1,
    workers: int = 1,
    on_frame: Callable[[FrameDrawn], None] | None = None,
    step_timeout_s: float | None = None,
) -> Path:
    """Play the first level of the first objects of a plan again, and write what it looks like.

    The episodes are those of the report, because a level fixes everything; the report does not depend on them.

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
    check_workers(plan, workers, step_timeout_s)
    strips = run_jobs(
        partial(_record, limit_s=step_timeout_s),
        plan.batches[:count],
        workers,
        on_frame,
        describe=lambda batch: batch.label,
        own_process=step_timeout_s is not None,
    )
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
    path = Path(path)
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise ConfigError(f"the number of episodes in a video must be at least 1, not {count!r}")
    if path.is_dir():
        raise ConfigError(f"cannot write the video {str(path)!r}: it is a folder")
    check_folder(path.parent)
    with tempfile.TemporaryDirectory() as folder:  # the writer itself knows best what it can write
        write_video(Path(folder) / path.name, [np.zeros((16, 16, 3), np.uint8)], FRAMES_PER_S)


def _record(batch: EpisodeBatch, tell: Callable[[Any], None], limit_s: float | None = None) -> list[np.ndarray]:
    film = Film(PictureStyle())
    actor = load_policy(batch.policy)
    if limit_s is not None:
        actor = TimedActor(actor, limit_s, tell)
    run_episode(batch.make_env(), actor, batch.levels[0], film.watch)
    return film.draw(tell)
