"""Pages in a headless Chromium that draws in software: slow, so windows are small; for `make test-viewer`."""

import base64
import io
import math
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from artiskill.demos.demos import PACK
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.geometry.rotations import transform_points
from artiskill.viewer.episode_page import EpisodePage
from artiskill.viewer.pickers import LivePicker
from artiskill.viewer.playback import LiveEpisode
from artiskill.viewer.replay import export_episode

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--use-gl=angle", "--enable-unsafe-swiftshader"]
SIZE = 480, 260  # of pictures that are compared
WAIT_MS = 240_000  # where several people use the processor
ORANGE, WHITE, PINK = (230, 120, 0), (235, 235, 235), (255, 32, 96)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    api = pytest.importorskip("playwright.sync_api")
    pytest.importorskip("viser")
    if CHROMIUM is None:
        pytest.skip("there is no Chromium")
    with api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield started
        started.close()


@pytest.fixture
def open_page(browser: Any) -> Iterator[Callable[[str], Any]]:
    """What opens an address; a page that reports an error fails its test."""
    faults: list[str] = []
    context = browser.new_context(viewport={"width": 760, "height": 420})

    def opened(address: str) -> Any:
        page = context.new_page()
        page.set_default_timeout(WAIT_MS)
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.goto(address)
        page.wait_for_selector("canvas")
        return page

    yield opened
    context.close()
    assert not faults


@pytest.fixture
def view() -> Iterator[Callable[..., str]]:
    """What runs `artiskill view` and returns its address."""
    processes: list[subprocess.Popen[str]] = []

    def started(*arguments: str) -> str:
        command = [sys.executable, "-m", "artiskill", "view", "--port", "0", *arguments]
        processes.append(
            subprocess.Popen(
                command,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # which may be ignored here
            )
        )
        assert processes[-1].stdout is not None
        line = processes[-1].stdout.readline()
        found = re.match(r"open (\S+) in", line)
        assert found is not None, line
        return found[1]

    yield started
    for process in processes:
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=60) == 130
        assert process.stdout is not None
        assert process.stdout.read() == ""
        process.stdout.close()


# plots have canvases, too
SCENE = "[...document.querySelectorAll('canvas')].sort((a, b) => b.width * b.height - a.width * a.height)[0]"


def drawn(page: Any) -> np.ndarray:
    """Return what the scene's canvas shows, (H, W, 3); viser draws fewer pixels where that takes long."""
    address = page.evaluate(f"{SCENE}.toDataURL('image/png')")
    return decoded(address)


def decoded(address: str) -> np.ndarray:
    """Return a picture that is written as an address, (H, W, 3)."""
    if len(address) < 100:  # it has no size yet
        return np.zeros((1, 1, 3), int)
    with Image.open(io.BytesIO(base64.b64decode(address.split(",")[1]))) as image:
        return np.asarray(image.convert("RGB").resize(SIZE, Image.Resampling.NEAREST)).astype(int)


def share_of(picture: np.ndarray, colour: tuple[int, int, int], within: int = 45) -> float:
    return float((np.abs(picture - colour).max(axis=-1) < within).mean())


def until(page: Any, holds: Callable[[np.ndarray], bool]) -> np.ndarray:
    """Wait until what is drawn has a property; return it."""
    before = drawn(page)
    for _ in range(120):
        page.wait_for_timeout(500)
        picture = drawn(page)
        if holds(picture) and not changed(before)(picture):  # surfaces arrive one after the other
            return picture
        before = picture
    raise AssertionError("it was never drawn")


def changed(before: np.ndarray, share: float = 0.003) -> Callable[[np.ndarray], bool]:
    return lambda picture: bool(
        picture.shape == before.shape and (np.abs(picture - before).max(axis=-1) > 40).mean() > share
    )


def press(page: Any, name: str) -> None:
    page.get_by_text(name, exact=True).first.click()


def state_is(page: Any, pattern: str) -> None:
    page.wait_for_function("pattern => new RegExp(pattern).test(document.body.innerText)", arg=pattern)


