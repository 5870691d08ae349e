"""Reports read back: verified by playing their actions again, without the policy, and compared with one another.

Every file of a report is made anew from what the actions do, and must come out byte for byte. What does not follow
from actions (who chose them, who says which track, how long it took) is covered by a digest only, which shows that
something was changed, not what is true.
"""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import checked_hash, resolve_objects
from artiskill.config import check, differing
from artiskill.errors import ArtiSkillError, ConfigError, UnknownNameError, shown
from artiskill.evaluation.action_replay import ReplayJob, replay, replay_jobs
from artiskill.evaluation.evaluate import Result, prepare_workers, run_evaluation
from artiskill.evaluation.plan import EpisodeBatch, EvaluationPlan, inspect_any, name_batches
from artiskill.evaluation.policies import policy_digest, policy_of_task
from artiskill.evaluation.protocols import ANY_TARGET, TRACKS
from artiskill.evaluation.remote import RemotePolicy, as_remote
from artiskill.evaluation.report import (
    ACTIONS_FILE,
    LATENCY_FILE,
    REPORT_FILES,
    REPORT_JSON,
    make_report,
    mapping_sha256,
    report_files,
    timing_of,
)
from artiskill.evaluation.sandbox import SandboxConfig
from artiskill.evaluation.statistics import (
    Comparison,
    EpisodeResult,
    compare_episodes,
)
from artiskill.evaluation.stored_report import ReportFolder, StoredReport, read_report
from artiskill.files import parse_json, read_bytes
from artiskill.jobs.parallel import check_workers, run_jobs
from artiskill.jobs.worker import Send
from artiskill.tasks.registry import as_overrides, make_task
from artiskill.versions import versions

_MOST_LATENCY_BYTES = 500_000_000  # ten million answers
_MOST_FAULTS = 20  # that are listed of one file


@dataclass(frozen=True)
class VerifyResult:
    """What came of a report's verification."""

    episodes: int  # that were played
    steps: int  # in all
    faults: tuple[str, ...]  # what is not as it should be; empty if all is


def verify_report(
    folder: Path | str,
    workers: int = 1,
    on_episode: Callable[[EpisodeResult], None] | None = None,
    objects: Sequence[str | ArticulatedObject] = (),
) -> VerifyResult:
    """Play all actions of a report again, without the policy, and make all of its files anew from what they do.

    Args:
        folder: of the report.
        workers: processes.
        on_episode: called after each, in no fixed order.
        objects: that the report's own names do not lead to, imported ones say, as `resolve_objects` takes them.

    Raises:
        ConfigError: a file is missing, or report.json is not what it should be; an illegal number of workers.
    """
    check_workers(workers)
    stored = read_report(folder)
    try:
        plan = plan_again(stored.report, objects)
        actions = stored.unpacked()
        if len(actions) != plan.num_episodes:
            rows = f"{len(plan.batches)} rows of {len(plan.batches[0].levels)} levels"
            raise ConfigError(f"{ACTIONS_FILE} has {len(actions)} episodes, {REPORT_JSON} {rows}")
        played, notes = _play_again(plan, actions, stored.rows, workers, on_episode)
    except (ArtiSkillError, ValueError) as error:
        return VerifyResult(0, 0, (f"the actions cannot be played: {error}",))
    faults = [*_changed(stored), *notes, *_different(stored, plan, played)]
    results = [result for batch in played for result in batch]
    return VerifyResult(len(results), sum(result.length for result in results), tuple(faults))


def plan_again(report: StoredReport, objects: Sequence[str | ArticulatedObject] = ()) -> EvaluationPlan:
    """Return the plan of a report.

    Args:
        report: as it was stored.
        objects: see `verify_report`.

    Raises:
        ArtiSkillError: there is no such task, configuration, object, target or mode.
    """
    found = resolve_objects(objects) if objects else ()
    given = {one.id: one for one in found if isinstance(one, ArticulatedObject)}
    overrides = as_overrides(report.config)
    task = make_task(report.task, overrides)
    modes = report.obs_mode, report.control_mode
    batches = []
    for row in report.objects:
        item = given.get(row.object, row.object)
        target = None if row.target == ANY_TARGET else row.target
        parts = report.task, overrides, item, target, report.counted_levels, report.policy, *modes
        try:
            batches.append(EpisodeBatch(*parts, checked_hash(item), report.sampling))
        except UnknownNameError as error:
            raise ConfigError(
                f"the report's object {row.object!r} is none of this package: name it, or the folder or list "
                "that it was read from (--objects)"
            ) from error
    named, protocol = name_batches(task, tuple(batches), report.salt)
    policy = report.policy, report.policy, report.policy_sha256
    return EvaluationPlan(
        *(task, *policy, *modes, named, protocol, report.salt, report.track),
        replan_steps=report.replan_steps,
        confinement=report.confinement,
    )


