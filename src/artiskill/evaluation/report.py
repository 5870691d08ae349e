"""Reports: what the episodes add up to."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from artiskill.config import to_mapping
from artiskill.demos.attempts import fault_kind
from artiskill.evaluation.episodes import EpisodeResult
from artiskill.evaluation.intervals import wilson_interval
from artiskill.evaluation.plan import Plan
from artiskill.versions import versions


@dataclass(frozen=True)
class Tally:
    """Counts and rates of some episodes.

    Attributes:
        episodes: how many.
        successes: how many of them were solved.
        success_rate: their ratio.
        interval: 95 % Wilson interval of the success rate.
        flags: condition -> share of episodes at whose end it held.
        mean_length: environment steps per episode, failed ones included.
        faults: what ended episodes before their end, `DivergedError` say, and how many of them.
    """

    episodes: int
    successes: int
    success_rate: float
    interval: tuple[float, float]
    flags: dict[str, float]
    mean_length: float
    faults: dict[str, int]

    @property
    def faults_text(self) -> str:
        """A sentence about faults; empty without any."""
        kinds = ", ".join(f"{count} by {kind}" for kind, count in self.faults.items())
        return f"Episodes that a fault ended, which count as failed: {kinds}." if kinds else ""


@dataclass(frozen=True)
class ObjectRow:
    """The tally of one object.

    Attributes:
        object: its id.
        target: the target link; `any` where each level drew its own.
        content_hash: of the object.
        tally: over its episodes.
    """

    object: str
    target: str
    content_hash: str
    tally: Tally

    def to_mapping(self) -> dict[str, Any]:
        """An entry of `objects` in report.json."""
        head = {"object": self.object, "target": self.target, "content_hash": self.content_hash}
        return head | to_mapping(self.tally)


@dataclass(frozen=True)
class Report:
    """All that an evaluation says.

    Attributes:
        task: name of the task.
        policy: name or path of the policy.
        policy_sha256: of a solution file's bytes; else None.
        obs_mode: what the policy saw.
        control_mode: what its actions asked for.
        levels: first and last.
        total: over all episodes.
        rows: one per object, or per object and target.
        episodes: every single one, in the order of rows and levels.
        config: resolved configuration of the task, plain values.
        versions: of everything that the numbers depend on.
        timing: seconds, workers and environment steps per second; the only part that differs from run to run.
    """

    task: str
    policy: str
    policy_sha256: str | None
    obs_mode: str
    control_mode: str
    levels: tuple[int, int]
    total: Tally
    rows: tuple[ObjectRow, ...]
    episodes: tuple[EpisodeResult, ...]
    config: dict[str, Any]
    versions: dict[str, str]
    timing: dict[str, float]

    @property
    def success_rate(self) -> float:
        """Of all episodes."""
        return self.total.success_rate

    def to_mapping(self) -> dict[str, Any]:
        """The content of report.json, as docs/evaluation.md describes it."""
        return {
            "task": self.task,
            "policy": self.policy,
            "policy_sha256": self.policy_sha256,
            "obs_mode": self.obs_mode,
            "control_mode": self.control_mode,
            "levels": list(self.levels),
            **to_mapping(self.total),
            "objects": [row.to_mapping() for row in self.rows],
            "config": self.config,
            "versions": self.versions,
            "timing": self.timing,
        }


def make_report(plan: Plan, results: Sequence[Sequence[EpisodeResult]], seconds: float, workers: int) -> Report:
    """The report of a plan.

    Args:
        plan: what was asked.
        results: per batch of the plan, its episodes.
        seconds: that they took.
        workers: processes that played them.
    """
    episodes = tuple(result for batch in results for result in batch)
    steps = sum(result.length for result in episodes)
    levels = plan.batches[0].levels
    return Report(
        task=plan.task.name,
        policy=plan.policy_name,
        policy_sha256=plan.policy_sha256,
        obs_mode=plan.obs_mode,
        control_mode=plan.control_mode,
        levels=(levels[0], levels[-1]),
        total=count(episodes),
        rows=tuple(
            ObjectRow(*b.row, b.content_hash, count(r)) for b, r in zip(plan.batches, results, strict=True)
        ),
        episodes=episodes,
        config=to_mapping(plan.task.config),
        versions=versions(),
        timing={"seconds": round(seconds, 3), "workers": workers, "steps_per_s": round(steps / seconds, 1)},
    )


def count(episodes: Sequence[EpisodeResult]) -> Tally:
    """The tally of at least one episode."""
    n, successes = len(episodes), sum(result.success for result in episodes)
    names = episodes[0].flags
    return Tally(
        episodes=n,
        successes=successes,
        success_rate=successes / n,
        interval=wilson_interval(successes, n),
        flags={name: sum(result.flags[name] for result in episodes) / n for name in names},
        mean_length=sum(result.length for result in episodes) / n,
        faults=dict(Counter(sorted(fault_kind(result.fault) for result in episodes if result.fault))),
    )
