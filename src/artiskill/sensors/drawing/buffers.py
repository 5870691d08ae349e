"""What drawing writes to: each thread has its own for all scenes, so that it stays in near memory."""

import threading
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, structure_kernel
from artiskill.sensors.drawing.scene_tables import SceneTables
from artiskill.sensors.drawing.simd import LANES

# rows of all views that are finished together; few enough for their colours and depths to stay in near memory
BAND_ROWS = 16
_ALIGNMENT = 64


class ViewBuffers(NamedTuple):
    """What is known of a view while it is drawn; in `Scratch`, of C views, with a leading dimension more.

    Attributes:
        inverse_depth: (H, W) float32, where something was drawn.
        triangle: (H, W) int32, likewise.
        drawn: (H, 2) int64 columns of each row where the two have values, from the first to before the second.
        backdrop: (4,) float64 numbers of the view's `Backdrop`.
        floor: (H, 2) int64, see `Backdrop`.
        line: (W + LANES, 3) uint8 colours of a row without faces.
        camera: (V, 3) float64 vertices as right, up, depth in the camera's frame.
        face_state: (F,) uint8, see `fast_shading`; all `UNSEEN` between views.
        face_planes: (F, 5, 3) float32 red, green, blue, u, v: see `set_up_faces`.
        seen: (F,) int32 the faces that are seen.
        face_count: (1,) int64 how many these are.
        runs: (H * W, 2) int32, see `list_runs`, as the next one.
        row_runs: (H + 1,) int32.
    """

    inverse_depth: Array
    triangle: Array
    drawn: Array
    backdrop: Array
    floor: Array
    line: Array
    camera: Array
    face_state: Array
    face_planes: Array
    seen: Array
    face_count: Array
    runs: Array
    row_runs: Array


class LitPoints(NamedTuple):
    """Colours of a view's lit points (S of them), each computed once.

    Attributes:
        point_view: (2, S) int64 the view for which a lit point's colour is known, for its front and its back.
        point_colours: (2, S, 3) float32 display colours [0, 255].
        views: (1,) int64 how many views were drawn.
    """

    point_view: Array
    point_colours: Array
    views: Array


class Scratch(NamedTuple):
    """Of one thread, for up to C views of a resolution.

    Attributes:
        views: of each view.
        lit: of the view that is set up.
        projected: (V, 3) float64 vertices as screen x, y and inverse depth.
        candidates: (F + 1,) int32 faces to draw.
        clipped: (4, 3) float64 corners of a face that reaches before the near plane, as `projected`.
        textured: (H * W,) int32 runs that show textured faces.
        coordinates: (3, W) float32 x, y and z of a row's points.
        depth: (C, BAND_ROWS * W + LANES) float32 metres of some rows.
        rgb: (C, BAND_ROWS * W + LANES, 3) uint8 colours of these.
    """

    views: ViewBuffers
    lit: LitPoints
    projected: Array
    candidates: Array
    clipped: Array
    textured: Array
    coordinates: Array
    depth: Array
    rgb: Array


class Samples(NamedTuple):
    """Where a picture is shaded and what is there, by stages of deferred shading; the first `count` are used.

    From `collect_samples`: `pixel` (S,) int32 row * width + column, `triangle` (S,) int32, `screen` (S, 2)
    float32 x and y in samples, `share` (S,) float32 of its pixel. From the attribute kernels: `place_w` (S, 3),
    `normal_w` (S, 3), `colour` (S, 3) linear albedo, later light; `shininess` (S,); `haze` (S,) share of the
    horizon's colour. From shadow kernels: `sunlit` (S,), `skylit` (S,), both in [0, 1]. All float32.
    """

    pixel: Array
    triangle: Array
    screen: Array
    share: Array
    place_w: Array
    normal_w: Array
    colour: Array
    shininess: Array
    haze: Array
    sunlit: Array
    skylit: Array


class ShadowBuffers(NamedTuple):
    """What drawing a shadow map writes to.

    `heights` (S, S) float32 is the map itself; `triangle` (S, S) int32 and `projected` (V or more, 3) float64 may
    be those of other maps.
    """

    heights: Array
    triangle: Array
    projected: Array


class _Kept(threading.local):
    """What the calling thread keeps from one drawing to the next."""

    def __init__(self) -> None:
        self.scratches: dict[tuple[int, int, int], Scratch] = {}
        self.samples = _allocate_samples(0)
        self.projected = np.empty((0, 3))
        self.heights: dict[tuple[int, int], np.ndarray] = {}
        self.triangles: dict[int, np.ndarray] = {}


