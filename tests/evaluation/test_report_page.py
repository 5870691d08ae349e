"""Pages of reports, read back by a parser that knows nothing of how they are made."""

import base64
import io
import json
import re
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from artiskill.errors import ArtiSkillError, ConfigError
from artiskill.evaluation.action_replay import pack_actions
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.html import plain, text
from artiskill.evaluation.leaderboard import find_reports, read_leaderboard, write_leaderboard
from artiskill.evaluation.report import REPORT_FILES, Report, mapping_sha256, write_report
from artiskill.evaluation.report_page import read_page_source, report_page, write_report_page
from artiskill.evaluation.sandbox import Confinement
from artiskill.evaluation.statistics import EpisodeResult, compare_episodes, object_interval, summarize

TASK, OBJECTS = "OpenCabinetDrawer", ["generated-cabinet-1000000", "generated-cabinet-1000002"]
EASY = {"episode_steps": 52, "success.open_fraction": 0.001}
HOSTILE = "<script>alert(1)</script>\"'><img src=http://x.example/ onerror=alert(2)>&amp;</title>"
VOID = {"meta", "link", "img", "br", "rect", "input", "hr"}


@pytest.fixture(scope="module")
def report() -> Report:
    """Of an expert that has time to begin to open one of the two, in one of its levels."""
    return evaluate(TASK, "expert", OBJECTS, 2, 5, config=EASY)


