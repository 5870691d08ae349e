"""A report as a page: one HTML file without scripts or requests, with pictures and films of what happened.

The page is made by whoever reads the report, not by who wrote it: what it shows follows from the episodes, and its
films are played again from their actions, bit for bit.
"""

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.config import check, dump_yaml
from artiskill.errors import ConfigError
from artiskill.evaluation.html import (
    cell,
    facts,
    image,
    page,
    percent,
    plain,
    rate_bar,
    row,
    section,
    span_text,
    table,
    text,
)
from artiskill.evaluation.page_pictures import FILM_SPEED, Film, FilmJob, choose_films, draw_films, draw_objects
from artiskill.evaluation.plan import EvaluationPlan
from artiskill.evaluation.protocols import PRIVILEGED
from artiskill.evaluation.statistics import EpisodeResult, EpisodeStatistics
from artiskill.evaluation.stored_report import ReportFolder, StoredReport, read_report, summarize_stored
from artiskill.evaluation.verify import VerifyResult, plan_again
from artiskill.files import atomic_write, check_output_folder, output_path

PAGE_FILE = "page.html"
FILMS = 20  # rows of a report with films, by default: about 0.3 MB each
_PROVES = """<p>The physics gives the same bits on every machine, and the report has all actions. Whoever has them
plays the episodes again, without the policy, and gets the same states, flags and numbers, or sees that the report
is forged:</p>"""
_PROVES_NOT = """<p>This proves that these actions do what the report says. It does not prove who chose them, from
which observations, or how fast: track, latency, machine and confinement are what the author says. With the policy
at hand, <code>--policy</code> has it play a sample again and compares its actions.</p>"""
_FLAGS = """<p>A condition&#8217;s column is the share of episodes at whose end it had held for long enough.</p>"""


@dataclass(frozen=True, eq=False)
class PageSource:
    """A report that was read for its page, and found to agree with itself.

    Attributes:
        stored: its files.
        episodes: in its order.
        plan: what was played.
        films: episodes that are to be drawn.
    """

    stored: ReportFolder
    episodes: list[EpisodeResult]
    plan: EvaluationPlan
    films: list[FilmJob]


def read_page_source(
    folder: Path | str, films: int = FILMS, objects: Sequence[str | ArticulatedObject] = ()
) -> PageSource:
    """Read a report, and choose the episodes for its page's films.

    Args:
        folder: of the report.
        films: rows of the report that get a film of a success and one of a failure.
        objects: see `verify_report`.

    Raises:
        ArtiSkillError: the report is damaged or forged, or what it is about is not here.
    """
    check(films >= 0, f"the number of objects with films must be at least 0, not {films}")
    stored = read_report(folder)
    episodes, plan = stored.episodes(), plan_again(stored.report, objects)
    report = stored.report
    if (plan.protocol.id, plan.protocol.digest) != (report.protocol, report.protocol_digest):
        raise ConfigError(
            f"{str(folder)!r} is not of protocol {report.protocol!r} as it is here: another version, or forged"
        )
    return PageSource(stored, episodes, plan, choose_films(plan, episodes, stored.actions(), films))


def write_report_page(
    source: PageSource,
    out: Path | str | None = None,
    workers: int = 1,
    on_film: Callable[[EpisodeResult], None] = lambda episode: None,
    verified: VerifyResult | None = None,
) -> Path:
    """Write the page of a report.

    Args:
        source: the report.
        out: the file; by default `page.html` in the report's folder.
        workers: processes that draw.
        on_film: called after each film.
        verified: what `verify_report` found, where it was asked.

    Returns:
        The file.

    Raises:
        ConfigError: it cannot be written, or an episode does not happen as reported.
    """
    out = output_path(source.stored.path / PAGE_FILE if out is None else out)
    check_output_folder(out.parent)
    check(not out.is_dir(), f"cannot write the page {str(out)!r}: it is a folder")
    films = draw_films(source.films, workers, on_film)
    items = {batch.row[0]: batch.object for batch in source.plan.batches}
    content = report_page(source, films, draw_objects(list(items.values()), workers), verified)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(out) as temporary:
            temporary.write_bytes(content)
    except OSError as error:
        raise ConfigError(f"cannot write the page {str(out)!r}: {error.strerror or error}") from error
    return out


def report_page(
    source: PageSource, films: Sequence[Film], pictures: dict[str, bytes], verified: VerifyResult | None = None
) -> bytes:
    """Return the page.

    Args:
        source: the report.
        films: of its episodes.
        pictures: of its objects, by id.
        verified: see `write_report_page`.
    """
    report = source.stored.report
    parts = [
        _head(report),
        "<main>",
        _notes(report),
        _headline(report),
        section("Success by object", _objects(report, pictures), "objects"),
        _films(source, films),
        section("Policy and machine", _policy(source.stored)),
        section("Checking this report", _checking(source, len(films), verified)),
        section("Configuration", _configuration(report)),
        "</main>",
    ]
    return page(f"{report.task}, {report.policy}: {report.success_rate:.1%}", "\n".join(parts))