def test_an_episode_is_drawn_stepped_and_played_to_its_end(view: Any, open_page: Any) -> None:
    page = open_page(view("--paused", "--object", "cabinet-0002", "--level", "3"))
    first = until(page, lambda picture: share_of(picture, WHITE) > 0.005 and share_of(picture, ORANGE, 70) > 5e-5)
    state_is(page, "step 0 ")
    press(page, "step")
    press(page, "step")
    state_is(page, "step 2 ")
    press(page, "back")
    state_is(page, "step 1 ")
    press(page, "play")
    state_is(page, "· solved")
    last = until(page, changed(first))
    press(page, "restart")
    state_is(page, "step 0 ")
    until(page, changed(last))


def test_switches_change_what_is_drawn(view: Any, open_page: Any) -> None:
    page = open_page(view("--paused", "--object", "cabinet-0002", "--level", "3"))
    before = until(page, lambda picture: share_of(picture, WHITE) > 0.005)
    page.get_by_label("point cloud", exact=True).first.click()
    with_cloud = until(page, changed(before))
    page.get_by_label("surfaces", exact=True).first.click()
    until(page, changed(with_cloud))


def test_a_person_drags_a_hand_and_drives(view: Any, open_page: Any) -> None:
    """With the mouse at the gizmo's pink arrow, and with a key; paused, for the browser draws slowly."""
    page = open_page(view("--paused", "--object", "cabinet-0002", "--level", "3", "--policy", "still"))
    until(page, lambda picture: share_of(picture, WHITE) > 0.005)
    press(page, "by hand")
    press(page, "drive")
    before = until(page, lambda picture: share_of(picture, PINK, 70) > 1e-4)
    rows, columns = np.nonzero(np.abs(before - PINK).max(axis=-1) < 70)
    tip, middle = rows.argmax(), np.array((columns.mean(), rows.mean()))
    start = np.array((columns[tip], rows[tip]))
    end = start + 12 * (start - middle) / np.linalg.norm(start - middle)
    scale = np.array([page.viewport_size[name] for name in ("width", "height")]) / SIZE
    page.mouse.move(*(start * scale))
    page.mouse.down()
    page.mouse.move(*(end * scale), steps=5)
    page.mouse.up()
    dragged = until(page, lambda picture: (picture != before).any())
    for _ in range(15):
        press(page, "step")
    followed = until(page, changed(dragged, 0.0005))
    page.keyboard.press("i")
    page.wait_for_timeout(1000)
    for _ in range(6):
        press(page, "step")
    until(page, changed(followed))


def test_a_drawer_is_opened_with_keys(server: Any, open_page: Any) -> None:
    """As the guide says, in real time; where the hand is, the test sees from the simulation."""
    choice = EpisodeChoice(
        "OpenCabinetDrawer", "cabinet-0002", level=3, policy="still", config={"episode_steps": 9000}
    )
    page, is_over = EpisodePage(server, LivePicker(choice)), threading.Event()

    def run() -> None:
        while not is_over.is_set():
            page.update()
            time.sleep(0.01)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        shown = open_page(f"http://127.0.0.1:{server.get_port()}")
        press(shown, "by hand")
        press(shown, "drive")  # after which keys are the robot's at once
        state_is(shown, r"step \d\d+ ")
        shown.set_viewport_size({"width": 400, "height": 200})  # soon drawn
        episode = page.player.timeline
        assert isinstance(episode, LiveEpisode)
        handle, link = (
            episode.scene.object.handles_of(episode.target)[0],
            episode.scene.object.link_index(episode.target),
        )

        def snapshot() -> Any:
            return episode.moment(len(episode) - 1).context.snapshot

        def drive_to(ahead_m: float, most: float) -> None:
            for _ in range(60):
                now = snapshot()
                grasp_w = transform_points(
                    now.link_position_w[0, link], now.link_quaternion_w[0, link], handle.grasp_positions[:1]
                )[0]
                yaw = float(now.robot_qpos[0, 2])
                x, y, z = grasp_w - now.tool_position_w[0, 0]
                ways = {
                    "ik": x * np.cos(yaw) + y * np.sin(yaw) - ahead_m,
                    "jl": y * np.cos(yaw) - x * np.sin(yaw),
                    "yh": z,
                    "uo": -math.remainder(yaw, math.tau) / 2,  # a key turns by 0.09 rad
                }
                keys = max(ways, key=lambda name: abs(ways[name]))
                if abs(ways[keys]) < most:
                    return
                shown.keyboard.press(keys[0] if ways[keys] > 0 else keys[1])
                shown.wait_for_timeout(500)

        for _ in range(5):  # who has missed the handle tries again
            drive_to(0.2, 0.04)
            drive_to(0.01, 0.03)
            shown.keyboard.press("n")
            shown.wait_for_timeout(1500)
            for _ in range(20):
                shown.keyboard.press("k")
                shown.wait_for_timeout(150)
            if page.player.at_end:
                break
            shown.keyboard.press("n")
        state_is(shown, "· solved")
    finally:
        is_over.set()
        thread.join()