def _play_again(
    plan: EvaluationPlan,
    actions: Sequence[np.ndarray],
    rows: Sequence[Mapping[str, Any]],
    workers: int,
    on_episode: Callable[[EpisodeResult], None] | None,
) -> tuple[list[list[EpisodeResult]], list[str]]:
    """Return the outcomes of all batches, and what else there is to say."""
    faults = [str(row.get("fault") or "") for row in rows][: len(actions)]
    faults += [""] * (len(actions) - len(faults))
    jobs = replay_jobs(plan, actions, faults, range(len(actions)))
    found = play_again(replay, jobs, workers, on_episode)
    results = [result for part, _ in found for result in part]
    count = len(plan.batches[0].levels)
    batches = [results[start : start + count] for start in range(0, len(results), count)]
    return batches, [note for _, notes in found for note in notes]


def play_again(
    play: Callable[[ReplayJob, Send], Result],
    jobs: Sequence[ReplayJob],
    workers: int,
    on_episode: Callable[[EpisodeResult], None] | None,
) -> list[Result]:
    """Return what a function returns of jobs that worker processes share; it sends the outcome of each episode."""
    if min(workers, len(jobs)) > 1:
        prepare_workers(replace(jobs[0].batch, obs_mode="state", sampling=None))
    return run_jobs(play, jobs, workers, on_episode, lambda job: job.batch.label)


def _changed(stored: ReportFolder) -> Iterator[str]:
    """Yield what is wrong with report.json whatever the actions do."""
    digest = mapping_sha256(stored.mapping)
    if stored.report.sha256 != digest:
        yield f"{REPORT_JSON} was changed: its content's sha256 is {digest}, not {stored.report.sha256}"
    if stored.report.timing.latency_sha256 != _latency_sha256(stored.path):
        yield f"{LATENCY_FILE} is another one than the report had, or missing, or new"
    if stored.report.track in TRACKS and stored.report.obs_mode == "state":
        yield f"track {stored.report.track!r} is of policies that see 'pointcloud' or 'rgbd', not 'state'"
    python = {"python": ""}  # the bits do not depend on it
    if other := differing(stored.report.versions | python, versions() | python):
        yield f"made with other versions, which may give other numbers: {'; '.join(other)}"


def _latency_sha256(folder: Path) -> str | None:
    """Return the SHA-256 of a report's file of latencies; None if there is none, a reason if it cannot be read."""
    path = folder / LATENCY_FILE
    try:
        if not path.exists():
            return None
        check(path.stat().st_size <= _MOST_LATENCY_BYTES, "it is too large")
        return hashlib.sha256(read_bytes(path)).hexdigest()
    except (OSError, ConfigError) as error:
        return str(error)


def _different(
    stored: ReportFolder, plan: EvaluationPlan, played: Sequence[Sequence[EpisodeResult]]
) -> Iterator[str]:
    """Yield what differs between the files of a report and those that are made anew."""
    timing = stored.report.timing
    report = make_report(plan, played, timing.seconds, timing.workers)
    again = replace(
        report,
        timing=stored.mapping["timing"] | timing_of(report.episodes, timing.seconds, timing.workers),
        versions=stored.report.versions,
    )
    files = report_files(again)
    for name in REPORT_FILES:
        if name == ACTIONS_FILE or stored.files[name] == files[name]:
            continue  # another zlib may compress otherwise; the numbers have a digest of their own
        found = _json_lines(stored.mapping, parse_json(files[name])) if name == REPORT_JSON else []
        found = found or _text_lines(stored.files[name], files[name])
        yield from (f"{name}: {line}" for line in found[:_MOST_FAULTS])
        if len(found) > _MOST_FAULTS:
            yield f"{name}: and {len(found) - _MOST_FAULTS} more"


def _json_lines(stored: Mapping[str, Any], again: Mapping[str, Any]) -> list[str]:
    ours, theirs = ({**one, "objects": dict(enumerate(one["objects"]))} for one in (stored, again))
    return differing(ours, theirs)


