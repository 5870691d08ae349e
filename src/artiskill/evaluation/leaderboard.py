"""A leaderboard: a folder of reports, and a page made from it; only reports of one protocol are compared.

Nothing needs to be hosted or trusted: a report that does not agree with itself is listed with the reason, and
never ranked; `verify=True` also plays all others again.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.errors import ArtiSkillError, ConfigError
from artiskill.evaluation.html import cell, page, percent, rate_bar, row, section, span_text, table, text
from artiskill.evaluation.protocols import PRIVILEGED
from artiskill.evaluation.report import REPORT_JSON
from artiskill.evaluation.report_page import PAGE_FILE, read_page_source
from artiskill.evaluation.statistics import Comparison, EpisodeResult, compare_episodes
from artiskill.evaluation.stored_report import StoredReport
from artiskill.evaluation.verify import verify_report
from artiskill.files import atomic_write, check_output_folder, is_folder, output_path

LEADERBOARD_FILE = "leaderboard.html"
_MOST_REPORTS, _MOST_REASONS = 1000, 3


@dataclass(frozen=True, eq=False)
class Entry:
    """A report that agrees with itself.

    Attributes:
        folder: of the report.
        report: its content.
        episodes: of episodes.csv.
        is_verified: whether all its actions were played again.
    """

    folder: Path
    report: StoredReport
    episodes: list[EpisodeResult]
    is_verified: bool

    @property
    def is_ranked(self) -> bool:
        """Whether it competes: a policy that reads the simulation's state is a bound for the others."""
        return self.report.track != PRIVILEGED


@dataclass(frozen=True)
class Refused:
    """A report that is not ranked, and why."""

    folder: Path
    reasons: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Leaderboard:
    """What a folder of reports adds up to.

    Attributes:
        folder: that was searched.
        groups: protocol id -> its entries, the highest rate first.
        refused: reports that are damaged or forged.
        was_verified: whether all actions were played again.
    """

    folder: Path
    groups: dict[str, list[Entry]]
    refused: list[Refused]
    was_verified: bool


def find_reports(folder: Path | str) -> list[Path]:
    """Return the folders below a folder that hold a report, or what is left of one.

    Raises:
        ConfigError: there is no such folder, or no report below it, or too many.
    """
    folder = Path(folder)
    if not is_folder(folder):
        raise ConfigError(f"there is no folder {str(folder)!r} of reports")
    found = []
    for at, below, files in os.walk(folder):
        below.sort()
        if REPORT_JSON in files:
            found.append(Path(at))
        if len(found) > _MOST_REPORTS:
            raise ConfigError(f"{str(folder)!r} holds more than {_MOST_REPORTS} reports; take a folder below it")
    if not found:
        raise ConfigError(f"{str(folder)!r} holds no reports: no folder below it has a {REPORT_JSON}")
    return found


def read_leaderboard(
    folder: Path | str,
    verify: bool = False,
    workers: int = 1,
    objects: Sequence[str | ArticulatedObject] = (),
    on_report: Callable[[Path], None] = lambda folder: None,
) -> Leaderboard:
    """Read all reports below a folder.

    Args:
        folder: that is searched.
        verify: play the actions of all of them again.
        workers: processes that do.
        objects: see `verify_report`.
        on_report: called after each report.

    Raises:
        ConfigError: see `find_reports`.
    """
    entries: list[Entry] = []
    refused: list[Refused] = []
    for one in find_reports(folder):
        try:
            found = _read_entry(one, verify, workers, objects)
        except (ArtiSkillError, ValueError) as error:
            found = Refused(one, (str(error),))
        (entries if isinstance(found, Entry) else refused).append(found)  # type: ignore[arg-type]
        on_report(one)
    entries.sort(key=lambda entry: (-entry.report.success_rate, str(entry.folder)))
    groups: dict[str, list[Entry]] = {}
    for entry in sorted(entries, key=lambda entry: entry.report.protocol):
        groups.setdefault(entry.report.protocol, []).append(entry)
    return Leaderboard(Path(folder), groups, refused, verify)


def _read_entry(
    folder: Path, verify: bool, workers: int, objects: Sequence[str | ArticulatedObject]
) -> Entry | Refused:
    """Read one report; `Refused` if it was played again and came out otherwise.

    Raises:
        ArtiSkillError: it is damaged or forged, or what it is about is not here.
    """
    faults = verify_report(folder, workers, objects=objects).faults if verify else ()
    if faults:
        return Refused(folder, faults)
    source = read_page_source(folder, films=0, objects=objects)
    return Entry(folder, source.stored.report, source.episodes, verify)


# -- the page -----------------------------------------------------------------------------------------------------


def write_leaderboard(board: Leaderboard, out: Path | str | None = None) -> Path:
    """Write a leaderboard's page.

    Args:
        board: what it shows.
        out: the file; by default `leaderboard.html` in its folder.

    Raises:
        ConfigError: it cannot be written.
    """
    out = output_path(board.folder / LEADERBOARD_FILE if out is None else out)
    check_output_folder(out.parent)
    if out.is_dir():
        raise ConfigError(f"cannot write the page {str(out)!r}: it is a folder")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(out) as temporary:
            temporary.write_bytes(leaderboard_page(board, out.parent))
    except OSError as error:
        raise ConfigError(f"cannot write the page {str(out)!r}: {error.strerror or error}") from error
    return out