def test_two_browsers_show_the_same(view: Any, open_page: Any) -> None:
    address = view("--paused", "--task", "MoveBucket", "--policy", "still")
    first, second = open_page(address), open_page(address)
    press(first, "step")
    for page in (first, second):
        state_is(page, "step 1 ")


def test_demonstrations_are_scrubbed(view: Any, open_page: Any) -> None:
    page = open_page(view(str(PACK / "OpenCabinetDoor"), "--paused"))
    first = until(page, lambda picture: share_of(picture, WHITE) > 0.005)
    box = page.locator("input[inputmode=decimal]").first
    box.fill("60")
    box.press("Enter")
    state_is(page, "step 60 ")
    until(page, changed(first))


def test_joints_of_an_object_are_moved_and_checked(view: Any, open_page: Any) -> None:
    page = open_page(view("cabinet-0005"))
    page.wait_for_timeout(2000)
    closed = drawn(page)
    press(page, "open")
    until(page, changed(closed))
    press(page, "check")
    state_is(page, r"\d+ results, no fault")


def test_an_exported_episode_plays_without_a_server(open_page: Any, tmp_path: Path) -> None:
    pytest.importorskip("viser")
    path = export_episode(LiveEpisode(EpisodeChoice("PushChair", "chair-0004")), tmp_path / "chair.html")
    page = open_page(path.as_uri())
    page.set_viewport_size({"width": 400, "height": 240})  # it plays without a pause
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    first = np.zeros((1, 1, 3), int)
    for _ in range(60):  # it never settles
        page.wait_for_timeout(500)
        picture = drawn(page)
        if share_of(picture, WHITE) > 0.005 and changed(first)(picture):
            break
        first = picture if share_of(picture, WHITE) > 0.005 else first
    else:
        pytest.fail("nothing moves")
    assert not [url for url in asked if url.startswith("http")]


# of a replay of one second: a picture of its middle, one of its end, and those that follow when it begins anew
MIDDLE_END_AND_AGAIN = f"""async () => {{
    const time = () => parseFloat(document.querySelector("input").value);
    const picture = () => new Promise(done => requestAnimationFrame(() => done({SCENE}.toDataURL("image/png"))));
    const found = [];
    for (let before = 0, now = time(); now >= before || !(found[0] && found[1]); before = now, now = time()) {{
        const shown = await picture();
        if (now > 0.4 && now < 0.9) found[0] = shown;
        if (now > 1.3 && now < 1.9) found[1] = shown;
    }}
    for (let k = 0; k < 6; k++) found.push(await picture());
    return found;
}}"""


def test_a_replay_that_begins_anew_does_not_show_its_last_caption(open_page: Any, tmp_path: Path) -> None:
    pytest.importorskip("viser")
    choice = EpisodeChoice("OpenCabinetDrawer", "cabinet-0002", policy="still", config={"episode_steps": 20})
    page = open_page(export_episode(LiveEpisode(choice), tmp_path / "still.html").as_uri())
    page.set_viewport_size({"width": 400, "height": 240})
    until(page, lambda picture: share_of(picture, WHITE) > 0.005)
    middle, end, *again = (decoded(one).max(axis=-1) for one in page.evaluate(MIDDLE_END_AND_AGAIN))
    letters = (end < 90) & (middle >= 90)  # nothing else changes, for the robot stands still
    assert letters.sum() > 20
    rows, columns = np.nonzero(letters)
    around = np.zeros_like(letters)
    around[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1] = True
    around &= end > 180

    def is_last_caption(picture: np.ndarray) -> bool:  # the scene itself is dark or bright for a moment
        return bool((picture[letters] < 90).mean() > 0.5 and (picture[around] > 180).mean() > 0.5)

    assert is_last_caption(end)
    assert not any(map(is_last_caption, again))
