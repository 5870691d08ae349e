"""Pictures for people: the scene from a world camera."""

import math

import numpy as np

from artiskill.scene.scene import Scene
from artiskill.sensors.camera import Camera
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import Renderer
from artiskill.sensors.triangle_soup import BodyVisual
from artiskill.sim.snapshot import Snapshot

_WIDTH, _HEIGHT = 640, 480
_EYE_W_M = (-1.85, -1.80, 1.20)  # beside the arm, so that robot, hand and handle are all seen
_TARGET_W_M = (-0.80, 0.24, 0.42)
_FOV_RAD = math.radians(45)
_FAR_M = 60.0  # the floor runs to the horizon


class WorldView:
    """Draws one scene from a fixed camera; built once per object."""

    def __init__(self, scene: Scene) -> None:
        visuals = [BodyVisual(body, visual) for body, visual in scene.visuals]
        self._renderer = Renderer(visuals, load_render_config())
        self._camera: Camera = Camera.look_at(
            _EYE_W_M, _TARGET_W_M, width=_WIDTH, height=_HEIGHT, fov_rad=_FOV_RAD, far_m=_FAR_M
        )

    def draw(self, snapshot: Snapshot) -> np.ndarray:
        """The first environment of a snapshot, (480, 640, 3) uint8."""
        images = self._renderer.render(
            snapshot.body_position_w[0], snapshot.body_quaternion_w[0], (self._camera,), ("rgb",)
        )
        return images.rgb[0]
