"""Reports read back from their files: what they say, if that agrees with itself, and their episodes' actions."""

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.config import check, check_line, check_positive, from_mapping
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ConfigError, check_name, shown
from artiskill.evaluation.action_replay import MOST_ACTION_BYTES, actions_sha256, join_actions, unpack_actions
from artiskill.evaluation.protocols import PRIVILEGED, TRACKS
from artiskill.evaluation.report import ACTIONS_FILE, EPISODES_CSV, REPORT_FILES, REPORT_JSON, mapping_sha256
from artiskill.evaluation.sandbox import Confinement
from artiskill.evaluation.statistics import EpisodeResult, EpisodeStatistics, Interval, object_interval, summarize
from artiskill.files import is_folder, parse_json, read_bytes
from artiskill.tasks.levels import MAX_LEVEL

_MOST_LEVELS = 1_000_000
_MOST_STEP_BYTES = 8 * 64  # of an action: joints of two arms are 22
_ARCHIVE_BYTES = 1_000_000  # besides: lengths, headers


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
    latency_sha256: str | None = None

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
    replan_steps: int | None
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
        _check_texts(self)
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


def _check_texts(report: StoredReport) -> None:
    """Refuse texts that would do something to a terminal or a page."""
    machine, timing = report.timing.machine, report.timing
    texts = [
        report.policy,
        report.protocol,
        report.protocol_digest,
        report.salt,
        report.sha256,
        report.actions_sha256,
    ]
    texts += [timing.latency_sha256, *report.versions, *report.versions.values()]
    texts += [text for row in report.objects for text in (row.object, row.target, row.content_hash)]
    texts += [] if machine is None else [machine.processor, machine.system]
    for text in filter(None, texts):
        check_line("the text", text)
    digest = report.policy_sha256
    check(
        digest is None or re.fullmatch("[0-9a-f]{64}", digest) is not None,
        f"policy_sha256 must be 64 hexadecimal digits, not {shown(digest)}",
    )


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

    def unpacked(self) -> list[np.ndarray]:
        """Return the numbers of the file of actions, (T, A) of each episode, whatever the report says of them.

        Raises:
            ValueError: as `unpack_actions`; or it unpacks to more than so many episodes can have.
        """
        steps = self.report.config.get("episode_steps")
        most = len(self.rows) * (steps if isinstance(steps, int) else 0) * _MOST_STEP_BYTES + _ARCHIVE_BYTES
        return unpack_actions(self.files[ACTIONS_FILE], min(most, MOST_ACTION_BYTES))

    def actions(self) -> list[np.ndarray]:
        """Return the actions of each episode, (T, A).

        Raises:
            ConfigError: the file is damaged, or holds other actions than those of the report.
        """
        try:
            found = self.unpacked()
            widths = {one.shape[1] for one in found}
            check(len(found) == len(self.rows), f"it has {len(found)} episodes, {EPISODES_CSV} {len(self.rows)}")
            is_same = len(widths) == 1 and actions_sha256(*join_actions(found)) == self.report.actions_sha256
            check(is_same, "these are not the actions of the report")
        except ValueError as error:
            raise ConfigError(f"{str(self.path / ACTIONS_FILE)!r}: {error}") from error
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
    if not is_folder(folder):
        raise ConfigError(f"there is no folder {str(folder)!r}; a report is a folder that `evaluate --out` wrote")
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
