"""Moving pictures of episodes: what a report's numbers look like."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.errors import ConfigError, shown
from artiskill.evaluation.episodes import run_episode
from artiskill.evaluation.evaluate import BatchJob, check_workers, run_batches
from artiskill.evaluation.film import FRAMES_PER_S, Film, FrameDrawn
from artiskill.evaluation.plan import Plan
from artiskill.evaluation.report_files import check_folder
from artiskill.evaluation.scene_pictures import PictureStyle
from artiskill.evaluation.video import write_video
from artiskill.files import output_path


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
    check_folder(path.parent)
    with tempfile.TemporaryDirectory() as folder:  # the writer itself knows best what it can write
        write_video(Path(folder) / path.name, [np.zeros((16, 16, 3), np.uint8)], FRAMES_PER_S)


def _record(job: BatchJob, tell: Callable[[Any], None]) -> list[np.ndarray]:
    film = Film(PictureStyle())
    run_episode(job.batch.make_env(), job.load_policy(tell), job.batch.levels[0], film.watch)
    return film.draw(tell)