def leaderboard_page(board: Leaderboard, home: Path) -> bytes:
    """Return the page; `home` is the folder that it will stand in."""
    count = sum(map(len, board.groups.values()))
    was, was_not = "played again and found as reported, bit for bit", "read, but not played again"
    head = (
        f'<header><p class="kind">ArtiSkill leaderboard</p><h1>{count} report{"s" * (count != 1)} of '
        f"{len(board.groups)} protocol{'s' * (len(board.groups) != 1)}</h1></header><main>"
        f"<p>All that are ranked were {was if board.was_verified else was_not}. Only reports of one protocol "
        "compare: same task, objects, levels, observations and actions. A track is what a policy&#8217;s author "
        "says that it was made from; privileged policies read the simulation&#8217;s state: bounds, without "
        "a rank.</p>"
    )
    groups = [_group(name, entries, home) for name, entries in board.groups.items()]
    return page("ArtiSkill leaderboard", "\n".join([head, *groups, _refused(board.refused, home), "</main>"]))


def _group(name: str, entries: Sequence[Entry], home: Path) -> str:
    """Return the table of one protocol."""
    best = next((entry for entry in entries if entry.is_ranked), None)
    heads = [("Rank", "number"), ("Policy", "name"), ("Track", "name"), ("Solved", "number")]
    heads += [("Rate and 95 % interval", "wide"), ("Points from the best", "name"), ("Checked", "name")]
    rates = [entry.report.success_rate for entry in entries if entry.is_ranked]
    body = []
    for entry in entries:
        rank = str(1 + sum(rate > entry.report.success_rate for rate in rates)) if entry.is_ranked else "&ndash;"
        body.append(_entry_row(entry, rank, best, entries, home))
    one = entries[0].report
    played = f"{len(one.objects)} rows of {len(one.counted_levels)} levels, digest {text(one.protocol_digest)}"
    said = f"<p class='dim'>{text(one.task)}, {text(one.obs_mode)}, {text(one.control_mode)}; {played}.</p>"
    return section(f"<code>{text(name)}</code>", said + table(heads, body))


def _entry_row(entry: Entry, rank: str, best: Entry | None, group: Sequence[Entry], home: Path) -> str:
    report = entry.report
    rate = f"{percent(report.success_rate)} <span class='unit'>{span_text(report.interval)}</span>"
    over = report.interval_over_objects
    spread = "" if over is None else f"<div class='unit'>over objects {span_text(over)}</div>"
    verified = "<span class='good'>verified</span>" if entry.is_verified else "not played again"
    return row(
        [
            cell(rank, "Rank"),
            f'<th role="rowheader" scope="row">{_policy_name(entry, group, home)}</th>',
            cell(text(report.track or "not said"), "Track", "name words"),
            cell(f"{report.successes}/{report.episodes}", "Solved"),
            cell(f"{rate}{rate_bar(report.success_rate, report.interval)}{spread}", kind="wide"),
            cell(_difference(entry, best), "Points from the best", "name"),
            cell(verified, "Checked", "name"),
        ]
    )


def _policy_name(entry: Entry, group: Sequence[Entry], home: Path) -> str:
    """Return the policy's name, with a link to its report's page where there is one, and what identifies it."""
    name, target = text(entry.report.policy), entry.folder / PAGE_FILE
    if target.is_file():
        address = quote(os.path.relpath(target, home).encode("utf-8", "surrogateescape"))
        name = f'<a href="./{address}">{name}</a>'
    digest = entry.report.policy_sha256 or ""
    said = [text(os.path.relpath(entry.folder, home))] + [f"sha256 {text(digest[:12])}"] * bool(digest)
    actions = entry.report.actions_sha256
    same = [text(one.folder.name) for one in group if one is not entry and one.report.actions_sha256 == actions]
    copies = f"<br><span class='bad'>same actions as {', '.join(same)}</span>" if same else ""
    return f"{name}<br><span class='unit'>{', '.join(said)}</span>{copies}"


def _difference(entry: Entry, best: Entry | None) -> str:
    """Return the difference to the best, episode by episode, with its interval."""
    if best is None or entry is best:
        return "" if best is None else "the best"
    found: Comparison = compare_episodes(best.episodes, entry.episodes)
    if found.interval is None:
        return _signed(found.difference)
    low, high = found.interval
    return f"{_signed(found.difference)} <span class='unit'>{_signed(low)} to {_signed(high)}</span>"


def _signed(share: float) -> str:
    """Return a difference of shares in percent points."""
    return f"{100 * share:+.1f}".replace("-", "&minus;")


def _refused(refused: Sequence[Refused], home: Path) -> str:
    """Return the list of reports that are not ranked."""
    if not refused:
        return ""
    items = []
    for one in refused:
        reasons = [text(reason) for reason in one.reasons[:_MOST_REASONS]]
        more = len(one.reasons) - _MOST_REASONS
        reasons += [f"and {more} more"] if more > 0 else []
        items.append(
            f"<dt><code>{text(os.path.relpath(one.folder, home))}</code></dt><dd>{'<br>'.join(reasons)}</dd>"
        )
    said = "<p>These reports are damaged or forged, or what they are about is not here.</p>"
    return section("Not ranked", f"{said}<dl>{''.join(items)}</dl>", kind="note")
