"""Reports: what episodes add up to, and its files: JSON, CSV, Markdown, all actions, resolved configuration."""

import csv
import hashlib
import io
import json
import math
import os
import platform
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.config import dump_yaml, to_mapping
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ConfigError
from artiskill.evaluation.action_replay import actions_sha256, join_actions, pack_actions
from artiskill.evaluation.plan import EvaluationPlan
from artiskill.evaluation.protocols import Protocol
from artiskill.evaluation.remote import as_remote
from artiskill.evaluation.sandbox import Confinement
from artiskill.evaluation.statistics import (
    EpisodeResult,
    EpisodeStatistics,
    Interval,
    object_interval,
    summarize,
)
from artiskill.files import atomic_write, check_output_folder, lock_folder, output_path
from artiskill.jobs.parallel import available_cores
from artiskill.versions import processor_name, versions

REPORT_JSON, EPISODES_CSV, ACTIONS_FILE = "report.json", "episodes.csv", "actions.npz"
LATENCY_FILE = "latency.csv"  # only of a policy behind a WebSocket; it cannot be made anew
REPORT_FILES = ("config.yaml", EPISODES_CSV, ACTIONS_FILE, "report.csv", "report.md", REPORT_JSON)


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
        track: what the policy was made from, as its author says; `privileged` for experts; else None.
        protocol: what the numbers compare with.
        obs_mode: of its observations.
        control_mode: of its actions.
        sampling: of the clouds that it saw; None for the full ones, and in other modes.
        replan_steps: actions taken of each answer of a server; None for all of them, and for other policies.
        confinement: of a solution file's process; None for other policies.
        levels: first and last; None for fresh ones.
        salt: of fresh levels; else None.
        total: over all episodes.
        interval_over_objects: 95 % interval of the success rate by bootstrap over objects; None if all are alike.
        rows: one per object, or per object and target.
        episodes: every single one, in the order of rows and levels.
        config: resolved configuration of the task, plain values.
        versions: of everything that the numbers depend on.
        timing: how long it took, and on which machine; the only part that differs from run to run.
    """

    task: str
    policy: str
    policy_sha256: str | None
    track: str | None
    protocol: Protocol
    obs_mode: str
    control_mode: str
    sampling: Sampling | None
    replan_steps: int | None
    confinement: Confinement | None
    levels: tuple[int, int] | None
    salt: str | None
    total: EpisodeStatistics
    interval_over_objects: Interval | None
    rows: tuple[ObjectRow, ...]
    episodes: tuple[EpisodeResult, ...]
    config: dict[str, Any]
    versions: dict[str, str]
    timing: dict[str, Any]

    @property
    def success_rate(self) -> float:
        """Of all episodes."""
        return self.total.success_rate

    def to_mapping(self) -> dict[str, Any]:
        """Return the content of report.json, as docs/evaluation.md describes it."""
        found = {
            "task": self.task,
            "policy": self.policy,
            "policy_sha256": self.policy_sha256,
            "track": self.track,
            "protocol": self.protocol.id,
            "protocol_digest": self.protocol.digest,
            "obs_mode": self.obs_mode,
            "control_mode": self.control_mode,
            "sampling": to_mapping(self.sampling),
            "replan_steps": self.replan_steps,
            "confinement": to_mapping(self.confinement),
            "levels": to_mapping(self.levels),
            "salt": self.salt,
            **to_mapping(self.total),
            "interval_over_objects": to_mapping(self.interval_over_objects),
            "objects": [row.to_mapping() for row in self.rows],
            "config": self.config,
            "versions": self.versions,
            "actions_sha256": actions_sha256(*join_actions([result.actions for result in self.episodes])),
            "timing": self.timing,
        }
        return found | {"sha256": mapping_sha256(found)}


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
    levels, seconds = plan.batches[0].levels, max(round(seconds, 3), 0.001)
    return Report(
        task=plan.task.name,
        policy=plan.policy_name,
        policy_sha256=plan.policy_sha256,
        track=plan.track,
        protocol=plan.protocol,
        obs_mode=plan.obs_mode,
        control_mode=plan.control_mode,
        sampling=plan.batches[0].sampling,
        replan_steps=plan.replan_steps,
        confinement=plan.confinement,
        levels=(levels[0], levels[-1]) if plan.salt is None else None,
        salt=plan.salt,
        total=summarize(episodes),
        interval_over_objects=object_interval(episodes),
        rows=tuple(
            ObjectRow(*b.row, b.content_hash, summarize(r)) for b, r in zip(plan.batches, results, strict=True)
        ),
        episodes=episodes,
        config=to_mapping(plan.task.config),
        versions=versions(),
        timing=timing_of(episodes, seconds, workers)
        | {"act_ms": _act_ms(episodes), "machine": _machine()}
        | _latency_digest(plan.policy_name, episodes),
    )


def timing_of(episodes: Sequence[EpisodeResult], seconds: float, workers: int) -> dict[str, Any]:
    """Return how fast episodes were played; `seconds` are positive."""
    steps = sum(result.length for result in episodes)
    return {"seconds": seconds, "workers": workers, "steps_per_s": round(steps / seconds, 1)}


def _act_ms(episodes: Sequence[EpisodeResult]) -> dict[str, float] | None:
    """Return how long a policy takes for an answer, in milliseconds; None if it never acted."""
    taken = 1000.0 * np.concatenate([result.act_s for result in episodes])
    taken = taken[np.isfinite(taken)]
    if not len(taken):
        return None
    low, high = np.quantile(taken, (0.5, 0.95)).tolist()
    return {"median": round(low, 3), "p95": round(high, 3), "max": round(float(taken.max()), 3)}


def _machine() -> dict[str, Any]:
    return {"processor": processor_name(), "cores": available_cores(), "system": platform.platform()}


def mapping_sha256(values: Mapping[str, Any]) -> str:
    """Return the SHA-256 of the content of report.json, but for its own entry."""
    content = {key: value for key, value in values.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


# -- files --------------------------------------------------------------------------------------------------------


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
    files = report_files(report)
    with nullcontext() if is_locked else lock_folder(folder):
        try:
            with tempfile.TemporaryDirectory(prefix=".report-", dir=folder) as name:
                for file in REPORT_FILES:
                    (Path(name) / file).write_bytes(files[file])
                _replace_all(Path(name), folder)
            _write_latencies(report, folder / LATENCY_FILE)
        except OSError as error:
            raise ConfigError(f"cannot write the report to {str(folder)!r}: {error.strerror or error}") from error
    return folder


def _write_latencies(report: Report, path: Path) -> None:
    """Write the latencies of a policy behind a WebSocket; other reports have no such file."""
    if as_remote(report.policy) is None:
        path.unlink(missing_ok=True)
        return
    with atomic_write(path) as temporary:
        temporary.write_bytes(_latency_csv(report.episodes))


def _latency_csv(episodes: Sequence[EpisodeResult]) -> bytes:
    """Return one line per answer."""
    rows = [
        {"object": e.object, "target": e.target, "level": e.level, "step": step, "ms": f"{1e3 * seconds:.3f}"}
        for e in episodes
        for step, seconds in enumerate(e.act_s.tolist())
        if math.isfinite(seconds)
    ]
    return _csv(rows).encode()


def _latency_digest(policy: str, episodes: Sequence[EpisodeResult]) -> dict[str, str]:
    """Return the entry of `timing` that covers the file of latencies, where there is one."""
    is_played = any(len(e.act_s) for e in episodes)  # a report that is made anew has the entry of the first one
    if not is_played or as_remote(policy) is None:
        return {}
    return {"latency_sha256": hashlib.sha256(_latency_csv(episodes)).hexdigest()}


def report_files(report: Report) -> dict[str, bytes]:
    """Return the content of all files of a report."""
    texts = {
        "config.yaml": dump_yaml(report.config),
        EPISODES_CSV: episodes_csv(report),
        "report.csv": report_csv(report),
        "report.md": report_markdown(report),
        REPORT_JSON: json.dumps(report.to_mapping(), indent=2) + "\n",
    }
    actions = {ACTIONS_FILE: pack_actions([result.actions for result in report.episodes])}
    return {name: text.encode() for name, text in texts.items()} | actions


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
            | {"fault": e.fault, "reward_sum": e.reward_sum, "digest": e.digest}
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
    levels = f"Levels {report.levels[0]} to {report.levels[1]}" if report.levels else "Fresh levels"
    used = ", ".join(f"{name} {number}" for name, number in report.versions.items())
    modes = f"`{report.obs_mode}`, `{report.control_mode}`"
    track = f", track `{report.track}`" if report.track else ""
    played = f"Protocol `{report.protocol.id}`{track}. {levels} of each object, {modes}."
    over = report.interval_over_objects
    spread = f"\n\nOver objects: {over[0]:.1%} to {over[1]:.1%} (95 %, bootstrap)." if over else ""
    faults = f"\n\n{report.total.faults_text}" if report.total.faults else ""
    confined = f"\n\n{report.confinement.text}." if report.confinement else ""
    return (
        f"# {report.task}: {report.policy}\n\n{played}\n\n"
        + "\n".join(lines)
        + f"{spread}{faults}{confined}\n\nMade with {used}.\n"
    )


def report_columns(report: Report) -> list[str]:
    """Return the heads of a table for people; `cells` has what stands below."""
    return ["object", "target", "solved", "rate", "95 % interval", *report.total.flags, "mean steps"]
