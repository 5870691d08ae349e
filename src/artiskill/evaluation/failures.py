"""How episodes of a report failed: how far each got, by the stages of the task's reward, and what it lacked.

They are played again by their actions, without the policy.
"""

import csv
import io
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.demos.demonstrator import fault_kind
from artiskill.errors import ConfigError
from artiskill.evaluation.action_replay import ActionReplay, ReplayJob, replay_jobs
from artiskill.evaluation.statistics import EpisodeResult
from artiskill.evaluation.stored_report import read_report
from artiskill.evaluation.verify import plan_again, play_again
from artiskill.files import atomic_write
from artiskill.jobs.parallel import check_workers
from artiskill.jobs.worker import Send
from artiskill.tasks.registry import make_task
from artiskill.tasks.staged_reward import STAGE_TERM
from artiskill.tasks.task import Task


class FailureKind(NamedTuple):
    """What failed episodes have in common.

    Attributes:
        furthest: name of the last stage of the task's reward that was reached.
        final: name of the stage at the end.
        missing: conditions of success that did not count at the end.
        fault: its kind, if a fault ended the episode; else empty.
    """

    furthest: str
    final: str
    missing: tuple[str, ...]
    fault: str


@dataclass(frozen=True)
class FailedEpisode:
    """An episode that was not solved."""

    object: str
    target: str
    level: int
    kind: FailureKind


@dataclass(frozen=True)
class Failures:
    """The failed episodes of a report.

    Attributes:
        task: of the report.
        played: episodes of the report.
        episodes: those that failed, in the report's order.
    """

    task: str
    played: int
    episodes: tuple[FailedEpisode, ...]

    def by_kind(self) -> list[tuple[FailureKind, Counter[str]]]:
        """Return the kinds, the commonest first, with how often each object failed so."""
        found: dict[FailureKind, Counter[str]] = {}
        for episode in self.episodes:
            found.setdefault(episode.kind, Counter())[episode.object] += 1
        return sorted(found.items(), key=lambda item: -item[1].total())


def find_failures(
    folder: Path | str,
    workers: int = 1,
    on_episode: Callable[[EpisodeResult], None] | None = None,
    objects: Sequence[str | ArticulatedObject] = (),
) -> Failures:
    """Play the failed episodes of a report again, and return how far each one got.

    Args:
        folder: of the report.
        workers: processes.
        on_episode: called after each, in no fixed order.
        objects: that the report's own names do not lead to, imported ones say, or their folders' names.

    Raises:
        ConfigError: a file is missing or damaged, the task's reward has no stages, or an episode goes otherwise
            than the report says.
        ArtiSkillError: there is no such task, configuration, object, target or mode.
    """
    check_workers(workers)
    stored = read_report(folder)
    said, actions, plan = stored.episodes(), stored.actions(), plan_again(stored.report, objects)
    stage_bonus(plan.task)
    failed = {place: episode for place, episode in enumerate(said) if not episode.success}
    jobs = replay_jobs(plan, actions, [episode.fault for episode in said], failed)
    found = [one for part in play_again(_play, jobs, workers, on_episode) for one in part]
    for (result, _), episode in zip(found, failed.values(), strict=True):
        if result != episode:
            where = f"{episode.object}, level {episode.level}"
            raise ConfigError(f"{where} goes otherwise than the report says; `artiskill report verify` says how")
    episodes = tuple(FailedEpisode(one.object, one.target, one.level, kind) for one, kind in found)
    return Failures(stored.report.task, len(said), episodes)


def write_failures(found: Failures, path: Path) -> None:
    """Write a line for each failed episode as CSV.

    Raises:
        ConfigError: the file cannot be written.
    """
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("object", "target", "level", "furthest", "final", "missing", "fault"))
    for one in found.episodes:
        kind = one.kind
        where = one.object, one.target, one.level
        writer.writerow((*where, kind.furthest, kind.final, " ".join(kind.missing), kind.fault))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as temporary:
            temporary.write_text(text.getvalue(), encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{str(path)!r} cannot be written: {error.strerror}") from error


def stage_bonus(task: Task) -> Sequence[float]:
    """Return the least reward of each stage of a task.

    Raises:
        ConfigError: its reward has no stages.
    """
    bonus: Sequence[float] | None = getattr(getattr(task.config, "reward", None), "stage_bonus", None)
    if bonus is None:
        name = task.config.name
        raise ConfigError(f"the reward of {name} has no stages: its configuration lacks reward.stage_bonus")
    return bonus


def _play(job: ReplayJob, send: Send) -> list[tuple[EpisodeResult, FailureKind]]:
    """Play episodes again, and return of each its outcome and how it failed."""
    task = make_task(job.batch.task, job.batch.overrides)
    names, bonus = [stage.name for stage in task.reward_table.stages], stage_bonus(task)
    player = ActionReplay(job, send)
    final = np.zeros(len(job.actions), dtype=np.int64)
    furthest = final.copy()
    while not player.over.all():
        under_way = ~player.over
        player.step()
        # an episode that a fault ended stays where it was: it took no step, or its physics diverged in it
        failed = [env for env, result in player.results.items() if result.fault]
        stepped = np.setdiff1d(np.flatnonzero(under_way), failed)
        if stepped.size:
            final[stepped] = np.searchsorted(bonus, player.episodes.terms[STAGE_TERM][stepped], side="right") - 1
            np.maximum(furthest, final, out=furthest)
    found = []
    for env in range(len(job.actions)):
        result = player.results[env]
        missing = tuple(name for name, counts in result.flags.items() if not counts)
        kind = FailureKind(names[furthest[env]], names[final[env]], missing, fault_kind(result.fault))
        found.append((result, kind))
    return found
