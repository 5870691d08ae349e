"""Milliseconds per rendering: three cameras of 400 x 160, by channel, stage, triangle count and threads.

Each figure is the best of several rounds. Where MuJoCo's OpenGL renderer works (`pip install mujoco PyOpenGL`, a
driver, `MUJOCO_GL=egl` or `osmesa`), it draws the same scenes in the same run, in turns with ours.
`python benchmarks/sensor.py --cold` measures compilation too, with an empty Numba cache of its own.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from sensor_scenes import BenchmarkScene, ring, robot_and_cabinet

from artiskill.sensors.camera import Camera, CameraBatch, view_at, views_of
from artiskill.sensors.drawing.backdrop import resolve_depth, resolve_ids, resolve_position
from artiskill.sensors.drawing.buffers import BAND_ROWS, buffers_at, thread_scratch
from artiskill.sensors.drawing.fast_shading import forget_faces, list_runs, set_up_faces
from artiskill.sensors.drawing.rasterise import draw_view
from artiskill.sensors.drawing.render import colour_rows, pose_at
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import Renderer

_ALL = ("rgb", "depth", "position_w", "geom")
_CHANNEL_SETS = (_ALL, ("rgb",), ("depth",), ("position_w",), ("geom",))
_ENVIRONMENTS = 8
_TURN = 5
_COLD = "import benchmarks.sensor as s; import json, sys; print(json.dumps(s.first_picture_s()))"


_clock: Callable[[], float] = time.perf_counter


def best_ms(works: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Shortest of several runs of each; turns of a few runs, so that none works in the caches of another."""
    for work in works.values():
        work()
    times: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(max(1, rounds // _TURN)):
        for name, work in works.items():
            for _ in range(_TURN):
                start = _clock()
                work()
                times[name].append(_clock() - start)
    return {name: 1e3 * min(spent) for name, spent in times.items()}


def report_channels(scene: BenchmarkScene, renderer: Renderer, rounds: int) -> None:
    """By channel, with memory of its own for each result and with memory used again."""
    for channels in _CHANNEL_SETS:

        def draw(out: object = None, channels: tuple[str, ...] = channels) -> object:
            return renderer.render(scene.positions, scene.quaternions, scene.cameras, channels, out)

        out = draw()
        ms = best_ms({"new": draw, "reused": lambda out=out, draw=draw: draw(out)}, rounds)
        print(f"  {'+'.join(channels):32s} {ms['new']:6.2f} ms, into given arrays {ms['reused']:6.2f} ms")


class Stages:
    """The stages of drawing a scene's views, each a call of its own."""

    def __init__(self, scene: BenchmarkScene, renderer: Renderer) -> None:
        self.size = scene.cameras[0].height, scene.cameras[0].width
        self.scene, self.light = renderer.scene, renderer.lights
        inputs = renderer.rasterise(scene.positions, scene.quaternions, views_of(scene.cameras)).inputs
        self.inputs, self.pose = inputs, pose_at(inputs.poses, 0)
        self.scratch = thread_scratch(self.scene, len(scene.cameras), *self.size)
        self.views = [view_at(inputs.views, k) for k in range(len(scene.cameras))]
        self.buffers = [buffers_at(self.scratch.views, k) for k in range(len(self.views))]
        self.depth, self.ids = np.empty(self.size, np.float32), np.empty(self.size, np.int32)
        self.xyz = np.empty((*self.size, 3), np.float32)
        self.draw()

    def draw(self) -> None:
        """Into the buffers."""
        for view, buffers in zip(self.views, self.buffers, strict=True):
            draw_view(self.scene, self.pose, view, True, buffers, self.scratch)

    def runs(self) -> None:
        """Lists of runs and faces."""
        for buffers in self.buffers:
            forget_faces(buffers)
            list_runs(buffers)

    def set_up(self) -> None:
        """Faces ready for colouring."""
        for view, buffers in zip(self.views, self.buffers, strict=True):
            set_up_faces(self.scene, self.pose.rotations, view, self.light, buffers, self.scratch.lit)

    def colour(self) -> None:
        """Depths and colours, band by band."""
        for k, view in enumerate(self.views):
            for top in range(0, self.size[0], BAND_ROWS):
                rows = top, min(BAND_ROWS, self.size[0] - top)
                colour_rows(k, *rows, self.scene, view, self.light, self.inputs.picture, self.scratch)

    def resolve_depth(self) -> None:
        """Depth of whole views."""
        for buffers in self.buffers:
            resolve_depth(0, buffers, self.depth)

    def resolve_positions(self) -> None:
        """World positions of whole views."""
        for view in self.views:
            resolve_position(self.depth, view, self.xyz)

    def resolve_ids(self) -> None:
        """Ids of whole views."""
        for buffers in self.buffers:
            resolve_ids(buffers, self.scene.face_geom, self.scene.geom_body_id, self.ids)

    def forget(self) -> None:
        """Leave the thread's scratch as it was found."""
        for buffers in self.buffers:
            forget_faces(buffers)


def report_stages(scene: BenchmarkScene, renderer: Renderer, rounds: int) -> None:
    """Each stage alone, for all three cameras; the calls take some of it, most of that of the colours."""
    stages = Stages(scene, renderer)
    works = {
        "poses": lambda: renderer._poses(scene.positions[None], scene.quaternions[None]),
        "cull, project, scan": stages.draw,
        "runs": stages.runs,
        "faces": stages.set_up,
        "depth and colours": stages.colour,
        "depth": stages.resolve_depth,
        "positions": stages.resolve_positions,
        "ids": stages.resolve_ids,
    }
    ms = best_ms(works, rounds)
    stages.forget()
    print("  by stage: " + ", ".join(f"{name} {value:.3f}" for name, value in ms.items()) + " ms")


def report_threads(scene: BenchmarkScene, renderer: Renderer, rounds: int) -> None:
    """Eight environments by one thread and by two."""
    n = _ENVIRONMENTS
    positions, quaternions = (np.repeat(a[None], n, axis=0) for a in (scene.positions, scene.quaternions))
    cameras = CameraBatch(
        np.repeat(np.array([c.position_w for c in scene.cameras])[None], n, axis=0),
        np.repeat(np.array([c.rotation_w for c in scene.cameras])[None], n, axis=0),
        scene.cameras[0].width,
        scene.cameras[0].height,
    )
    out = renderer.render_batch(positions, quaternions, cameras, _ALL)

    def draw(threads: int) -> object:
        return renderer.render_batch(positions, quaternions, cameras, _ALL, out, threads)

    ms = best_ms({"1": lambda: draw(1), "2": lambda: draw(2)}, rounds)
    print(f"  {n} environments: 1 thread {ms['1']:.2f} ms, 2 threads {ms['2']:.2f} ms: {ms['1'] / ms['2']:.2f} x")


def report_gl(scene: BenchmarkScene, renderer: Renderer, rounds: int) -> None:
    """Against MuJoCo's OpenGL renderer, if it works here."""
    try:
        import sensor_gl

        gl = sensor_gl.GlSensor(scene)
        name = sensor_gl.driver()
    except Exception as error:
        # every backend fails in its own way: no module, no library, no driver, no context
        print(f"  MuJoCo's OpenGL renderer: not available ({type(error).__name__}: {error})")
        return
    poses = scene.positions, scene.quaternions
    out = renderer.render(*poses, scene.cameras, _ALL)

    def draw_and_convert() -> None:
        gl.render()
        gl.convert()

    works = {
        "ours": lambda: renderer.render(*poses, scene.cameras, _ALL, out),
        "gl": gl.render,
        "same": draw_and_convert,
    }
    ms = best_ms(works, rounds)
    print(
        f"  ours {ms['ours']:.2f} ms, MuJoCo's OpenGL {ms['gl']:.2f} ms ({name}): {ms['gl'] / ms['ours']:.1f} x; "
        f"with the same outputs {ms['same']:.2f} ms: {ms['same'] / ms['ours']:.1f} x"
    )
    print(f"  {gl.differences(out)}")
    gl.close()


def world_view() -> Camera:
    """The camera of pictures for people, 480 x 360."""
    return Camera.look_at((-3.0, -2.0, 2.0), (0, 0, 0.5), width=480, height=360, far_m=60.0)


def report_picture(scene: BenchmarkScene, rounds: int) -> None:
    """A picture for people."""
    picture = Renderer(scene.visuals, load_render_config())
    poses = scene.positions, scene.quaternions
    ms = best_ms({"picture": lambda: picture.render(*poses, [world_view()])}, max(3, rounds // 5))
    print(f"  picture 480 x 360, 2 x 2 samples, shadows, occlusion: {ms['picture']:.1f} ms")


def first_picture_s() -> float:
    """Seconds for a process's first picture, compilation included if the cache is empty."""
    scene = ring(3000)
    start = time.perf_counter()
    picture = Renderer(scene.visuals, load_render_config())
    picture.render(scene.positions, scene.quaternions, [world_view()], ("rgb", "depth"))
    return time.perf_counter() - start


def cold_picture_s() -> float:
    """The same in a new process with an empty cache."""
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "NUMBA_CACHE_DIR": cache, "PYTHONPATH": os.getcwd()}
        done = subprocess.run(
            [sys.executable, "-c", _COLD], env=environment, capture_output=True, text=True, check=True
        )
    return json.loads(done.stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--objects", nargs="*", default=["cabinet-0003"], help="cabinets to stand before the robot"
    )
    parser.add_argument("--triangles", type=int, nargs="*", default=[1000, 5000, 30000, 130000])
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--cold", action="store_true", help="measure compilation too")
    parser.add_argument(
        "--processor-time",
        action="store_true",
        help="count processor time, of all threads together: for a machine on which others work too",
    )
    options = parser.parse_args()
    if options.processor_time:
        global _clock
        _clock = time.process_time
    for scene in [*map(robot_and_cabinet, options.objects), *map(ring, options.triangles)]:
        renderer = Renderer(scene.visuals, load_render_config("fast"))
        print(f"{scene.name}: {len(renderer.scene.faces)} triangles, 3 x 400 x 160")
        report_channels(scene, renderer, options.rounds)
        report_stages(scene, renderer, options.rounds)
        report_threads(scene, renderer, options.rounds)
        report_gl(scene, renderer, options.rounds)
        report_picture(scene, options.rounds)
    if options.cold:
        print(f"first picture of a process, nothing compiled yet: {cold_picture_s():.1f} s")


if __name__ == "__main__":
    main()
