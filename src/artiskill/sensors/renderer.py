"""`Renderer`: a scene's surfaces, poses of its bodies and cameras to images."""

import math
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from artiskill.errors import ConfigError, StateError, UnknownNameError, check_name
from artiskill.sensors.camera import Camera, CameraBatch, View, Views, views_of
from artiskill.sensors.drawing.backdrop import Channels, fill_rest
from artiskill.sensors.drawing.buffers import buffers_at, thread_scratch
from artiskill.sensors.drawing.picture_shading import PictureShader
from artiskill.sensors.drawing.rasterise import draw_view
from artiskill.sensors.drawing.render import RenderInputs, pose_matrices, render_views
from artiskill.sensors.drawing.scene_tables import BodyVisual, Poses, build_scene_tables, part_names
from artiskill.sensors.drawing.shading import lights
from artiskill.sensors.observations.raster_buffers import RasterBuffers
from artiskill.sensors.render_config import RenderConfig

__all__ = ("CHANNELS", "BodyVisual", "Images", "Renderer")

CHANNELS = ("rgb", "depth", "position_w", "geom", "body", "part")
_NUMBERS = {"rgb": (np.uint8, 3), "depth": (np.float32, 0), "position_w": (np.float32, 3)}
_NO_PICTURE = np.empty((0, 0, 0, 3), dtype=np.uint8)


@dataclass(frozen=True, eq=False)
class Images:
    """What C cameras saw; only the channels that were asked for are there.

    From `Renderer.render_batch` all have a leading dimension B, the environment.
    """

    _channels: dict[str, np.ndarray] = field(default_factory=dict)

    def __getitem__(self, channel: str) -> np.ndarray:
        """Return a channel by its name.

        Raises:
            UnknownNameError: it was not rendered.
        """
        if channel not in self._channels:
            raise UnknownNameError("image channel", channel, self._channels, "Ask for it when rendering.")
        return self._channels[channel]

    @property
    def channels(self) -> tuple[str, ...]:
        """Return the names of the channels that are there."""
        return tuple(self._channels)

    @property
    def rgb(self) -> np.ndarray:
        """Return (C, H, W, 3) uint8 sRGB."""
        return self["rgb"]

    @property
    def depth(self) -> np.ndarray:
        """Return (C, H, W) float32 metres along the optical axis, 0 where nothing is."""
        return self["depth"]

    @property
    def position_w(self) -> np.ndarray:
        """Return (C, H, W, 3) float32 world positions, 0 where nothing is."""
        return self["position_w"]

    @property
    def geom(self) -> np.ndarray:
        """Return (C, H, W) int32 index of the visual; -1 where nothing is, -2 for the floor."""
        return self["geom"]

    @property
    def body(self) -> np.ndarray:
        """Return (C, H, W) int32 index of the body; -1 where nothing is, -2 for floor and all that never moves."""
        return self["body"]

    @property
    def part(self) -> np.ndarray:
        """Return (C, H, W) int32 index into `Renderer.part_names`; -1 where nothing is, -2 for the floor."""
        return self["part"]