def _head(report: StoredReport) -> str:
    return (
        '<a class="skip" href="#objects">Skip to the objects</a>\n<header>'
        f'<p class="kind">ArtiSkill report &middot; {text(report.task)}</p><h1>{text(report.policy)}</h1></header>'
    )


def _notes(report: StoredReport) -> str:
    """Return what a reader must know before the numbers."""
    notes = []
    if report.track == PRIVILEGED:
        notes.append("This policy reads the simulation's state: a bound for others, not one of them.")
    if report.faults:
        notes.append(summarize_stored(report).faults_text)
    return "".join(f'<p class="card note">{text(note)}</p>' for note in notes)


def _headline(report: StoredReport) -> str:
    names = {entry.object for entry in report.objects}
    count = f"{report.successes} of {report.episodes} episodes on {len(names)} object{'s' * (len(names) > 1)}"
    spans = [("These objects (95 %, Wilson)", report.interval)]
    if report.interval_over_objects is not None:
        spans.append(("Objects of this kind (95 %, bootstrap over objects)", report.interval_over_objects))
    bars = [
        f"<div><p>{head}: {span_text(span)}</p>{rate_bar(report.success_rate, span)}</div>" for head, span in spans
    ]
    levels = f"{report.levels[0]} to {report.levels[1]}" if report.levels else f"fresh, salt {text(report.salt)}"
    digest = f'<span class="dim">({text(report.protocol_digest)})</span>'
    known = facts(
        [
            ("Protocol", f"<code>{text(report.protocol)}</code> {digest}"),
            ("Track", text(report.track or "not said")),
            ("Levels", levels),
            ("Observations", f"{text(report.obs_mode)}{_sampling(report)}"),
            ("Actions", text(report.control_mode)),
            ("Policy, SHA-256", f"<code>{text(report.policy_sha256 or 'none')}</code>"),
        ]
    )
    return (
        f'<section class="card"><h2 class="hidden">Result</h2><div class="headline"><div>'
        f'<div class="rate">{percent(report.success_rate)}</div><div class="dim">{count} solved</div></div>'
        f'<div class="spans">{"".join(bars)}</div></div></section><section class="card">'
        f'<h2 class="hidden">What was played</h2>{known}</section>'
    )


def _sampling(report: StoredReport) -> str:
    sampling = report.sampling
    return "" if sampling is None else f", {sampling.num_points:,} points by {text(sampling.method)}"


# -- objects and films --------------------------------------------------------------------------------------------


def _objects(report: StoredReport, pictures: dict[str, bytes]) -> str:
    """Return the table with a row per object, or object and target."""
    targets = {entry.target for entry in report.objects} != {"any"}
    flags = [text(name).replace("_", " ") for name in report.flags]
    heads = [("<span class='hidden'>Picture</span>", "picture"), ("Object", "name")]
    heads += [("Target", "name")] * targets
    heads += [("Solved", "number"), ("Rate and 95 % interval", "wide"), *((flag, "number") for flag in flags)]
    heads += [("Mean steps", "number"), *([("Faults", "number")] if report.faults else [])]
    body = []
    for entry in report.objects:
        name = text(entry.object)
        cells = [cell(image(pictures[entry.object], f"{entry.object}, partly open"), kind="picture")]
        cells.append(f'<th role="rowheader" scope="row">{name}</th>')
        cells += [cell(text(entry.target), "Target", "name")] * targets
        body.append(row(cells + _numbers(entry, flags, bool(report.faults))))
    nothing = cell("", kind="empty")
    first = [nothing, '<th role="rowheader" scope="row">All</th>', *[nothing] * targets]
    foot = row(first + _numbers(summarize_stored(report), flags, bool(report.faults)))
    return table(heads, body, [foot]) + _FLAGS


def _numbers(stats: EpisodeStatistics, flags: Sequence[str], with_faults: bool) -> list[str]:
    """Return the cells of the numbers of a row."""
    rate = f"{percent(stats.success_rate)} <span class='unit'>{span_text(stats.interval)}</span>"
    cells = [
        cell(f"{stats.successes}/{stats.episodes}", "Solved"),
        cell(f"{rate}{rate_bar(stats.success_rate, stats.interval)}", kind="wide"),
    ]
    shares = zip(flags, stats.flags.values(), strict=True)
    cells += [cell(percent(share), flag) for flag, share in shares]
    cells.append(cell(f"{stats.mean_length:.1f}", "Mean steps"))
    return cells + ([cell(str(sum(stats.faults.values())), "Faults")] if with_faults else [])


