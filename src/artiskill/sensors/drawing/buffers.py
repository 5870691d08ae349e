"""What drawing needs besides its inputs: each thread has its own for all scenes, which stays in near memory."""

import threading
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.drawing.scene_tables import SceneTables
from artiskill.sensors.drawing.simd import LANES


class Samples(NamedTuple):
    """Where to shade and what is there, by stages of deferred shading.

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


def allocate_samples(count: int) -> Samples:
    """Buffers for so many samples; memory that is never touched is never used."""

    def floats(*shape: int) -> Array:
        return np.empty((count, *shape), dtype=np.float32)

    def integers() -> Array:
        return np.empty(count, dtype=np.int32)

    return Samples(
        pixel=integers(),
        triangle=integers(),
        screen=floats(2),
        share=floats(),
        place_w=floats(3),
        normal_w=floats(3),
        colour=floats(3),
        shininess=floats(),
        haze=floats(),
        sunlit=floats(),
        skylit=floats(),
    )


class ShadowBuffers(NamedTuple):
    """What drawing a shadow map writes to.

    `heights` (S, S) float32 is the map itself; `triangle` (S, S) int32 and `projected` (V or more, 3) float64 may
    be those of other maps.
    """

    heights: Array
    triangle: Array
    projected: Array


# rows of all views that are finished together; few enough for their colours and depths to stay in near memory
BAND_ROWS = 16
_ALIGNMENT = 64


class Drawing(NamedTuple):
    """What is known of a view while it is drawn; in `Scratch`, of C views, with a leading dimension more.

    Attributes:
        inverse_depth: (H, W) float32, where something was drawn.
        triangle: (H, W) int32, likewise.
        drawn: (H, 2) int64 columns of each row where the two have values, from the first to before the second.
        floor: (H, 2) int64, see `Backdrop`.
        camera: (V, 3) float64 vertices as right, up, depth in the camera's frame.
        face_state: (F,) uint8, see `paint`; all `UNSEEN` between views.
        face_planes: (F, 5, 3) float32 red, green, blue, u, v: see `set_up_faces`.
        seen: (F,) int32 the faces that are seen.
        runs: (H * W, 2) int32, see `list_runs`, as the next one.
        row_runs: (H + 1,) int32.
    """

    inverse_depth: Array
    triangle: Array
    drawn: Array
    floor: Array
    camera: Array
    face_state: Array
    face_planes: Array
    seen: Array
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
        drawings: of each view.
        lit: of the view that is set up.
        projected: (V, 3) float64 vertices as screen x, y and inverse depth.
        candidates: (F + 1,) int32 faces to draw.
        backdrops: (C, 4) float64 numbers of each view's `Backdrop`.
        faces: (C,) int64 how many faces are seen.
        textured: (H * W,) int32 runs that show textured faces.
        depth: (C, BAND_ROWS * W + LANES) float32 metres of some rows.
        rgb: (C, BAND_ROWS * W + LANES, 3) uint8 colours of these.
    """

    drawings: Drawing
    lit: LitPoints
    projected: Array
    candidates: Array
    backdrops: Array
    faces: Array
    textured: Array
    depth: Array
    rgb: Array


class _Kept(threading.local):
    """What the calling thread keeps from one drawing to the next."""

    def __init__(self) -> None:
        self.scratches: dict[tuple[int, int, int], Scratch] = {}
        self.samples = allocate_samples(0)
        self.projected = np.empty((0, 3))
        self.heights: dict[tuple[int, int], np.ndarray] = {}
        self.triangles: dict[int, np.ndarray] = {}


_kept = _Kept()


def thread_scratch(scene: SceneTables, views: int, height: int, width: int) -> Scratch:
    """The calling thread's scratch for so many views of a scene; it grows with the scenes."""
    known = _kept.scratches
    scratch = known.get((views, height, width))
    if scratch is None or not _fits(scratch, scene):
        room = (0, 0, 0) if scratch is None else _room(scratch)
        sizes = map(max, _sizes(scene), room)
        known[views, height, width] = scratch = _allocate(views, height, width, *sizes)
    return scratch


def thread_samples(count: int) -> Samples:
    """The calling thread's shading samples, so many or more."""
    if len(_kept.samples.pixel) < count:
        _kept.samples = allocate_samples(count)
    return _kept.samples


def thread_shadow_buffers(sides: Sequence[int], vertices: int) -> list[ShadowBuffers]:
    """The calling thread's buffers for shadow maps of so many texels a side, all valid together.

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


def _sizes(scene: SceneTables) -> tuple[int, int, int]:
    return len(scene.vertices), len(scene.faces), len(scene.point_vertex)


def _room(scratch: Scratch) -> tuple[int, int, int]:
    return len(scratch.projected), len(scratch.candidates) - 1, scratch.lit.point_view.shape[1]


def _fits(scratch: Scratch, scene: SceneTables) -> bool:
    return all(size <= room for size, room in zip(_sizes(scene), _room(scratch), strict=True))


def _allocate(views: int, height: int, width: int, vertices: int, faces: int, points: int) -> Scratch:
    """Memory that is never touched is never used."""
    pixels = height * width
    band = BAND_ROWS * width + LANES  # vectors of lanes may begin with the last pixel
    return Scratch(
        Drawing(
            _aligned((views, height, width), np.float32),
            _aligned((views, height, width), np.int32),
            np.zeros((views, height, 2), dtype=np.int64),
            np.zeros((views, height, 2), dtype=np.int64),
            np.zeros((views, vertices, 3)),
            np.zeros((views, faces), dtype=np.uint8),
            np.empty((views, faces, 5, 3), dtype=np.float32),
            np.empty((views, faces), dtype=np.int32),
            np.empty((views, pixels, 2), dtype=np.int32),
            np.empty((views, height + 1), dtype=np.int32),
        ),
        LitPoints(
            np.zeros((2, points), dtype=np.int64),
            np.empty((2, points, 3), dtype=np.float32),
            np.zeros(1, dtype=np.int64),
        ),
        np.zeros((vertices, 3)),
        np.empty(faces + 1, dtype=np.int32),  # one more: the last entry is written before it is counted
        np.empty((views, 4)),
        np.zeros(views, dtype=np.int64),
        np.empty(pixels, dtype=np.int32),
        np.zeros((views, band), dtype=np.float32),
        np.empty((views, band, 3), dtype=np.uint8),
    )


def _aligned(shape: tuple[int, ...], kind: type[np.generic]) -> np.ndarray:
    """An array that begins with a line of the processor's cache."""
    size = int(np.prod(shape)) * np.dtype(kind).itemsize
    memory = np.empty(size + _ALIGNMENT, dtype=np.uint8)
    start = -memory.ctypes.data % _ALIGNMENT
    return memory[start : start + size].view(kind).reshape(shape)


@kernel
def drawing_of(drawings: Drawing, view: int) -> Drawing:
    """One view's part."""
    return Drawing(
        drawings.inverse_depth[view],
        drawings.triangle[view],
        drawings.drawn[view],
        drawings.floor[view],
        drawings.camera[view],
        drawings.face_state[view],
        drawings.face_planes[view],
        drawings.seen[view],
        drawings.runs[view],
        drawings.row_runs[view],
    )
