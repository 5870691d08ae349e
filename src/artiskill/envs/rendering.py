"""Pictures for people: the scene from a world camera."""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.scene.scene import Scene
from artiskill.sensors.camera import Camera
from artiskill.sensors.pictures.framing import FAR_M, WorldCameraConfig, orbit_camera
from artiskill.sensors.render_config import RenderConfig, load_render_config
from artiskill.sensors.renderer import BodyVisual, Images, Renderer
from artiskill.sim.snapshot import Snapshot

WIDTH, HEIGHT = 640, 480


@dataclass(frozen=True)
class Viewpoint:
    """Where the world camera stands; what is None stays as the usual camera has it.

    Attributes:
        azimuth_deg: direction in which it stands, seen from its target, counter-clockwise from +x.
        elevation_deg: its height above the horizon, [-90, 90].
        distance_m: to the target.
        target_w: (x, y, z), the middle of the picture, metres.
    """

    azimuth_deg: float | None = None
    elevation_deg: float | None = None
    distance_m: float | None = None
    target_w: tuple[float, float, float] | None = None

    def camera(self, home: WorldCameraConfig, width: int = WIDTH, height: int = HEIGHT) -> Camera:
        """The camera; `home` is the usual one.

        Raises:
            ConfigError: a value out of range or not finite.
        """
        x, y, z = (eye - target for eye, target in zip(home.eye_w_m, home.target_w_m, strict=True))
        if self == Viewpoint():
            fov_rad, far_m = math.radians(home.fov_deg), max(FAR_M, 2 * math.hypot(x, y, z))
            return Camera.look_at(
                home.eye_w_m, home.target_w_m, width=width, height=height, fov_rad=fov_rad, far_m=far_m
            )
        return orbit_camera(
            target_w=home.target_w_m if self.target_w is None else self.target_w,
            distance_m=math.hypot(x, y, z) if self.distance_m is None else self.distance_m,
            azimuth_deg=math.degrees(math.atan2(y, x)) if self.azimuth_deg is None else self.azimuth_deg,
            elevation_deg=(
                math.degrees(math.atan2(z, math.hypot(x, y))) if self.elevation_deg is None else self.elevation_deg
            ),
            width=width,
            height=height,
            fov_deg=home.fov_deg,
        )


class WorldView:
    """Draws one scene from outside; built once per object."""

    def __init__(self, scene: Scene, camera: Camera | None, config: RenderConfig | None = None) -> None:
        """Build the renderer.

        Args:
            scene: what is drawn.
            camera: from where; None where each picture says it.
            config: how; by default as pictures for people.
        """
        visuals = [BodyVisual(body, visual) for body, visual in scene.visuals]
        self._renderer = Renderer(visuals, config or load_render_config())
        self._camera = camera

    def draw(self, snapshot: Snapshot, row: int = 0) -> np.ndarray:
        """One environment of a snapshot, (H, W, 3) uint8."""
        return self.images(snapshot, ("rgb",), row).rgb[0]

    def images(
        self, snapshot: Snapshot, channels: tuple[str, ...], row: int = 0, camera: Camera | None = None
    ) -> Images:
        """Channels of one environment's picture, see `sensors.images.CHANNELS`; (1, H, W, ...) each.

        Args:
            snapshot: the moment.
            channels: which.
            row: the environment.
            camera: from where; None for the camera that the view was built with.
        """
        camera = camera or self._camera
        assert camera is not None, "a picture needs a camera"
        return self._renderer.render(
            snapshot.body_position_w[row], snapshot.body_quaternion_w[row], (camera,), channels
        )
