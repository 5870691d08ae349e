"""Milliseconds per rendering on one core: three panoramic cameras by channel and triangle count, and a picture.

Each figure is the best of several rounds. `python benchmarks/sensor.py --cold` measures compilation too, with an
empty Numba cache of its own.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

import numpy as np

from artiskill.assets.articulated_object import Material, VisualMesh
from artiskill.geometry.meshes import box, sphere
from artiskill.sensors.camera import Camera
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import Renderer
from artiskill.sensors.triangle_soup import BodyVisual

_CHANNEL_SETS = (("rgb", "depth", "position_w", "geom"), ("rgb",), ("depth",), ("position_w",), ("geom",))
_BODIES = 24
_COLD = "import benchmarks.sensor as s; import json, sys; print(json.dumps(s.first_picture_s()))"


def scene(triangles: int) -> tuple[list[BodyVisual], np.ndarray, np.ndarray]:
    """Balls and boxes in a ring around the robot's place, about so many triangles in all."""
    # a ball of so many rings per hemisphere has about 8 rings^2 triangles, a block 44
    rings = max(3, round(math.sqrt(max(0, triangles / _BODIES - 44) / 8)))
    ball, block = sphere(0.25, 2 * rings, rings), box((0.2, 0.2, 0.4), 0.01)
    grey = Material("grey", (0.6, 0.6, 0.6, 1.0))
    visuals, positions = [], []
    for i in range(_BODIES):
        angle, reach = 2 * math.pi * i / _BODIES, 1.0 + 0.5 * (i % 3)
        visuals += [BodyVisual(i, VisualMesh(ball.transformed((0, 0, 0.65)), grey, "ball"))]
        visuals += [BodyVisual(i, VisualMesh(block, grey, "block"))]
        positions.append((reach * math.cos(angle), reach * math.sin(angle), 0.4))
    return visuals, np.array(positions), np.tile((1.0, 0.0, 0.0, 0.0), (_BODIES, 1))


def panorama() -> list[Camera]:
    """Three cameras of 400 x 160, 120 degrees apart, 1.5 m high, 45 degrees down."""
    turns = [2 * math.pi * k / 3 for k in range(3)]
    return [Camera.look_at((0, 0, 1.5), (math.cos(a), math.sin(a), 0.5), width=400, height=160) for a in turns]


def world_view() -> Camera:
    """The camera of pictures for people, 480 x 360."""
    return Camera.look_at((-3.0, -2.0, 2.0), (0, 0, 0.5), width=480, height=360, far_m=60.0)


def best_ms(work: Callable[[], object], rounds: int) -> float:
    """Shortest of several runs after one that does not count."""
    work()
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def first_picture_s() -> float:
    """Seconds for a process's first picture, compilation included if the cache is empty."""
    visuals, positions, quaternions = scene(3000)
    start = time.perf_counter()
    Renderer(visuals, load_render_config()).render(positions, quaternions, [world_view()])
    return time.perf_counter() - start


def cold_picture_s() -> float:
    """The same in a new process with an empty cache."""
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "NUMBA_CACHE_DIR": cache, "PYTHONPATH": os.getcwd()}
        done = subprocess.run(
            [sys.executable, "-c", _COLD], env=environment, capture_output=True, text=True, check=True
        )
    return json.loads(done.stdout)


def report(triangles: int, rounds: int) -> None:
    """Print all figures of one scene."""
    visuals, positions, quaternions = scene(triangles)
    fast, cameras = Renderer(visuals, load_render_config("fast")), panorama()
    count = len(fast.soup.faces)
    for channels in _CHANNEL_SETS:
        ms = best_ms(lambda c=channels: fast.render(positions, quaternions, cameras, c), rounds)
        print(f"{count:7d} triangles, 3 x 400 x 160, {'+'.join(channels)}: {ms:.2f} ms")
    picture = Renderer(visuals, load_render_config())
    ms = best_ms(lambda: picture.render(positions, quaternions, [world_view()]), max(3, rounds // 5))
    print(f"{count:7d} triangles, picture 480 x 360, 2 x 2 samples, shadows, occlusion: {ms:.1f} ms")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--triangles", type=int, nargs="+", default=[3000, 5000, 130000])
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--cold", action="store_true", help="measure compilation too")
    options = parser.parse_args()
    for triangles in options.triangles:
        report(triangles, options.rounds)
    if options.cold:
        print(f"first picture of a process, nothing compiled yet: {cold_picture_s():.1f} s")


if __name__ == "__main__":
    main()
