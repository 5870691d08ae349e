"""Pages of reports in a headless Chromium, at two widths and in both schemes; for `make test-viewer`."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.leaderboard import read_leaderboard, write_leaderboard
from artiskill.evaluation.report import write_report
from artiskill.evaluation.report_page import read_page_source, write_report_page

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    api = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("there is no Chromium")
    with api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The page of a report, and of a leaderboard, with a policy's name that is longer than a phone is wide."""
    folder = tmp_path_factory.mktemp("results")
    policy = folder / f"{'a_policy_with_a_name_' * 6}.py"
    policy.write_text("import numpy as np\n\n\ndef policy(observation):\n    return np.zeros(13)\n")
    config = {"episode_steps": 12}
    report = evaluate(
        "OpenCabinetDrawer", str(policy), ["cabinet-0002", "cabinet-0003"], 1, obs_mode="pointcloud", config=config
    )
    write_report(report, folder / "mine")
    return {
        "page": write_report_page(read_page_source(folder / "mine")),
        "board": write_leaderboard(read_leaderboard(folder)),
    }


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("name", ["page", "board"])
def test_pages_fit_and_ask_for_nothing(
    browser: Any, pages: dict[str, Path], name: str, width: int, scheme: str
) -> None:
    context = browser.new_context(viewport={"width": width, "height": 844}, color_scheme=scheme)
    shown, asked, faults = context.new_page(), [], []
    shown.on("request", lambda request: asked.append(request.url))
    shown.on("console", lambda message: faults.append(message.text))
    shown.goto(pages[name].as_uri())
    assert [address for address in asked if not address.startswith("data:")] == [pages[name].as_uri()]
    assert not faults, "the page's policy forbids nothing that it needs"
    assert shown.evaluate("document.documentElement.scrollWidth") <= width
    texts = "[...document.querySelectorAll('h1,h2:not(.hidden),p,th,td,dd')]"
    cut = f"{texts}.filter(e => e.clientWidth && e.scrollWidth > e.clientWidth + 1)"
    assert shown.evaluate(f"{cut}.map(e => e.innerText)") == []
    back = shown.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (max(map(int, back[4:-1].split(","))) < 80) == (scheme == "dark")
    context.close()


def test_films_play_by_keyboard_and_stop(browser: Any, pages: dict[str, Path]) -> None:
    context = browser.new_context(viewport={"width": 900, "height": 900})
    shown = context.new_page()
    shown.goto(pages["page"].as_uri())
    decoded = "[...document.images].every(i => i.complete && i.naturalWidth > 100)"
    assert shown.evaluate(decoded)
    film = shown.locator("details.film").first
    film.locator("summary").focus()
    shown.keyboard.press("Enter")
    moving = film.locator("> img")
    assert moving.is_visible()
    seen = set()
    for _ in range(40):  # a machine that is busy may show the same moment twice
        seen.add(moving.screenshot())
        if len(seen) > 1:
            break
        shown.wait_for_timeout(110)
    assert len(seen) > 1, "it moves"
    shown.keyboard.press("Enter")
    assert not moving.is_visible()
    context.close()