class Renderer:
    """Draws one scene in any state; any number of threads may use one: what they write to is their own."""

    def __init__(self, visuals: Sequence[BodyVisual], config: RenderConfig) -> None:
        """Build what does not depend on the state.

        Args:
            visuals: surfaces; their order gives the geom ids.
            config: how to draw, as from `load_render_config`.

        Raises:
            AssetError: a visual that cannot be drawn.
        """
        self.config, self.part_names = config, part_names(visuals)  # what the numbers of `part` stand for
        self.scene = build_scene_tables(visuals, math.radians(config.crease_angle_deg), config.max_texture_px)
        self.lights = lights(config)
        self._body_count = int(self.scene.geom_body.max(initial=-1)) + 1
        self._pool: ThreadPoolExecutor | None = None
        self._pool_lock = threading.Lock()
        self._pool_size = 0
        self._picture: PictureShader | None = None
        if config.quality == "picture":
            self._picture = PictureShader(self.scene, self.part_names, self.lights, config)

    def render(
        self,
        body_positions_w: Any,
        body_quaternions_w: Any,
        cameras: Sequence[Camera],
        channels: Sequence[str] = ("rgb",),
        out: Images | None = None,
        threads: int = 1,
    ) -> Images:
        """Draw the scene in one state.

        Args:
            body_positions_w: (N, 3) metres; N covers every body that a visual names.
            body_quaternions_w: (N, 4) wxyz, unit.
            cameras: C cameras of one resolution.
            channels: any of `CHANNELS`; what is not asked for is not computed.
            out: an earlier result to write into: saves the time that new memory takes.
            threads: how many to use; the images do not depend on it. Pictures use one.

        Raises:
            UnknownNameError: no such channel.
            ConfigError: no camera, cameras of different resolutions, or fewer threads than one.
            StateError: poses of the wrong shape, for too few bodies, or not finite; an `out` that does not fit.
        """
        _check_channels(channels)
        views = views_of(cameras)
        poses = self._poses_of_one(body_positions_w, body_quaternions_w)
        images = _allocate_images(channels, (len(cameras), *_resolution(views)), out)
        self._draw(poses, views, images, threads)
        return images

    def render_batch(
        self,
        body_positions_w: Any,
        body_quaternions_w: Any,
        cameras: CameraBatch | Sequence[Sequence[Camera]],
        channels: Sequence[str] = ("rgb",),
        out: Images | None = None,
        threads: int = 1,
    ) -> Images:
        """Draw the scene in B states, in parallel over states and cameras.

        Args:
            body_positions_w: (B, N, 3) metres.
            body_quaternions_w: (B, N, 4) wxyz, unit.
            cameras: C cameras for each of B states.
            channels: as in `render`, as the next two.
            out: .
            threads: .

        Returns:
            Images with shapes (B, C, H, W, ...).

        Raises:
            UnknownNameError: as in `render`, as the next two.
            ConfigError: also: a different number of cameras for each state.
            StateError: also: a different number of poses and camera sets.
        """
        _check_channels(channels)
        positions_w, quaternions_w = _pose_arrays(body_positions_w, body_quaternions_w, "(B, N, 3)")
        views, sets, per_set = _batch_views(cameras)
        if sets != len(positions_w):
            raise StateError(f"poses of {len(positions_w)} environments given, and cameras for {sets}")
        images = _allocate_images(channels, (sets, per_set, *_resolution(views)), out)
        self._draw(self._poses(positions_w, quaternions_w), views, images, threads)
        return images

    def rasterise(self, body_positions_w: Any, body_quaternions_w: Any, views: Views) -> RasterBuffers:
        """Prepare what cameras see of the scene in one state, for whoever needs only part of it.

        Args:
            body_positions_w: (N, 3) metres.
            body_quaternions_w: (N, 4) wxyz, unit.
            views: C cameras.

        Raises:
            StateError: as in `render`.
        """
        poses = self._poses_of_one(body_positions_w, body_quaternions_w)
        picture = _NO_PICTURE
        if self._picture is not None:
            picture = np.empty((len(views.positions), *_resolution(views), 3), dtype=np.uint8)
            self._draw_pictures(self._picture, poses, views, picture)
        scratch = thread_scratch(self.scene, len(views.positions), *_resolution(views))
        return RasterBuffers(RenderInputs(self.scene, poses, views, self.lights, picture), scratch)

    def _draw(self, poses: Poses, views: Views, images: Images, threads: int) -> None:
        """Fill the images: geometry and fast colours in one pass, pictures in a second, from several samples."""
        if threads < 1:
            raise ConfigError(f"threads must be at least 1, not {threads}")
        leave_out = ("rgb",) if self._picture is not None else ()
        if set(images.channels) - set(leave_out):
            out = _as_kernel_channels(images, leave_out)
            self._draw_views(poses, views, out, min(threads, len(views.positions)))
        if self._picture is not None and "rgb" in images.channels:
            self._draw_pictures(self._picture, poses, views, images.rgb.reshape(-1, *images.rgb.shape[-3:]))

    def _draw_views(self, poses: Poses, views: Views, out: Channels, threads: int) -> None:
        count = len(views.positions)
        cameras = count // len(poses.positions) if count else 1
        inputs = RenderInputs(self.scene, poses, views, self.lights, _NO_PICTURE)
        # whole environments, as long as that keeps all threads busy
        chunk = count if threads == 1 else cameras if count >= 2 * threads * cameras else 1
        pending: Iterator[int] = iter(range(0, count, chunk))  # each thread takes the next when it is done

        def work() -> None:
            scratch = thread_scratch(self.scene, 1, *_resolution(views))
            for first in pending:
                render_views(first, min(first + chunk, count), cameras, inputs, scratch, out)

        futures = [self._workers(threads).submit(work) for _ in range(threads - 1)]
        work()
        for future in futures:
            future.result()

    def _draw_pictures(self, picture: PictureShader, poses: Poses, views: Views, rgb: np.ndarray) -> None:
        """Write the pictures (K, H, W, 3) of K views, those of one state after those of another."""
        samples = self.config.samples_per_axis
        scratch = thread_scratch(self.scene, 1, *(samples * side for side in _resolution(views)))
        buffers = buffers_at(scratch.views, 0)
        cameras = len(rgb) // len(poses.positions) if len(rgb) else 1
        for k in range(len(rgb)):
            env = k // cameras
            if k % cameras == 0:
                posed = picture.pose(Poses(poses.positions[env], poses.rotations[env]))
            lens = views.lenses[k] * np.array([samples, samples, samples, 1.0, 1.0])
            view = View(views.positions[k], views.rotations[k], lens)
            draw_view(self.scene, posed.pose, view, self.lights.has_floor, buffers, scratch)
            fill_rest(buffers)
            picture.shade(posed, view, samples, buffers.triangle, rgb[k])

    def _poses_of_one(self, body_positions_w: Any, body_quaternions_w: Any) -> Poses:
        """Return checked poses of one state, (N, 3) and (N, 4)."""
        positions_w, quaternions_w = _pose_arrays(body_positions_w, body_quaternions_w, "(N, 3)")
        return self._poses(positions_w[None], quaternions_w[None])

    def _poses(self, positions_w: np.ndarray, quaternions_w: np.ndarray) -> Poses:
        """Return checked poses (B, N, 3) and (B, N, 4) of the world and all bodies."""
        envs, count = positions_w.shape[:2]
        if count < self._body_count:
            raise StateError(
                f"poses of {count} bodies given; the visuals name bodies up to {self._body_count - 1}"
            )
        poses = Poses(np.empty((envs, count + 1, 3)), np.empty((envs, count + 1, 3, 3)))
        bad = pose_matrices(np.ascontiguousarray(positions_w), np.ascontiguousarray(quaternions_w), poses)
        if bad >= 0:
            where = f" in environment {bad // count}" if envs > 1 else ""
            raise StateError(f"the pose of body {bad % count} is not finite{where}")
        return poses

    def _workers(self, threads: int) -> ThreadPoolExecutor:
        with self._pool_lock:
            if self._pool is None or self._pool_size < threads - 1:
                self._pool_size = threads - 1
                self._pool = ThreadPoolExecutor(self._pool_size, thread_name_prefix="artiskill-render")
            return self._pool


