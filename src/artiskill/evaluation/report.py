"""Reports: what episodes add up to, and its files: JSON, CSV, Markdown and the resolved configuration."""

import csv
import io
import json
import math
import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from artiskill.config import dump_yaml, to_mapping
from artiskill.demos.demonstrator import fault_kind
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ConfigError
from artiskill.evaluation.plan import EvaluationPlan
from artiskill.files import check_output_folder, lock_folder, output_path
from artiskill.versions import versions

REPORT_FILES = ("config.yaml", "episodes.csv", "report.csv", "report.md", "report.json")
_Z_95 = 1.959963984540054  # 0.975 quantile of the normal distribution


@dataclass(frozen=True)
class EpisodeResult:
    """The outcome of one episode.

    Attributes:
        object: id of the object.
        target: name of the target link.
        level: of the episode.
        success: whether the task was solved.
        length: environment steps until it was solved or cut off.
        flags: condition -> did it hold, long enough, at the end; none of one that a fault ended.
        fault: what ended it, where that was not the episode's end, physics that ran away say: a text that begins
            with the kind; else empty.
    """

    object: str
    target: str
    level: int
    success: bool
    length: int
    flags: dict[str, bool]
    fault: str = ""


@dataclass(frozen=True)
class EpisodeStatistics:
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

    def cells(self, precision: str) -> list[str]:
        """Return the cells of a table for people, rates formatted as `.1%` say."""
        low, high = (f"{bound:{precision}}" for bound in self.interval)
        rate, flags = f"{self.success_rate:{precision}}", [f"{share:.0%}" for share in self.flags.values()]
        return [f"{self.successes}/{self.episodes}", rate, f"{low} to {high}", *flags, f"{self.mean_length:.1f}"]


@dataclass(frozen=True)
class ObjectRow:
    """Statistics of one object.

    Attributes:
        object: its id.
        target: the target link; `any` where each level drew its own.
        content_hash: of the object.
        stats: over its episodes.
    """

    object: str
    target: str
    content_hash: str
    stats: EpisodeStatistics

    def to_mapping(self) -> dict[str, Any]:
        """Return an entry of `objects` in report.json."""
        head = {"object": self.object, "target": self.target, "content_hash": self.content_hash}
        return head | to_mapping(self.stats)

    def cells(self, precision: str) -> list[str]:
        """Return the cells of a table for people; see `EpisodeStatistics.cells`."""
        return [self.object, self.target, *self.stats.cells(precision)]


@dataclass(frozen=True)
class Report:
    """The outcome of an evaluation.

    Attributes:
        task: name of the task.
        policy: name or path of the policy.
        policy_sha256: of a solution file's bytes, or of a run's weights; else None.
        obs_mode: of its observations.
        control_mode: of its actions.
        sampling: of the clouds that it saw; None for the full ones, and in other modes.
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
    sampling: Sampling | None
    levels: tuple[int, int]
    total: EpisodeStatistics
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
        """Return the content of report.json, as docs/evaluation.md describes it."""
        return {
            "task": self.task,
            "policy": self.policy,
            "policy_sha256": self.policy_sha256,
            "obs_mode": self.obs_mode,
            "control_mode": self.control_mode,
            "sampling": to_mapping(self.sampling),
            "levels": list(self.levels),
            **to_mapping(self.total),
            "objects": [row.to_mapping() for row in self.rows],
            "config": self.config,
            "versions": self.versions,
            "timing": self.timing,
        }


def make_report(
    plan: EvaluationPlan, results: Sequence[Sequence[EpisodeResult]], seconds: float, workers: int
) -> Report:
    """Make the report of a plan.

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
        sampling=plan.batches[0].sampling,
        levels=(levels[0], levels[-1]),
        total=summarize(episodes),
        rows=tuple(
            ObjectRow(*b.row, b.content_hash, summarize(r)) for b, r in zip(plan.batches, results, strict=True)
        ),
        episodes=episodes,
        config=to_mapping(plan.task.config),
        versions=versions(),
        timing={"seconds": round(seconds, 3), "workers": workers, "steps_per_s": round(steps / seconds, 1)},
    )


def summarize(episodes: Sequence[EpisodeResult]) -> EpisodeStatistics:
    """Return the statistics of at least one episode."""
    n, successes = len(episodes), sum(result.success for result in episodes)
    names = episodes[0].flags
    return EpisodeStatistics(
        episodes=n,
        successes=successes,
        success_rate=successes / n,
        interval=wilson_interval(successes, n),
        flags={name: sum(result.flags[name] for result in episodes) / n for name in names},
        mean_length=sum(result.length for result in episodes) / n,
        faults=dict(Counter(sorted(fault_kind(result.fault) for result in episodes if result.fault))),
    )