@pytest.fixture(scope="module")
def folder(report: Report, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_report(report, tmp_path_factory.mktemp("report"))


class Parsed(HTMLParser):
    """The tags of a page with their attributes, its words, and its pictures."""

    def __init__(self, page: bytes) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words, self._open, self._style = "", [], ""
        self.feed(page.decode("utf-8"))
        self.close()
        assert not self._open, f"never closed: {self._open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" not in self._open:
            self.words += data

    @property
    def images(self) -> list[Image.Image]:
        sources = [attributes["src"] or "" for tag, attributes in self.tags if tag == "img"]
        assert all(source.startswith("data:image/webp;base64,") for source in sources)
        return [Image.open(io.BytesIO(base64.b64decode(source.partition(",")[2]))) for source in sources]

    def check_harmless(self) -> None:
        """No scripts, nothing that a browser would ask a network for, and a policy that forbids both."""
        assert not {"script", "iframe", "object", "embed", "form", "base"} & {tag for tag, _ in self.tags}
        for tag, attributes in self.tags:
            assert not [name for name in attributes if name.startswith("on")], (tag, attributes)
            for name in ("src", "href", "xlink:href", "action"):
                assert re.match(r"data:|#|\./", attributes.get(name) or "#"), (tag, attributes)
        policies = [a["content"] or "" for _, a in self.tags if a.get("http-equiv") == "Content-Security-Policy"]
        assert "default-src 'none'" in policies[0]


@pytest.fixture(scope="module")
def page(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    out = tmp_path_factory.mktemp("page") / "deep" / "mine.html"
    return write_report_page(read_page_source(folder), out).read_bytes()


def test_a_page_needs_nothing_but_itself(page: bytes) -> None:
    parsed = Parsed(page)
    parsed.check_harmless()
    assert len(page) < 1_000_000
    style = page.decode().partition("<style>")[2].partition("</style>")[0]
    assert "url(" not in style
    assert "@import" not in style


def test_every_picture_and_film_can_be_seen(report: Report, page: bytes) -> None:
    parsed = Parsed(page)
    outcomes = {(episode.object, episode.success) for episode in report.episodes}
    films = [image for image in parsed.images if getattr(image, "n_frames", 1) > 1]
    stills = [image for image in parsed.images if getattr(image, "n_frames", 1) == 1]
    assert len(films) == len(outcomes) == sum(tag == "details" for tag, _ in parsed.tags) - 2
    assert len(stills) == len(films) + len(OBJECTS)
    for image in parsed.images:
        assert np.asarray(image.convert("RGB")).std() > 10, "not empty"
    assert all(attributes.get("alt") for tag, attributes in parsed.tags if tag == "img")


def test_the_numbers_are_those_of_the_report(report: Report, page: bytes) -> None:
    words = Parsed(page).words.replace("\u202f", "")
    assert f"{report.success_rate:.1%}" in words
    for stats in (report.total, *(row.stats for row in report.rows)):
        low, high = stats.interval
        assert f"{low:.1%} to {high:.1%}" in words
        assert f"{stats.successes}/{stats.episodes}" in words
        assert f"{stats.mean_length:.1f}" in words
    assert report.interval_over_objects is not None
    assert "{:.1%} to {:.1%}".format(*report.interval_over_objects) in words
    data = report.to_mapping()
    for known in (report.protocol.id, report.track, data["actions_sha256"], data["sha256"], "open enough"):
        assert str(known) in words
    assert f"{data['timing']['act_ms']['median']:.2f} ms" in words
    assert data["versions"]["mujoco-core"] in words
    assert "reads the simulation" in words, "it is an expert"
    assert "artiskill report verify" in words


def test_hostile_names_stay_text(report: Report, tmp_path: Path) -> None:
    write_report(replace(report, policy=HOSTILE, versions=report.versions | {HOSTILE: HOSTILE}), tmp_path)
    parsed = Parsed(report_page(read_page_source(tmp_path, films=0), [], dict.fromkeys(OBJECTS, b"")))
    parsed.check_harmless()
    assert "<script>alert(1)</script>\"'><img src=http://x.example/ onerror=alert(2)>&amp;" in (parsed.words)
    assert {tag for tag, _ in parsed.tags} <= {
        *(
            "html",
            "head",
            "meta",
            "title",
            "link",
            "style",
            "body",
            "a",
            "header",
            "p",
            "h1",
            "h2",
            "main",
            "section",
        ),
        *("div", "svg", "rect", "dl", "dt", "dd", "code", "span", "table", "thead", "tbody", "tfoot", "tr", "th"),
        *("td", "img", "strong", "pre", "details", "summary"),
    }


def test_text_is_never_endless_and_plain_shows_anything() -> None:
    assert len(text("<" * 10_000)) < 2_100
    assert text("\ud800") == "\ufffd"
    assert text("\u202ecod.exe\0") == "\ufffdcod.exe\ufffd"
    shown = Parsed(plain({"network": "none", "memory_mb": 4096, "held": [True, None], "<b>": {"x": 1}}).encode())
    assert shown.words == "networknonememory mb4096heldyes, unknown<b>x1"


def test_what_held_a_solution_is_shown(report: Report, tmp_path: Path) -> None:
    found = Confinement(
        sandbox="limits",
        version="<b>1",
        held={"network": False, "<i>time</i>": True},
        tried={"network": {"connect": "open"}},
        limits={"memory_gb": 8.0},
        readable=(),
        passed_over={"bubblewrap": "<script>"},
    )
    for confinement, says in (
        (found, "limits <b>1held<i>time</i>not heldnetworklimitsmemory gb8.0passed overbubblewrap<script>"),
        (None, "Confinementnone: not a solution file"),
    ):
        write_report(replace(report, confinement=confinement), tmp_path)
        parsed = Parsed(report_page(read_page_source(tmp_path, films=0), [], dict.fromkeys(OBJECTS, b"")))
        parsed.check_harmless()
        assert says in parsed.words


def copied(folder: Path, to: Path) -> Path:
    to.mkdir(exist_ok=True)
    for name in REPORT_FILES:
        (to / name).write_bytes((folder / name).read_bytes())
    return to


def changed(**values: Any) -> Callable[[Path], object]:
    """Change report.json and its digest, too."""

    def change(folder: Path) -> None:
        path = folder / "report.json"
        data = json.loads(path.read_text()) | values
        path.write_text(json.dumps(data | {"sha256": mapping_sha256(data)}))

    return change


def changed_object(**values: Any) -> Callable[[Path], object]:
    """Change the first row of report.json and its digest, too."""

    def change(folder: Path) -> None:
        rows = json.loads((folder / "report.json").read_text())["objects"]
        changed(objects=[rows[0] | values, *rows[1:]])(folder)

    return change


DAMAGED: dict[str, tuple[Callable[[Path], object], str]] = {
    "no file": (lambda at: (at / "episodes.csv").unlink(), "is no whole report"),
    "no JSON": (lambda at: (at / "report.json").write_text("{"), "is no JSON"),
    "no mapping": (lambda at: (at / "report.json").write_text("[]"), "report.json"),
    "a rate": (changed(success_rate=0.9), "damaged or forged"),
    "a rate that is none": (changed(success_rate=float("nan")), "success_rate"),
    "an interval": (changed(interval_over_objects=[0.1, 0.2]), "damaged or forged"),
    "wrong types": (changed(versions=[HOSTILE]), "versions"),
    "a terminal's commands": (changed(policy="a\x1b[2J"), r"'a\\x1b\[2J' is not one line of printable text"),
    "a heading": (changed(protocol="a\n\n# 100 % solved"), "is not one line of printable text"),
    "an object's name": (changed_object(object="\x1b[2J"), "is not one line of printable text"),
    "no hash": (changed(policy_sha256="hello"), "policy_sha256 must be 64 hexadecimal digits, not 'hello'"),
    "another task": (changed(task="OpenCabinetDoor"), "stage_bonus"),
    "a name of no object": (changed(task="OpenCabinetDoor", config={}), "protocol|generated"),
    "a protocol": (changed(protocol="artiskill-1/OpenCabinetDrawer/test/joint/state"), "is not of protocol"),
    "no actions": (lambda at: (at / "actions.npz").write_bytes(b"PK"), "it is damaged"),
    "other actions": (
        lambda at: (at / "actions.npz").write_bytes(pack_actions([np.zeros((3, 13))] * 4)),
        "not the actions of the report",
    ),
    "fewer actions": (lambda at: (at / "actions.npz").write_bytes(pack_actions([np.zeros((3, 13))])), "episodes"),
    "a flag": (
        lambda at: (at / "episodes.csv").write_text((at / "episodes.csv").read_text().replace(",0,", ",1,")),
        "damaged or forged",
    ),
}


@pytest.mark.parametrize("kind", DAMAGED)
def test_what_is_damaged_is_one_clear_error(folder: Path, tmp_path: Path, kind: str) -> None:
    change, says = DAMAGED[kind]
    change(copied(folder, tmp_path / "bad"))
    with pytest.raises(ArtiSkillError, match=says) as caught:
        read_page_source(tmp_path / "bad")
    assert "\n" not in str(caught.value)
    refused = read_leaderboard(tmp_path).refused
    assert [one.folder.name for one in refused] == ["bad"]


def test_other_actions_than_reported_make_no_page(report: Report, folder: Path, tmp_path: Path) -> None:
    episodes = list(report.episodes)
    actions = episodes[0].actions.copy()
    actions[2] = -actions[2]
    episodes[0] = replace(episodes[0], actions=actions)
    write_report(replace(report, episodes=tuple(episodes)), tmp_path)
    with pytest.raises(ConfigError, match="comes out otherwise than reported"):
        write_report_page(read_page_source(tmp_path, films=1))
    assert not (tmp_path / "page.html").exists()


def test_places_that_cannot_be_written(folder: Path, tmp_path: Path) -> None:
    source = read_page_source(folder, films=0)
    with pytest.raises(ConfigError, match="is a folder"):
        write_report_page(source, tmp_path)
    with pytest.raises(ConfigError, match="at least 0"):
        read_page_source(folder, films=-1)


# -- leaderboards -------------------------------------------------------------------------------------------------


def with_successes(report: Report, *solved: bool, **values: Any) -> Report:
    """The report that would follow if these episodes had been solved."""
    episodes = [replace(one, success=is_so) for one, is_so in zip(report.episodes, solved, strict=True)]
    parts: list[list[EpisodeResult]] = [episodes[:2], episodes[2:]]
    rows = tuple(replace(row, stats=summarize(part)) for row, part in zip(report.rows, parts, strict=True))
    numbers = {"total": summarize(episodes), "interval_over_objects": object_interval(episodes)}
    return replace(report, episodes=tuple(episodes), rows=rows, **numbers, **values)


def test_a_leaderboard_ranks_by_protocol(report: Report, folder: Path, tmp_path: Path) -> None:
    best = with_successes(report, True, True, True, False, policy="best.py", track=None, policy_sha256="ab" * 32)
    other = with_successes(report, True, False, False, False, policy=HOSTILE, track="no-restrictions")
    write_report(best, tmp_path / "b")
    write_report(other, tmp_path / "deep" / "er")
    write_report(evaluate(TASK, "still", OBJECTS, 1, 5, config=EASY), tmp_path / "other protocol")
    copied(folder, tmp_path / "bound")
    (tmp_path / "b" / "page.html").write_text("")
    board = read_leaderboard(tmp_path)
    group = board.groups[report.protocol.id]
    rates = [entry.report.success_rate for entry in group]
    assert rates == sorted(rates, reverse=True)
    assert [len(entries) for _, entries in sorted(board.groups.items(), key=lambda item: -len(item[1]))] == [3, 1]
    parsed = Parsed(write_leaderboard(board).read_bytes())
    parsed.check_harmless()
    words = parsed.words.replace("\u202f", "").replace("\u2212", "-")
    found = compare_episodes(best.episodes, other.episodes)
    assert found.interval is not None
    low, high = (f"{100 * bound:+.1f}" for bound in found.interval)
    assert f"{100 * found.difference:+.1f} {low} to {high}" in words
    assert ("the best" in words, "sha256 abababababab" in words) == (True, True)
    assert [a["href"] for tag, a in parsed.tags if tag == "a"] == ["./b/page.html"]
    assert words.count("not played again") == 1 + 4
    assert "same actions as" in words, "of the two forged ones"


def test_forged_reports_are_listed_with_reasons(report: Report, folder: Path, tmp_path: Path) -> None:
    """Agreeing with itself is not enough, where actions are played again."""
    wished = [not episode.success for episode in report.episodes]
    write_report(with_successes(report, *wished, policy="too good"), tmp_path / "forged")
    copied(folder, tmp_path / "honest")
    assert not read_leaderboard(tmp_path).refused
    seen: list[Path] = []
    board = read_leaderboard(tmp_path, verify=True, on_report=seen.append)
    assert [one.folder.name for one in board.refused] == ["forged"]
    assert seen == find_reports(tmp_path)
    [[entry]] = board.groups.values()
    assert (entry.folder.name, entry.is_verified) == ("honest", True)
    words = Parsed(write_leaderboard(board, tmp_path / "board.html").read_bytes()).words
    assert "verified" in words
    assert "Not ranked" in words
    assert "too good" not in words.partition("Not ranked")[0]
    assert re.search(r"episodes\.csv: line 2", words)


def test_a_folder_without_reports(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="holds no reports"):
        read_leaderboard(tmp_path)
    with pytest.raises(ConfigError, match="there is no folder"):
        read_leaderboard(tmp_path / "nothing")