def _resolution(views: Views) -> tuple[int, int]:
    """Return height and width."""
    return views.ups.shape[1], views.rights.shape[1]


def _pose_arrays(positions_w: Any, quaternions_w: Any, shape: str) -> tuple[np.ndarray, np.ndarray]:
    """Return poses as arrays; the positions must have as many dimensions as `shape` names."""
    positions = np.asarray(positions_w, dtype=np.float64)
    quaternions = np.asarray(quaternions_w, dtype=np.float64)
    found = positions.shape
    if len(found) != shape.count(",") + 1 or found[-1] != 3 or quaternions.shape != (*found[:-1], 4):
        raise StateError(
            f"poses must have shapes {shape} and {shape.replace('3', '4')}, not {found} and {quaternions.shape}"
        )
    return positions, quaternions


def _batch_views(cameras: CameraBatch | Sequence[Sequence[Camera]]) -> tuple[Views, int, int]:
    """Return cameras as arrays, and their numbers B and C."""
    if isinstance(cameras, CameraBatch):
        sets, per_set = cameras.positions_w.shape[:2]
        if not per_set:
            raise ConfigError("render needs cameras of one resolution, not no camera")
        return cameras.views, sets, per_set
    sizes = {len(one) for one in cameras}
    if len(sizes) != 1:
        raise ConfigError(f"every environment needs the same number of cameras, not {sorted(sizes)}")
    return views_of([camera for one in cameras for camera in one]), len(cameras), sizes.pop()


def _check_channels(channels: Sequence[str]) -> None:
    for channel in channels:
        check_name("image channel", channel, CHANNELS)


def _allocate_images(channels: Sequence[str], shape: tuple[int, ...], out: Images | None) -> Images:
    """Return arrays for the channels, new ones or those of an earlier result.

    Args:
        channels: any of `CHANNELS`.
        shape: (..., C, H, W).
        out: what to write into, or None.

    Raises:
        StateError: an array of `out` has the wrong shape or is not contiguous.
    """
    arrays = {}
    for name in CHANNELS:
        if name not in channels:
            continue
        kind, numbers = _NUMBERS.get(name, (np.int32, 0))
        size = (*shape, numbers) if numbers else shape
        if out is None:
            arrays[name] = np.empty(size, dtype=kind)
            continue
        arrays[name] = array = out[name]
        if array.shape != size or array.dtype != kind or not array.flags.c_contiguous:
            raise StateError(
                f"out[{name!r}] must be a contiguous {np.dtype(kind).name} array of shape {size}, "
                f"not {array.dtype.name} of shape {array.shape}"
            )
    return Images(arrays)


def _as_kernel_channels(images: Images, leave_out: Sequence[str] = ()) -> Channels:
    """Return the same arrays with one leading dimension for all views, empty where there is no such channel."""
    arrays = []
    for name in CHANNELS:
        kind, numbers = _NUMBERS.get(name, (np.int32, 0))
        tail = (numbers,) if numbers else ()
        if name in images.channels and name not in leave_out:
            array = images[name]
            arrays.append(array.reshape(-1, *array.shape[array.ndim - len(tail) - 2 :]))
        else:
            arrays.append(np.empty((0, 0, 0, *tail), dtype=kind))
    return Channels(*arrays)