def wilson_interval(successes: int, trials: int, z: float = _Z_95) -> tuple[float, float]:
    """Return Wilson's score interval of a binomial rate, without continuity correction; by default the 95 % one.

    E. B. Wilson, "Probable inference, the law of succession, and statistical inference", JASA 22 (1927). It stays
    within [0, 1] and has a sensible width at rates of 0 and 1, where the textbook interval has none.

    Args:
        successes: from 0 to `trials`.
        trials: at least 1.
        z: the normal quantile of the wanted confidence.

    Returns:
        Lower and upper bound of the rate.
    """
    assert trials > 0
    assert 0 <= successes <= trials
    rate = successes / trials
    shrink = 1.0 / (1.0 + z * z / trials)
    center = shrink * (rate + z * z / (2 * trials))
    half = shrink * z * math.sqrt(rate * (1.0 - rate) / trials + z * z / (4 * trials * trials))
    low = 0.0 if successes == 0 else center - half  # exact at the ends, where rounding leaves 1e-17
    high = 1.0 if successes == trials else center + half
    return low, high


def write_report(report: Report, folder: Path | str, is_locked: bool = False) -> Path:
    """Write the files of `REPORT_FILES`; those of an earlier report are replaced, other files left alone.

    Everything is written under a temporary name first. report.json comes last: where it is new, all others are.

    Args:
        report: what is written.
        folder: made where it is missing.
        is_locked: whether the caller has it from `lock_folder`.

    Returns:
        The folder.

    Raises:
        ConfigError: the folder cannot be made or written to, or another evaluation is writing to it. An earlier
            report is then as it was.
    """
    folder = Path(folder)
    check_report_folder(folder)
    texts = {
        "config.yaml": dump_yaml(report.config),
        "episodes.csv": episodes_csv(report),
        "report.csv": report_csv(report),
        "report.md": report_markdown(report),
        "report.json": json.dumps(report.to_mapping(), indent=2) + "\n",
    }
    with nullcontext() if is_locked else lock_folder(folder):
        try:
            with tempfile.TemporaryDirectory(prefix=".report-", dir=folder) as name:
                for file in REPORT_FILES:
                    (Path(name) / file).write_text(texts[file], encoding="utf-8")
                _replace_all(Path(name), folder)
        except OSError as error:
            raise ConfigError(f"cannot write the report to {str(folder)!r}: {error.strerror or error}") from error
    return folder


def _replace_all(new: Path, folder: Path) -> None:
    """Move the new files to their places; if that is stopped halfway, put the old ones back."""
    old = new / "old"
    old.mkdir()
    for file in REPORT_FILES:
        if (folder / file).exists():
            shutil.copy2(folder / file, old / file)
    try:
        for file in REPORT_FILES:
            os.replace(new / file, folder / file)
    except BaseException:  # Ctrl-C, too
        for file in REPORT_FILES:
            if (old / file).exists():
                os.replace(old / file, folder / file)
            elif not (new / file).exists():  # was moved
                (folder / file).unlink()
        raise


def check_report_folder(folder: Path) -> None:
    """Check that a report could be written to a folder, without making it.

    Raises:
        ConfigError: they cannot.
    """
    check_output_folder(folder)
    for file in REPORT_FILES:
        if output_path(folder / file).is_dir():
            raise ConfigError(f"cannot write the report: {str(folder / file)!r} is a folder")


def report_csv(report: Report) -> str:
    """Return one line per object."""
    rows = []
    for row in report.rows:
        stats, (low, high) = row.stats, row.stats.interval
        rows.append(
            {"object": row.object, "target": row.target}
            | {"episodes": stats.episodes, "successes": stats.successes, "success_rate": stats.success_rate}
            | {"interval_low": low, "interval_high": high, "mean_length": stats.mean_length}
            | stats.flags
            | {"faults": sum(stats.faults.values())}
        )
    return _csv(rows)


def episodes_csv(report: Report) -> str:
    """Return one line per episode."""
    return _csv(
        [
            {
                "object": e.object,
                "target": e.target,
                "level": e.level,
                "success": int(e.success),
                "length": e.length,
            }
            | {name: int(held) for name, held in e.flags.items()}
            | {"fault": e.fault}
            for e in report.episodes
        ]
    )


def _csv(rows: Sequence[Mapping[str, object]]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, rows[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def report_markdown(report: Report) -> str:
    """Return a table for people."""
    columns = report_columns(report)
    cells = [row.cells(".1%") for row in report.rows]
    cells.append(["**all**", "", *report.total.cells(".1%")])
    table = [columns, ["---"] * 2 + ["---:"] * (len(columns) - 2), *cells]
    lines = [f"| {' | '.join(row)} |" for row in table]
    first, last = report.levels
    used = ", ".join(f"{name} {number}" for name, number in report.versions.items())
    modes = f"`{report.obs_mode}`, `{report.control_mode}`"
    title = f"# {report.task}: {report.policy}\n\nLevels {first} to {last} of each object, {modes}."
    faults = f"\n\n{report.total.faults_text}" if report.total.faults else ""
    return f"{title}\n\n" + "\n".join(lines) + f"{faults}\n\nMade with {used}.\n"


def report_columns(report: Report) -> list[str]:
    """Return the heads of a table for people; `cells` has what stands below."""
    return ["object", "target", "solved", "rate", "95 % interval", *report.total.flags, "mean steps"]