def _films(source: PageSource, films: Sequence[Film]) -> str:
    if not films:
        return ""
    shown = len({(job.episode.object, job.batch.target) for job in source.films})
    rest = f" The first {shown} of {len(source.plan.batches)}." if shown < len(source.plan.batches) else ""
    has_points = source.plan.obs_mode == "pointcloud"
    points = " On the right, the points that the policy was given, coloured by mask." if has_points else ""
    speed = {2: "Twice"}.get(FILM_SPEED, f"{FILM_SPEED} times")
    intro = (
        "<p>The first success and the first failure of each object, played again from the report&#8217;s actions, "
        f"bit for bit. {speed} as fast as life.{points}{rest}</p>"
    )
    items = "".join(f"<li>{_film(film)}</li>" for film in films)
    return section("Films", f'{intro}<ul class="films{" wide" * has_points}">{items}</ul>', "films")


def _film(film: Film) -> str:
    """Return a film that plays while it is open; no script is needed."""
    one = film.episode
    what = f"{one.object}, {one.target}, level {one.level}"
    how = "solved" if one.success else "not solved"
    line = (
        f'<span class="line"><span class="play {"good" if one.success else "bad"}">{how}</span> '
        f'<strong>{text(one.object)}</strong> <span class="dim">{text(one.target)}, level {one.level}, '
        f"{one.length} steps</span></span>"
    )
    poster = image(film.poster, f"Last moment: {what}, {how}")
    return f'<details class="film"><summary>{poster}{line}</summary>{image(film.film, f"Film: {what}")}</details>'


# -- where it comes from, and what it is worth --------------------------------------------------------------------


def _policy(stored: ReportFolder) -> str:
    """Return latency, confinement, machine and versions."""
    report, timing = stored.report, stored.report.timing
    found = []
    if timing.act_ms is not None:
        act = timing.act_ms
        said = f"{act.median:,.2f} ms (median), {act.p95:,.2f} ms (95th percentile), {act.max:,.1f} ms (longest)"
        found.append(("Time for an action", said))
    speed = f"{timing.seconds:,.1f} s by {timing.workers} workers, {timing.steps_per_s:,.1f} steps/s"
    found.append(("Played in", speed))
    if timing.machine is not None:
        machine = timing.machine
        said = f"{machine.processor or 'unknown'}, {machine.cores} cores, {machine.system}"
        found.append(("Machine", text(said)))
    found.append(("Confinement", _confinement(report)))
    found.append(("Versions", text(", ".join(f"{name} {number}" for name, number in report.versions.items()))))
    return facts(found)


def _confinement(report: StoredReport) -> str:
    """Return what held the process of a solution file, but for every single attempt."""
    found = report.confinement
    if found is None:
        return "none: not a solution file"
    held, not_held = ([name for name, is_so in found.held.items() if is_so is wanted] for wanted in (True, False))
    parts = {"held": held, "not held": not_held, "limits": found.limits, "passed over": found.passed_over}
    said = plain({name: part for name, part in parts.items() if part})
    return f"{text(f'{found.sandbox} {found.version}')}{said}"


def _checking(source: PageSource, films: int, verified: VerifyResult | None) -> str:
    """Return how the report is verified, and what that proves."""
    report = source.stored.report
    command = text(f"artiskill report verify {shlex.quote(str(source.stored.path))}")
    count = "1 episode was" if films == 1 else f"{films} episodes were"
    said = f"For this page, {count} played again and came out as reported."
    if not films:
        said = "For this page, no episode was played again: what it says was read from the report's files."
    if verified is not None:
        said = (
            f"For this page, all {verified.episodes:,} episodes ({verified.steps:,} steps) were played again and "
            "came out as reported, bit for bit."
        )
    digests = facts(
        [
            ("Actions, SHA-256", f"<code>{text(report.actions_sha256)}</code>"),
            ("Report, SHA-256", f"<code>{text(report.sha256)}</code>"),
        ]
    )
    return f"<p><strong>{said}</strong></p>{_PROVES}<pre class='wrap'>{command}</pre>{_PROVES_NOT}{digests}"


def _configuration(report: StoredReport) -> str:
    yaml = text(dump_yaml(report.config), most=100_000)
    objects = "\n".join(f"{entry.object}  {entry.target}  {entry.content_hash}" for entry in report.objects)
    return (
        f'<details class="more"><summary>Resolved configuration of the task</summary><pre>{yaml}</pre></details>'
        f'<details class="more"><summary>Objects with targets and content hashes</summary>'
        f"<pre>{text(objects, most=100_000)}</pre></details>"
    )