def thread_scratch(scene: SceneTables, views: int, height: int, width: int) -> Scratch:
    """Return the calling thread's scratch for so many views of a scene; it grows with the scenes."""
    known = _kept.scratches
    scratch = known.get((views, height, width))
    sizes = len(scene.vertices), len(scene.faces), len(scene.point_normals)
    room = (0, 0, 0)
    if scratch is not None:
        room = len(scratch.projected), len(scratch.candidates) - 1, scratch.lit.point_view.shape[1]
    if scratch is None or any(size > most for size, most in zip(sizes, room, strict=True)):
        known[views, height, width] = scratch = allocate_scratch(views, height, width, *map(max, sizes, room))
    return scratch


def thread_samples(count: int) -> Samples:
    """Return the calling thread's shading samples, so many or more."""
    if len(_kept.samples.pixel) < count:
        _kept.samples = _allocate_samples(count)
    return _kept.samples


def thread_shadow_buffers(sides: Sequence[int], vertices: int) -> list[ShadowBuffers]:
    """Return the calling thread's buffers for shadow maps of so many texels a side, all valid together.

    Args:
        sides: one per map.
        vertices: of the scene.
    """
    if len(_kept.projected) < vertices:
        _kept.projected = np.empty((vertices, 3))
    for number, side in enumerate(sides):
        if (number, side) not in _kept.heights:
            _kept.heights[number, side] = np.empty((side, side), dtype=np.float32)
        if side not in _kept.triangles:
            _kept.triangles[side] = np.empty((side, side), dtype=np.int32)
    return [
        ShadowBuffers(_kept.heights[number, side], _kept.triangles[side], _kept.projected)
        for number, side in enumerate(sides)
    ]


def allocate_scratch(views: int, height: int, width: int, vertices: int, faces: int, points: int) -> Scratch:
    """Allocate a scratch; memory that is never touched is never used."""
    pixels = height * width
    band = BAND_ROWS * width + LANES  # vectors of lanes may begin with the last pixel
    return Scratch(
        views=ViewBuffers(
            inverse_depth=_aligned((views, height, width), np.float32),
            triangle=_aligned((views, height, width), np.int32),
            drawn=np.zeros((views, height, 2), dtype=np.int64),
            backdrop=np.empty((views, 4)),
            floor=np.zeros((views, height, 2), dtype=np.int64),
            line=np.empty((views, width + LANES, 3), dtype=np.uint8),
            camera=np.zeros((views, vertices, 3)),
            face_state=np.zeros((views, faces), dtype=np.uint8),
            face_planes=np.empty((views, faces, 5, 3), dtype=np.float32),
            seen=np.empty((views, faces), dtype=np.int32),
            face_count=np.zeros((views, 1), dtype=np.int64),
            runs=np.empty((views, pixels, 2), dtype=np.int32),
            row_runs=np.empty((views, height + 1), dtype=np.int32),
        ),
        lit=LitPoints(
            point_view=np.zeros((2, points), dtype=np.int64),
            point_colours=np.empty((2, points, 3), dtype=np.float32),
            views=np.zeros(1, dtype=np.int64),
        ),
        projected=np.zeros((vertices, 3)),
        candidates=np.empty(faces + 1, dtype=np.int32),  # one more: the last is written before it is counted
        clipped=np.empty((4, 3)),
        textured=np.empty(pixels, dtype=np.int32),
        coordinates=np.empty((3, width), dtype=np.float32),
        depth=np.zeros((views, band), dtype=np.float32),
        rgb=np.empty((views, band, 3), dtype=np.uint8),
    )


def _aligned(shape: tuple[int, ...], kind: type[np.generic]) -> np.ndarray:
    """Return an array that begins with a line of the processor's cache."""
    size = int(np.prod(shape)) * np.dtype(kind).itemsize
    memory = np.empty(size + _ALIGNMENT, dtype=np.uint8)
    start = -memory.ctypes.data % _ALIGNMENT
    return memory[start : start + size].view(kind).reshape(shape)


def _allocate_samples(count: int) -> Samples:
    integers = {name: np.empty(count, dtype=np.int32) for name in ("pixel", "triangle")}
    single = {name: np.empty(count, np.float32) for name in ("share", "shininess", "haze", "sunlit", "skylit")}
    places = {name: np.empty((count, 3), dtype=np.float32) for name in ("place_w", "normal_w", "colour")}
    return Samples(screen=np.empty((count, 2), dtype=np.float32), **integers, **single, **places)


_kept = _Kept()


@structure_kernel
def buffers_at(views: ViewBuffers, k: int) -> ViewBuffers:
    """Return one view's buffers."""
    return ViewBuffers(
        views.inverse_depth[k],
        views.triangle[k],
        views.drawn[k],
        views.backdrop[k],
        views.floor[k],
        views.line[k],
        views.camera[k],
        views.face_state[k],
        views.face_planes[k],
        views.seen[k],
        views.face_count[k],
        views.runs[k],
        views.row_runs[k],
    )
