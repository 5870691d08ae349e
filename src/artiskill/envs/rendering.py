"""Pictures for people: the scene from a world camera, and the window of `render_mode="human"`."""

import math
import os
import warnings
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, ClassVar
from weakref import WeakSet

import numpy as np

from artiskill.envs.core import Episodes
from artiskill.envs.options import HUMAN, RENDER_MODES
from artiskill.errors import ConfigError, MissingExtraError
from artiskill.scene.scene import Scene
from artiskill.sensors.camera import Camera
from artiskill.sensors.pictures.framing import FAR_M, WorldCameraConfig, orbit_camera
from artiskill.sensors.render_config import RenderConfig, load_render_config
from artiskill.sensors.renderer import BodyVisual, Images, Renderer
from artiskill.sim.snapshot import Snapshot

WIDTH, HEIGHT = 640, 480
EXTRA = "viewer"
_DISPLAYS, _DRIVERS = ("DISPLAY", "WAYLAND_DISPLAY"), ("SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER")
_NOT_SEEN = ("dummy", "offscreen")  # what SDL falls back to, silently, where there is no display


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
        """Return the camera; `home` is the usual one.

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
        """Return the picture of one environment of a snapshot, (H, W, 3) uint8."""
        return self.images(snapshot, ("rgb",), row).rgb[0]

    def images(
        self, snapshot: Snapshot, channels: tuple[str, ...], row: int = 0, camera: Camera | None = None
    ) -> Images:
        """Return channels of one environment's picture, see `sensors.images.CHANNELS`; (1, H, W, ...) each.

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


class WorldViews:
    """The pictures of environments; a renderer is kept until its environment has another scene."""

    def __init__(self) -> None:
        self._views: dict[int, tuple[Scene, WorldView]] = {}

    def draw(self, episodes: Episodes, env: int) -> np.ndarray:
        """Return the picture of one environment, (480, 640, 3) uint8."""
        group = episodes.group
        scene = group.scene_of(env)
        if env not in self._views or self._views[env][0] is not scene:
            self._views[env] = scene, WorldView(scene, Viewpoint().camera(episodes.task.world_camera))
        return self._views[env][1].draw(group.batch_of(env).snapshot, int(group.slot[env]))


class Window:
    """Shows pictures; it opens with the first one, and stays closed once a person has closed it.

    A process has one such window: that of the environment that drew last.

    Args:
        title: of the window.
        fps: no more pictures than this are shown per second; who shows more has to wait.

    Raises:
        MissingExtraError: pygame is not installed.
        ConfigError: there is no display.
    """

    _in_use: ClassVar[WeakSet["Window"]] = WeakSet()

    def __init__(self, title: str, fps: float) -> None:
        self._pygame = _import_pygame()
        self._title, self._fps = title, fps
        self._clock: Any = None
        self._was_closed = False
        _open_display(self._pygame)

    def show(self, picture: np.ndarray) -> None:
        """Show a picture, (H, W, 3) uint8."""
        pygame = self._pygame
        if self._was_closed:
            return
        _open_display(pygame)
        size = picture.shape[1::-1]
        screen = pygame.display.get_surface()
        if screen is None or screen.get_size() != size:
            screen = pygame.display.set_mode(size)
        pygame.display.set_caption(self._title)
        self._in_use.add(self)
        pygame.surfarray.blit_array(screen, picture.swapaxes(0, 1))
        pygame.display.flip()
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
            self._was_closed = True
            return
        self._clock = self._clock or pygame.time.Clock()
        self._clock.tick(self._fps)

    def close(self) -> None:
        """Close the window, unless another environment shows something in it."""
        shown = self in self._in_use
        self._in_use.discard(self)
        if shown and not self._in_use:
            self._pygame.display.quit()


def render_modes_here(render_mode: str | None) -> list[str]:
    """Return the modes that environments can have on this machine: `human` only with a display.

    Gymnasium's `check_env` makes an environment of every mode that the metadata list.

    Args:
        render_mode: of this environment, which has been made with it.
    """
    display = any(os.environ.get(name) for name in (*_DISPLAYS, *_DRIVERS))
    shown = render_mode == HUMAN or (display and find_spec("pygame") is not None)
    return [mode for mode in RENDER_MODES if mode != HUMAN or shown]


def _import_pygame() -> Any:
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # or importing it prints a greeting
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of things that are its own
            import pygame
    except ImportError as error:
        raise MissingExtraError("render_mode='human'", EXTRA) from error
    return pygame


def _open_display(pygame: Any) -> None:
    """Connect to the display; nothing happens if that has been done.

    Raises:
        ConfigError: there is none.
    """
    found = "none"
    try:
        pygame.display.init()
        found = pygame.display.get_driver()
    except pygame.error as error:
        found = str(error)
    wanted = any(os.environ.get(name) for name in _DRIVERS)
    if not pygame.display.get_init() or (found in _NOT_SEEN and not wanted):
        pygame.display.quit()
        raise ConfigError(
            f"render_mode='human' shows a window, but there is no display ({found}): set DISPLAY or "
            "WAYLAND_DISPLAY, or take render_mode='rgb_array'; `artiskill render` makes films"
        )
