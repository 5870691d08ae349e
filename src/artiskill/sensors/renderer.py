"""`Renderer`: a scene's surfaces, poses of its bodies and cameras to images."""

import math
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from artiskill.errors import ConfigError, StateError, UnknownNameError, check_name
from artiskill.sensors.camera import Camera, CameraBatch, View, Views, common_resolution, views_of
from artiskill.sensors.drawing.backdrop import Channels, fill_rest
from artiskill.sensors.drawing.buffers import drawing_of, thread_scratch
from artiskill.sensors.drawing.picture_shading import PictureShader
from artiskill.sensors.drawing.render import Poses, draw_view, pose_matrices, render_views
from artiskill.sensors.drawing.scene_tables import BodyVisual, build_scene_tables, build_triangle_soup
from artiskill.sensors.drawing.shading import lights, plain_colours, surfaces
from artiskill.sensors.drawing.shadows import transform_vertices
from artiskill.sensors.observations.raster_buffers import Sight
from artiskill.sensors.render_config import RenderConfig

CHANNELS = ("rgb", "depth", "position_w", "geom", "body", "part")
_NUMBERS = {"rgb": (np.uint8, 3), "depth": (np.float32, 0), "position_w": (np.float32, 3)}


@dataclass(frozen=True, eq=False)
class Images:
    """What C cameras saw; only the channels that were asked for are there.

    From `Renderer.render_batch` all have a leading dimension B, the environment.
    """

    _channels: dict[str, np.ndarray] = field(default_factory=dict)

    def __getitem__(self, channel: str) -> np.ndarray:
        """A channel by its name.

        Raises:
            UnknownNameError: it was not rendered.
        """
        if channel not in self._channels:
            raise UnknownNameError("image channel", channel, self._channels, "Ask for it when rendering.")
        return self._channels[channel]

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels that are there."""
        return tuple(self._channels)

    @property
    def rgb(self) -> np.ndarray:
        """(C, H, W, 3) uint8 sRGB."""
        return self["rgb"]

    @property
    def depth(self) -> np.ndarray:
        """(C, H, W) float32 metres along the optical axis, 0 where nothing is."""
        return self["depth"]

    @property
    def position_w(self) -> np.ndarray:
        """(C, H, W, 3) float32 world positions, 0 where nothing is."""
        return self["position_w"]

    @property
    def geom(self) -> np.ndarray:
        """(C, H, W) int32 index of the visual; `backdrop.NOTHING` (-1) or `FLOOR` (-2) where there is none."""
        return self["geom"]

    @property
    def body(self) -> np.ndarray:
        """(C, H, W) int32 index of the body; -1 where nothing is, -2 for the floor and all that never moves."""
        return self["body"]

    @property
    def part(self) -> np.ndarray:
        """(C, H, W) int32 index into `Renderer.part_names`; -1 where nothing is, -2 for the floor."""
        return self["part"]


def check_channels(channels: Sequence[str]) -> None:
    """Raise `UnknownNameError` for the first that is none of `CHANNELS`."""
    for channel in channels:
        check_name("image channel", channel, CHANNELS)


def allocate_images(channels: Sequence[str], shape: tuple[int, ...], out: Images | None) -> Images:
    """Arrays for the channels, new ones or those of an earlier result.

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


def as_kernel_channels(images: Images, leave_out: Sequence[str] = ()) -> Channels:
    """The same arrays with one leading dimension for all views, empty where there is no such channel."""
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


