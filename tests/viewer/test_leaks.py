"""An hour at the page, compressed: many episodes, many browsers that come and go."""

import gc
import os
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.viewer.episode_page import EpisodePage
from artiskill.viewer.pickers import LivePicker

EPISODES, VISITS = 200, 50
PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")

pytestmark = pytest.mark.slow


def memory_mb() -> float:
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE_BYTES / 1e6


def visit(server: Any, page: EpisodePage) -> int:
    """Open the page as a browser does, read until all is there, and leave; return the bytes."""
    import viser
    from websockets.sync.client import connect

    version = f"viser-v{viser.__version__}"
    address, read = f"ws://127.0.0.1:{server.get_port()}", 0
    with connect(address, subprotocols=[version], max_size=None, compression=None) as browser:
        try:
            while True:
                read += len(browser.recv(timeout=0.3))
                page.update()
        except TimeoutError:
            pass
    return read


def test_nothing_grows(server: Any, capsys: pytest.CaptureFixture[str]) -> None:
    """Memory may settle in the first half; the second half must not need more."""
    picker = LivePicker(EpisodeChoice("OpenCabinetDrawer", "cabinet-0002"))
    page = EpisodePage(server, picker, plays=False)
    page._cloud.value = page._contacts.value = True
    messages = server._websock_server._broadcast_buffer.message_from_id
    found = []
    for number in range(EPISODES):
        page._picker._level.value, page._picker._object.value = number, f"cabinet-{2 + number % 2:04d}"
        page._picker._choose_object()
        page.load()
        page.player.step(20)
        page._switch_hand(True)
        page.player.step(5)
        page._switch_hand(False)
        page.show()
        if number % (EPISODES // VISITS) == 0:
            assert visit(server, page) > 1e5
        if number % (EPISODES // 4) == EPISODES // 4 - 1:
            time.sleep(1.0)  # clients leave
            found.append((memory_mb(), threading.active_count(), len(messages)))
    with capsys.disabled():
        print("\nMB, threads and messages kept after each quarter:", found)
    (_, _, _), (half_mb, half_threads, half_messages), _, (last_mb, last_threads, last_messages) = found
    assert last_mb - half_mb < 15.0
    assert last_threads <= half_threads
    assert last_messages <= half_messages + 50
