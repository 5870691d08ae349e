"""`Renderer`: a scene's surfaces, poses of its bodies and cameras to images."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from artiskill.errors import ConfigError, StateError, UnknownNameError
from artiskill.geometry.rotations import quat_to_matrix
from artiskill.sensors.camera import Camera
from artiskill.sensors.lighting import Surfaces, View, encoded, irradiance, lights, surfaces, tone_mapped
from artiskill.sensors.rasterise import fill_background, project_perspective, rasterise, transform_vertices
from artiskill.sensors.render_config import RenderConfig
from artiskill.sensors.resolve import resolve_depth, resolve_ids, resolve_position
from artiskill.sensors.shade_fast import shade_fast
from artiskill.sensors.shade_picture import PictureShader
from artiskill.sensors.triangle_soup import BodyVisual, build_triangle_soup

CHANNELS = ("rgb", "depth", "position_w", "geom", "body")


@dataclass(frozen=True, eq=False)
class Images:
    """What C cameras saw; only the channels that were asked for are there."""

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
        """(C, H, W) int32 index of the visual; `rasterise.NOTHING` (-1) or `FLOOR` (-2) where there is none."""
        return self["geom"]

    @property
    def body(self) -> np.ndarray:
        """(C, H, W) int32 index of the body; -1 where nothing is, -2 for the floor and all that never moves."""
        return self["body"]


class Renderer:
    """Draws one scene in any state. It keeps its buffers: one renderer per thread."""

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
        self._lights = lights(config)
        self._plain = self._plain_colours()
        self._world = np.empty_like(self.soup.vertices)
        self._projected = np.empty_like(self.soup.vertices)
        self._planes = np.empty((0, 5, 3), dtype=np.float32)
        self._buffers: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}
        # a world-fixed visual's body id must differ from "nothing", which is -1 too
        self._face_body_id = np.where(self.soup.face_body < 0, -2, self.soup.face_body).astype(np.int32)
        self._picture: PictureShader | None = None
        if config.quality == "picture":
            self._picture = PictureShader(self.soup, self._lights, config)
        else:
            self._planes = np.empty((len(self.soup.faces), 5, 3), dtype=np.float32)

    def render(
        self,
        body_positions_w: Any,
        body_quaternions_w: Any,
        cameras: Sequence[Camera],
        channels: Sequence[str] = ("rgb",),
    ) -> Images:
        """Draw the scene.

        Args:
            body_positions_w: (N, 3) metres; N covers every body that a visual names.
            body_quaternions_w: (N, 4) wxyz, unit.
            cameras: C cameras of one resolution.
            channels: any of `CHANNELS`; what is not asked for is not computed.

        Raises:
            UnknownNameError: no such channel.
            ConfigError: no camera, or cameras of different resolutions.
            StateError: poses of the wrong shape, for too few bodies, or not finite.
        """
        for channel in channels:
            if channel not in CHANNELS:
                raise UnknownNameError("image channel", channel, CHANNELS)
        height, width = _common_resolution(cameras)
        positions, rotations = self._poses(body_positions_w, body_quaternions_w)
        soup = self.soup
        transform_vertices(soup.vertices, soup.vertex_pose, rotations, positions, self._world)
        images = {name: _blank(name, (len(cameras), height, width)) for name in CHANNELS if name in channels}
        surface = surfaces(soup, self._world, rotations)
        if self._picture is not None and "rgb" in images:
            self._picture.draw_shadow_maps(self._world)
        for i, camera in enumerate(cameras):
            self._render_camera(camera, surface, {name: image[i] for name, image in images.items()})
        return Images(images)

    def _render_camera(self, camera: Camera, surface: Surfaces, images: dict[str, np.ndarray]) -> None:
        """Fill one camera's images: geometry from one sample per pixel, pictures from several."""
        rgb = images.pop("rgb", None)
        if images or self._picture is None:
            view, inverse_depth, triangle = self._draw(camera, 1)
            for name, image in images.items():
                self._resolve(name, view, inverse_depth, triangle, image)
            if rgb is not None and self._picture is None:
                shade_fast(surface, view, self._lights, self._plain, inverse_depth, triangle, self._planes, rgb)
        if rgb is not None and self._picture is not None:
            samples = self.config.samples_per_axis
            view, _, triangle = self._draw(camera, samples)
            self._picture.shade(surface, view, samples, triangle, rgb)

    def _poses(self, positions_w: Any, quaternions_w: Any) -> tuple[np.ndarray, np.ndarray]:
        """Checked poses of the world and all bodies: (N + 1, 3) and (N + 1, 3, 3)."""
        positions_w = np.asarray(positions_w, dtype=np.float64)
        quaternions_w = np.asarray(quaternions_w, dtype=np.float64)
        count = len(positions_w) if positions_w.ndim else 0
        if positions_w.shape != (count, 3) or quaternions_w.shape != (count, 4):
            raise StateError(
                f"poses must have shapes (N, 3) and (N, 4), not {positions_w.shape} and {quaternions_w.shape}"
            )
        if count < self.soup.body_count:
            raise StateError(
                f"poses of {count} bodies given; the visuals name bodies up to {self.soup.body_count - 1}"
            )
        finite = np.isfinite(positions_w).all(axis=1) & np.isfinite(quaternions_w).all(axis=1)
        if not finite.all():
            raise StateError(f"the pose of body {int(np.argmin(finite))} is not finite")
        positions, rotations = np.zeros((count + 1, 3)), np.empty((count + 1, 3, 3))
        positions[1:] = positions_w
        rotations[0] = np.eye(3)
        rotations[1:] = quat_to_matrix(quaternions_w)
        return positions, rotations

    def _draw(self, camera: Camera, samples_per_axis: int) -> tuple[View, np.ndarray, np.ndarray]:
        """Rasterise; the buffers are valid until the next call."""
        shape = camera.height * samples_per_axis, camera.width * samples_per_axis
        if shape not in self._buffers:
            self._buffers[shape] = np.empty(shape, dtype=np.float32), np.empty(shape, dtype=np.int32)
        inverse_depth, triangle = self._buffers[shape]
        view = View(camera.position_w, camera.rotation_w, camera.lens(samples_per_axis))
        fill_background(*view, self.config.floor.enabled, inverse_depth, triangle)
        project_perspective(self._world, *view, self._projected)
        faces, two_sided = self.soup.faces, self.soup.face_two_sided
        rasterise(self._world, self._projected, faces, two_sided, True, *view, inverse_depth, triangle)
        return view, inverse_depth, triangle

    def _resolve(
        self, name: str, view: View, inverse_depth: np.ndarray, triangle: np.ndarray, out: np.ndarray
    ) -> None:
        if name == "depth":
            resolve_depth(inverse_depth, triangle, out)
        elif name == "position_w":
            resolve_position(inverse_depth, triangle, *view, out)
        else:
            resolve_ids(triangle, self.soup.face_geom if name == "geom" else self._face_body_id, out)

    def _plain_colours(self) -> np.ndarray:
        """(2, 3) uint8 display colours of background and floor where they are not shaded per pixel."""
        light = self._lights
        received = irradiance((0.0, 0.0, 1.0), 1.0, 1.0, light)
        floor = [tone_mapped(r * c) for r, c in zip(received, light.floor.tolist(), strict=True)]
        table = [[encoded(c, light.encode) for c in row] for row in (light.horizon.tolist(), floor)]
        return np.array(table).round().astype(np.uint8)


def _common_resolution(cameras: Sequence[Camera]) -> tuple[int, int]:
    resolutions = {(camera.height, camera.width) for camera in cameras}
    if len(resolutions) != 1:
        sizes = ", ".join(f"{w} x {h}" for h, w in sorted(resolutions)) or "no camera"
        raise ConfigError(f"render needs cameras of one resolution, not {sizes}")
    return resolutions.pop()


def _blank(channel: str, shape: tuple[int, int, int]) -> np.ndarray:
    if channel == "rgb":
        return np.empty((*shape, 3), dtype=np.uint8)
    if channel == "position_w":
        return np.empty((*shape, 3), dtype=np.float32)
    return np.empty(shape, dtype=np.float32 if channel == "depth" else np.int32)
