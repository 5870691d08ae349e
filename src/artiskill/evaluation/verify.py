"""Reports read back: verified by playing their actions again, without the policy, and compared with one another.

Every file of a report is made anew from what the actions do, and must come out byte for byte. What does not follow
from actions (who chose them, who says which track, how long it took) is covered by a digest only, which shows that
something was changed, not what is true.
"""

import csv
import io
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import checked_hash, load_object
from artiskill.config import check, check_positive, differing, from_mapping
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ArtiSkillError, ConfigError, check_name, shown
from artiskill.evaluation.action_replay import ReplayJob, replay
from artiskill.evaluation.evaluate import prepare_workers, run_evaluation
from artiskill.evaluation.plan import EpisodeBatch, EvaluationPlan, inspect_policy, name_batches
from artiskill.evaluation.policies import policy_digest, policy_of_task
from artiskill.evaluation.protocols import ANY_TARGET, PRIVILEGED, TRACKS
from artiskill.evaluation.report import (
    ACTIONS_FILE,
    EPISODES_CSV,
    REPORT_FILES,
    REPORT_JSON,
    make_report,
    mapping_sha256,
    report_files,
    timing_of,
    unpack_actions,
)
from artiskill.evaluation.sandbox import Confinement, SandboxConfig
from artiskill.evaluation.statistics import (
    Comparison,
    EpisodeResult,
    EpisodeStatistics,
    Interval,
    compare_episodes,
    object_interval,
    summarize,
)
from artiskill.files import parse_json, read_bytes
from artiskill.jobs.parallel import check_workers, run_jobs
from artiskill.tasks.levels import MAX_LEVEL
from artiskill.tasks.registry import make_task
from artiskill.versions import versions

_MOST_FAULTS = 20  # that are listed of one file
_JOB_EPISODES = 25
_MOST_LEVELS = 1_000_000
_NAME_KEYS = ("name", "motion")  # of a task's configuration, which no override may hold


@dataclass(frozen=True)
class StoredRow(EpisodeStatistics):
    """An entry of `objects` in report.json; see `ObjectRow`."""

    object: str
    target: str
    content_hash: str


@dataclass(frozen=True)
class StoredLatency:
    """How long a policy took for its actions, in milliseconds."""

    median: float
    p95: float
    max: float

    def __post_init__(self) -> None:
        check(0 <= self.median <= self.p95 <= self.max < math.inf, "act_ms must rise from median over p95 to max")


@dataclass(frozen=True)
class StoredMachine:
    """What a report was made on."""

    processor: str | None
    cores: int
    system: str


@dataclass(frozen=True)
class StoredTiming:
    """The entry `timing` of report.json."""

    seconds: float
    workers: int
    steps_per_s: float
    act_ms: StoredLatency | None = None
    machine: StoredMachine | None = None

    def __post_init__(self) -> None:
        check_positive(self, "seconds", "workers")


@dataclass(frozen=True)
class StoredReport(EpisodeStatistics):
    """The content of report.json; see `Report`."""

    task: str
    policy: str
    policy_sha256: str | None
    track: str | None
    protocol: str
    protocol_digest: str
    obs_mode: str
    control_mode: str
    sampling: Sampling | None
    confinement: Confinement | None
    levels: tuple[int, int] | None
    salt: str | None
    interval_over_objects: Interval | None
    objects: tuple[StoredRow, ...]
    config: dict[str, Any]
    versions: dict[str, str]
    actions_sha256: str
    timing: StoredTiming
    sha256: str

    def __post_init__(self) -> None:
        check((self.levels is None) != (self.salt is None), "a report has either levels or a salt")
        check_name("track", self.track or PRIVILEGED, (*TRACKS, PRIVILEGED))
        check(len(self.objects) > 0, "objects must not be empty")
        first, last = self.levels or (0, self.objects[0].episodes - 1)
        is_legal = 0 <= first <= last <= MAX_LEVEL and last - first < _MOST_LEVELS
        check(is_legal, f"levels must be a lower and a higher number, not {first} and {last}")

    @property
    def counted_levels(self) -> tuple[int, ...]:
        """The levels of each object; before fresh ones take their places."""
        if self.levels is None:
            return tuple(range(self.objects[0].episodes))
        return tuple(range(self.levels[0], self.levels[1] + 1))


@dataclass(frozen=True, eq=False)
class ReportFolder:
    """The files of a report, as they are.

    Attributes:
        path: of the folder.
        files: name -> content.
        mapping: the content of report.json as JSON.
        report: the same, with types checked.
    """

    path: Path
    files: dict[str, bytes]
    mapping: dict[str, Any]
    report: StoredReport

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The lines of episodes.csv, by column."""
        text = self.files[EPISODES_CSV].decode(errors="replace")
        return list(csv.DictReader(io.StringIO(text, newline="")))

    def episodes(self) -> list[EpisodeResult]:
        """Return the episodes of episodes.csv, without their actions.

        Raises:
            ConfigError: report.json was changed, or says something else about them.
        """
        try:
            found = [_episode_of(row) for row in self.rows]
            is_same = self._follows_from(found)
        except (KeyError, TypeError, ValueError, ZeroDivisionError, IndexError):
            is_same = False
        if not is_same or self.mapping["sha256"] != mapping_sha256(self.mapping):
            raise ConfigError(f"{str(self.path)!r} is damaged or forged; `artiskill report verify` says where")
        return found

    def _follows_from(self, episodes: Sequence[EpisodeResult]) -> bool:
        """Whether these episodes are all there are, and report.json's numbers theirs."""
        report, count = self.report, len(self.report.counted_levels)
        parts = [episodes[start : start + count] for start in range(0, len(episodes), count)]
        rows = [
            StoredRow(**vars(summarize(part)), object=row.object, target=row.target, content_hash=row.content_hash)
            for part, row in zip(parts, report.objects, strict=True)
            if {episode.object for episode in part} == {row.object}
        ]
        return (
            tuple(rows) == report.objects
            and summarize(episodes) == summarize_stored(report)
            and object_interval(episodes) == report.interval_over_objects
        )


