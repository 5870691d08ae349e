"""How soon `artiskill view` shows its first picture, in a headless Chromium that is already running.

    python benchmarks/viewer.py [--times 5] [arguments of `artiskill view`]

prints the seconds from the command to the address, to the first picture of the scene, and to the last change of
what is drawn: textures come last. The page is opened as soon as its address is printed; it is not played. A run
before warms up and is not counted. Needs `artiskill[test-viewer]` and Chromium, which draws WebGL in software
here: with a graphics card it is faster.
"""

import argparse
import re
import shutil
import signal
import statistics
import subprocess
import sys
import time
from typing import Any

from playwright.sync_api import sync_playwright

FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--use-gl=angle", "--enable-unsafe-swiftshader"]
SIZE = {"width": 760, "height": 420}
REST_MS = 3000  # after the first picture, in which the last one comes
# the times at which the scene's picture changed, and how many colours it had, looked at ten times a second
WATCH = """
window.pictures = [];
const small = document.createElement("canvas");
[small.width, small.height] = [64, 36];
const context = small.getContext("2d", {willReadFrequently: true});
let last = "";
setInterval(() => {
    const area = canvas => canvas.width * canvas.height;
    const scene = [...document.querySelectorAll("canvas")].sort((a, b) => area(b) - area(a))[0];
    if (!scene || area(scene) < 10000) return;
    context.drawImage(scene, 0, 0, 64, 36);
    const data = context.getImageData(0, 0, 64, 36).data, colours = new Set();
    for (let k = 0; k < data.length; k += 4) colours.add((data[k] << 16) + (data[k + 1] << 8) + data[k + 2]);
    const now = [...data].join();
    if (now !== last) window.pictures.push([(performance.timeOrigin + performance.now()) / 1000, colours.size]);
    last = now;
}, 100);
"""
COLOURS = 60  # an empty page has fewer


def main() -> None:
    """Print a line for each run, and the medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=5)
    arguments, of_view = parser.parse_known_args()
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        found = [measured(browser, of_view) for _ in range(arguments.times + 1)][1:]
        browser.close()
    for row in (*found, [statistics.median(column) for column in zip(*found, strict=True)]):
        print("address {:.2f} s, first picture {:.2f} s, last change {:.2f} s".format(*row))
    print("the last line: medians")


def measured(browser: Any, of_view: list[str]) -> tuple[float, float, float]:
    """Return the seconds from the command to address, first picture and last change."""
    page = browser.new_page(viewport=SIZE)
    page.add_init_script(WATCH)
    started = time.time()
    command = [sys.executable, "-m", "artiskill", "view", "--port", "0", "--paused", *of_view]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = re.match(r"open (\S+) in", process.stdout.readline())
        assert address is not None
        address_s = time.time() - started
        page.goto(address[1])
        page.wait_for_function(f"window.pictures.some(([at, colours]) => colours > {COLOURS})", timeout=60_000)
        page.wait_for_timeout(REST_MS)
        times = [at - started for at, colours in page.evaluate("window.pictures") if colours > COLOURS]
        process.send_signal(signal.SIGINT)
    page.close()
    return address_s, times[0], times[-1]


if __name__ == "__main__":
    main()
