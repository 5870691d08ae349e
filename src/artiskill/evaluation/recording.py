"""Moving pictures of episodes: what a report's numbers look like."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError, shown
from artiskill.evaluation.episodes import run_episode
from artiskill.evaluation.evaluate import BatchJob, check_workers, run_batches
from artiskill.evaluation.plan import Plan
from artiskill.evaluation.report_files import check_folder
from artiskill.evaluation.video import caption, write_video
from artiskill.jobs.whole_files import output_path
from artiskill.tasks.open_cabinet.goal import OpenGoal

STEPS_PER_FRAME = 2
FRAMES_PER_S = 10.0  # with 20 environment steps per second, as fast as life
LAST_FRAME_S = 1.0


@dataclass(frozen=True)
class FrameDrawn:
    """News of a recording: how far its episode has come, in environment steps."""

    steps: int
    done: bool


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
        on_frame: called after each frame.
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
    frames: list[np.ndarray] = []

    def watch(env: ManipulationEnv, steps: int, done: bool) -> None:
        if done or steps % STEPS_PER_FRAME == 0:
            frames.append(caption(env.render(), episode_caption(env, done)))
            tell(FrameDrawn(steps, done))

    run_episode(job.batch.make_env("rgb_array"), job.load_policy(tell), job.batch.levels[0], watch)
    return frames + [frames[-1]] * round(LAST_FRAME_S * FRAMES_PER_S)


def episode_caption(env: ManipulationEnv, done: bool) -> str:
    """Object, target, how far open, and how it ended."""
    state = env.save_state()
    parts = [state.object, state.target]
    goal = env.goal
    if isinstance(goal, OpenGoal):
        opened = (env.snapshot.object_qpos[0, goal.joint[0]] - goal.lower[0]) / (goal.upper[0] - goal.lower[0])
        parts.append(f"{round(100 * max(0.0, opened))} % open")  # a closed drawer gives a little: no "-0 %"
    if done:
        parts.append("success" if state.streaks.min() >= env.task.hold_steps else "not solved")
    return "  ·  ".join(parts)