def read_report(folder: Path | str) -> ReportFolder:
    """Read the files of a report.

    Raises:
        ConfigError: a file is missing, or report.json is not what it should be.
    """
    folder, files = Path(folder), {}
    for name in REPORT_FILES:
        try:
            files[name] = read_bytes(folder / name)
        except OSError as error:
            raise ConfigError(f"{str(folder)!r} is no whole report: {name}: {error.strerror}") from error
    try:
        mapping = parse_json(files[REPORT_JSON])
    except ValueError as error:
        raise ConfigError(f"{str(folder / REPORT_JSON)!r} is no JSON: {error}") from error
    return ReportFolder(folder, files, mapping, from_mapping(StoredReport, mapping, str(folder / REPORT_JSON)))


def summarize_stored(report: StoredReport) -> EpisodeStatistics:
    """Return the statistics over all episodes."""
    return EpisodeStatistics(**{name: getattr(report, name) for name in EpisodeStatistics.__dataclass_fields__})


def _episode_of(row: Mapping[str, str]) -> EpisodeResult:
    fixed = ("object", "target", "level", "success", "length", "fault", "reward_sum", "digest")
    return EpisodeResult(
        object=row["object"],
        target=row["target"],
        level=int(row["level"]),
        success=bool(int(row["success"])),
        length=int(row["length"]),
        flags={name: bool(int(value)) for name, value in row.items() if name not in fixed},
        fault=row["fault"],
        reward_sum=float(row["reward_sum"]),
        digest=row["digest"],
    )


# -- verifying ----------------------------------------------------------------------------------------------------


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
        objects: that the report's own names do not lead to, imported ones say, or their folders' names.

    Raises:
        ConfigError: a file is missing, or report.json is not what it should be; an illegal number of workers.
    """
    check_workers(workers)
    stored = read_report(folder)
    try:
        plan = plan_again(stored.report, objects)
        actions = unpack_actions(stored.files[ACTIONS_FILE])
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
    loaded = [load_object(one) if isinstance(one, str) else one for one in objects]
    given: dict[str, ArticulatedObject] = {obj.id: obj for obj in loaded}
    overrides = {key: value for key, value in report.config.items() if key not in _NAME_KEYS}
    task = make_task(report.task, overrides)
    modes = report.obs_mode, report.control_mode
    batches = []
    for row in report.objects:
        item = given.get(row.object, row.object)
        target = None if row.target == ANY_TARGET else row.target
        parts = report.task, overrides, item, target, report.counted_levels, report.policy, *modes
        batches.append(EpisodeBatch(*parts, checked_hash(item), report.sampling))
    named, protocol = name_batches(task, tuple(batches), report.salt)
    policy = report.policy, report.policy, report.policy_sha256
    held = report.confinement
    return EvaluationPlan(task, *policy, *modes, named, protocol, report.salt, report.track, confinement=held)


def _play_again(
    plan: EvaluationPlan,
    actions: Sequence[np.ndarray],
    rows: Sequence[Mapping[str, Any]],
    workers: int,
    on_episode: Callable[[EpisodeResult], None] | None,
) -> tuple[list[list[EpisodeResult]], list[str]]:
    """Return the outcomes of all batches, and what else there is to say."""
    said = [str(row.get("fault") or "") for row in rows][: len(actions)]
    said += [""] * (len(actions) - len(said))
    jobs, first = [], 0
    for batch in plan.batches:
        for start in range(0, len(batch.levels), _JOB_EPISODES):
            part = batch.levels[start : start + _JOB_EPISODES]
            end = first + len(part)
            jobs.append(ReplayJob(replace(batch, levels=part), tuple(actions[first:end]), tuple(said[first:end])))
            first = end
    if min(workers, len(jobs)) > 1:
        prepare_workers(replace(plan.batches[0], obs_mode="state", sampling=None))
    found = run_jobs(replay, jobs, workers, on_episode, lambda job: job.batch.label)
    results = [result for part, _ in found for result in part]
    count = len(plan.batches[0].levels)
    batches = [results[start : start + count] for start in range(0, len(results), count)]
    return batches, [note for _, notes in found for note in notes]


def _changed(stored: ReportFolder) -> Iterator[str]:
    """Yield what is wrong with report.json whatever the actions do."""
    digest = mapping_sha256(stored.mapping)
    if stored.report.sha256 != digest:
        yield f"{REPORT_JSON} was changed: its content's sha256 is {digest}, not {stored.report.sha256}"
    if stored.report.track in TRACKS and stored.report.obs_mode == "state":
        yield f"track {stored.report.track!r} is of policies that see 'pointcloud' or 'rgbd', not 'state'"
    python = {"python": ""}  # the bits do not depend on it
    if other := differing(stored.report.versions | python, versions() | python):
        yield f"made with other versions, which may give other numbers: {'; '.join(other)}"


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
    policy = policy_of_task(policy, stored.report.task)
    plan, spec = plan_again(stored.report, objects), inspect_policy(policy, stored.report.task)
    if policy_digest(policy) != stored.report.policy_sha256 or spec.sampling != stored.report.sampling:
        return VerifyResult(0, 0, (f"{policy} is not the policy of the report: its sha256 or sampling differs",))
    actions, per_row = unpack_actions(stored.files[ACTIONS_FILE]), len(plan.batches[0].levels)
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