def _text_lines(stored: bytes, again: bytes) -> list[str]:
    """Return the differences of two texts, line by line."""
    ours, theirs = (text.decode(errors="replace").split("\n") for text in (stored, again))
    if len(ours) != len(theirs):
        return [f"{len(ours)} lines there, {len(theirs)} here"]
    pairs = enumerate(zip(ours, theirs, strict=True), 1)
    return [f"line {k}: {shown(one)} there, {shown(other)} here" for k, (one, other) in pairs if one != other]


# -- with the policy at hand, or another report -------------------------------------------------------------------


def verify_policy(
    folder: Path | str,
    policy: str,
    count: int,
    generator: np.random.Generator,
    workers: int = 1,
    objects: Sequence[str | ArticulatedObject] = (),
) -> VerifyResult:
    """Have a policy play all episodes of some objects again, and compare its actions, bit for bit.

    Args:
        folder: of the report.
        policy: name or path.
        count: how many objects; all, if there are not so many.
        generator: draws which.
        workers: processes.
        objects: see `verify_report`.

    Raises:
        ConfigError: as `verify_report`.
        PolicyError: the policy cannot be loaded, or fails.
    """
    stored = read_report(folder)
    check(count >= 1, f"the number of objects to play again must be at least 1, not {count}")
    report, plan = stored.report, plan_again(stored.report, objects)
    name = policy_of_task(policy, report.task)
    asked = _asked_again(name, report) or name
    policy, spec, _ = inspect_any(asked, report.task, report.obs_mode, report.control_mode)
    differs = [
        part
        for part, ours, theirs in (
            ("sha256", policy_digest(policy), report.policy_sha256),
            ("sampling", spec.sampling, report.sampling),
        )
        if ours != theirs
    ]
    if differs:
        return VerifyResult(0, 0, (f"{name} is not the policy of the report: other {' and '.join(differs)}",))
    actions, per_row = stored.actions(), len(plan.batches[0].levels)
    check(
        len(actions) == plan.num_episodes, f"{ACTIONS_FILE} has {len(actions)} episodes, not {plan.num_episodes}"
    )
    rows = np.sort(generator.permutation(len(plan.batches))[:count]).tolist()
    batches = tuple(replace(plan.batches[row], policy=policy) for row in rows)
    sandbox = None if spec.confinement is None else SandboxConfig(spec.confinement.sandbox)
    plan = replace(plan, policy=policy, batches=batches, sandbox=sandbox)
    played = run_evaluation(plan, workers).episodes
    expected = [actions[row * per_row + k] for row in rows for k in range(per_row)]
    faults = [_acts_otherwise(result, wanted) for result, wanted in zip(played, expected, strict=True)]
    return VerifyResult(len(played), sum(result.length for result in played), tuple(filter(None, faults)))


def _asked_again(policy: str, report: StoredReport) -> RemotePolicy | None:
    """Return a policy behind a WebSocket with what was asked of it for a report; None for any other policy."""
    remote, seen = as_remote(policy), report.sampling
    if remote is None:
        return None
    points, frame = (None, None) if seen is None else (seen.num_points, seen.frame)
    return replace(remote, points=points, frame=frame, replan_steps=report.replan_steps)


def _acts_otherwise(result: EpisodeResult, actions: np.ndarray) -> str:
    """Return where an episode's actions differ from these, (T, A); empty if they do not."""
    if result.actions.tobytes() == actions.tobytes():
        return ""
    both = zip(result.actions, actions, strict=False)
    step = next((t for t, (one, other) in enumerate(both) if one.tobytes() != other.tobytes()), "the last")
    return f"{result.object}, level {result.level}: the policy acts otherwise from step {step} on"


def compare_reports(first: Path | str, second: Path | str) -> tuple[StoredReport, StoredReport, Comparison]:
    """Return two reports of one protocol, and the second one's difference from the first.

    Raises:
        ConfigError: they are of different protocols, or damaged.
    """
    one, other = read_report(first), read_report(second)
    if one.report.protocol_digest != other.report.protocol_digest:
        names = [f"{found.report.protocol!r} ({found.report.protocol_digest})" for found in (one, other)]
        raise ConfigError(f"reports of different protocols do not compare: {names[0]} and {names[1]}")
    return one.report, other.report, compare_episodes(one.episodes(), other.episodes())