__all__ = ("CHANNELS", "BodyVisual", "Images", "Renderer")


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
        self.config = config
        self.soup = build_triangle_soup(visuals, math.radians(config.crease_angle_deg), config.max_texture_px)
        self._tables = build_scene_tables(self.soup)
        self._lights = lights(config)
        self._plain_colours = plain_colours(self._lights)
        self._pool: ThreadPoolExecutor | None = None
        self._pool_lock = threading.Lock()
        self._pool_size = 0
        self._picture: PictureShader | None = None
        if config.quality == "picture":
            self._picture = PictureShader(self.soup, self._lights, config)

    @property
    def part_names(self) -> tuple[str, ...]:
        """What the numbers of the channel `part` stand for."""
        return self.soup.part_names

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
        check_channels(channels)
        resolution = common_resolution(cameras)
        poses = self._poses_of_one(body_positions_w, body_quaternions_w)
        images = allocate_images(channels, (len(cameras), *resolution), out)
        self._draw(poses, views_of(cameras), len(cameras), images, resolution, threads)
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
            channels: as in `render`.
            out: as in `render`.
            threads: as in `render`.

        Returns:
            Images with shapes (B, C, H, W, ...).

        Raises:
            UnknownNameError: as in `render`, as the next two.
            ConfigError: also: a different number of cameras for each state.
            StateError: also: a different number of poses and camera sets.
        """
        check_channels(channels)
        positions_w = np.asarray(body_positions_w, dtype=np.float64)
        quaternions_w = np.asarray(body_quaternions_w, dtype=np.float64)
        shape = positions_w.shape
        if len(shape) != 3 or shape[2] != 3 or quaternions_w.shape != (*shape[:2], 4):
            raise StateError(
                f"poses must have shapes (B, N, 3) and (B, N, 4), not {shape} and {quaternions_w.shape}"
            )
        views, (sets, per_set), resolution = _batch_views(cameras)
        if sets != shape[0]:
            raise StateError(f"poses of {shape[0]} environments given, and cameras for {sets}")
        images = allocate_images(channels, (sets, per_set, *resolution), out)
        self._draw(self._poses(positions_w, quaternions_w), views, per_set, images, resolution, threads)
        return images

    def sight(
        self, body_positions_w: Any, body_quaternions_w: Any, views: Views, resolution: tuple[int, int]
    ) -> Sight:
        """What cameras see of the scene in one state, at `fast` quality, for whoever needs only part of it.

        Args:
            body_positions_w: (N, 3) metres.
            body_quaternions_w: (N, 4) wxyz, unit.
            views: C cameras.
            resolution: height and width of their images.

        Raises:
            StateError: as in `render`.
        """
        scratch = thread_scratch(self._tables, len(views.positions), *resolution)
        poses = self._poses_of_one(body_positions_w, body_quaternions_w)
        looks = self._lights, self._plain_colours, self.config.floor.enabled
        return Sight(self._tables, poses, views, *looks, scratch)

    def _draw(
        self, poses: Poses, views: Views, cameras: int, images: Images, resolution: tuple[int, int], threads: int
    ) -> None:
        """Fill the images: geometry and fast colours in one pass, pictures in a second, from several samples."""
        if threads < 1:
            raise ConfigError(f"threads must be at least 1, not {threads}")
        leave_out = ("rgb",) if self._picture is not None else ()
        if set(images.channels) - set(leave_out):
            out = as_kernel_channels(images, leave_out)
            self._draw_views(poses, views, cameras, out, resolution, min(threads, len(views.positions)))
        if self._picture is not None and "rgb" in images.channels:
            rgb = images.rgb.reshape(-1, *images.rgb.shape[-3:])
            self._draw_pictures(self._picture, poses, views, cameras, rgb)

    def _draw_views(
        self, poses: Poses, views: Views, cameras: int, out: Channels, resolution: tuple[int, int], threads: int
    ) -> None:
        count = len(views.positions)
        has_floor, plain = self.config.floor.enabled, self._plain_colours
        # whole environments, as long as that keeps all threads busy
        chunk = count if threads == 1 else cameras if count >= 2 * threads * cameras else 1
        pending: Iterator[int] = iter(range(0, count, chunk))  # each thread takes the next when it is done

        def work() -> None:
            scratch = thread_scratch(self._tables, 1, *resolution)
            for first in pending:
                last = min(first + chunk, count)
                render_views(
                    first, last, cameras, self._tables, poses, views, self._lights, plain, has_floor, scratch, out
                )

        futures = [self._workers(threads).submit(work) for _ in range(threads - 1)]
        work()
        for future in futures:
            future.result()

    def _draw_pictures(
        self, picture: PictureShader, poses: Poses, views: Views, cameras: int, rgb: np.ndarray
    ) -> None:
        samples = self.config.samples_per_axis
        height, width = rgb.shape[1] * samples, rgb.shape[2] * samples
        scratch = thread_scratch(self._tables, 1, height, width)
        drawing = drawing_of(scratch.drawings, 0)
        world = np.empty_like(self.soup.vertices)
        for k in range(len(rgb)):
            env = k // cameras
            positions, rotations = poses.positions[env], poses.rotations[env]
            if k % cameras == 0:
                transform_vertices(self.soup.vertices, self.soup.vertex_pose, rotations, positions, world)
                maps = picture.draw_shadow_maps(world)
            lens = views.lenses[k] * np.array([samples, samples, samples, 1.0, 1.0])
            view = View(views.positions[k], views.rotations[k], lens)
            pose = positions, rotations
            backdrop = draw_view(self._tables, *pose, view, self.config.floor.enabled, drawing, scratch)
            fill_rest(backdrop, drawing.inverse_depth, drawing.triangle, drawing.drawn)
            picture.shade(surfaces(self.soup, world, rotations), view, maps, samples, drawing.triangle, rgb[k])

    def _poses_of_one(self, body_positions_w: Any, body_quaternions_w: Any) -> Poses:
        """Checked poses of one state, (N, 3) and (N, 4)."""
        positions_w = np.asarray(body_positions_w, dtype=np.float64)
        quaternions_w = np.asarray(body_quaternions_w, dtype=np.float64)
        count = len(positions_w) if positions_w.ndim else 0
        if positions_w.shape != (count, 3) or quaternions_w.shape != (count, 4):
            raise StateError(
                f"poses must have shapes (N, 3) and (N, 4), not {positions_w.shape} and {quaternions_w.shape}"
            )
        return self._poses(positions_w[None], quaternions_w[None])

    def _poses(self, positions_w: np.ndarray, quaternions_w: np.ndarray) -> Poses:
        """Checked poses (B, N, 3) and (B, N, 4) of the world and all bodies."""
        envs, count = positions_w.shape[:2]
        if count < self.soup.body_count:
            raise StateError(
                f"poses of {count} bodies given; the visuals name bodies up to {self.soup.body_count - 1}"
            )
        poses = Poses(np.empty((envs, count + 1, 3)), np.empty((envs, count + 1, 3, 3)))
        bad = pose_matrices(np.ascontiguousarray(positions_w), np.ascontiguousarray(quaternions_w), *poses)
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


def _batch_views(
    cameras: CameraBatch | Sequence[Sequence[Camera]],
) -> tuple[Views, tuple[int, int], tuple[int, int]]:
    """Cameras as arrays, their numbers (B, C) and their resolution (H, W)."""
    if isinstance(cameras, CameraBatch):
        sets, per_set = cameras.positions_w.shape[:2]
        if not per_set:
            raise ConfigError("render needs cameras of one resolution, not no camera")
        return cameras.views, (sets, per_set), (cameras.height, cameras.width)
    sizes = {len(one) for one in cameras}
    if len(sizes) != 1:
        raise ConfigError(f"every environment needs the same number of cameras, not {sorted(sizes)}")
    flat = [camera for one in cameras for camera in one]
    resolution = common_resolution(flat)
    return views_of(flat), (len(cameras), sizes.pop()), resolution
