"""Pictures of a task's scene for people: from the world, through the robot's cameras, as a point cloud."""

from dataclasses import dataclass, field

import numpy as np

from artiskill.envs.core import ObservationContext, empty_observation
from artiskill.envs.rendering import HEIGHT, WIDTH, Viewpoint, WorldView
from artiskill.envs.vision import PointCloudObserver
from artiskill.errors import ConfigError, UnknownNameError
from artiskill.scene.scene import Scene
from artiskill.sensors.camera import Camera
from artiskill.sensors.observations.point_cloud import FIRST_ID, mask_codes
from artiskill.sensors.pictures.compose import below, beside, draw_points, of_width, paint_depth, paint_masks
from artiskill.sensors.pictures.framing import WorldCameraConfig
from artiskill.sensors.render_config import RenderConfig
from artiskill.tasks.task import Task

VIEWS = ("world", "sensor", "cloud", "all")
MOST_PX = 4096
_POINT_RADIUS_M = 0.007
_DEPTH_BLACK_M = 7.0  # a little farther than the floor that the usual cameras see
_SHEET_PICTURE = 600, 450  # of each of the two upper pictures of a sheet


# any will do to see whether a viewpoint is legal
_ANY_CAMERA = WorldCameraConfig((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 45.0)


@dataclass(frozen=True)
class PictureStyle:
    """What a picture shows, and how.

    Attributes:
        view: `world`, `sensor` (the robot's cameras side by side), `cloud` (what they see, as points) or `all`.
        masks: whether the task's masks are painted over the colours.
        width: pixels; None for the usual. The robot's cameras have theirs from the task.
        height: pixels, likewise.
        viewpoint: of the views `world` and `cloud`.
        look: how the view `world` is drawn; None for the usual.

    Raises:
        UnknownNameError: no such view.
        ConfigError: a size or viewpoint out of range, or one for the view `sensor`, which has its own.
    """

    view: str = "world"
    masks: bool = False
    width: int | None = None
    height: int | None = None
    viewpoint: Viewpoint = field(default_factory=Viewpoint)
    look: RenderConfig | None = None

    def __post_init__(self) -> None:
        if self.view not in VIEWS:
            raise UnknownNameError("view", self.view, VIEWS)
        check_size(self.width, self.height)
        if self.view == "sensor" and (self.width or self.height):
            raise ConfigError(
                "the task sets the size of the robot's cameras: use --set cameras.width=200 cameras.height=80 "
                "instead of --width and --height"
            )
        if self.view == "sensor" and self.viewpoint != Viewpoint():
            raise ConfigError("the view 'sensor' shows the robot's own cameras, so it takes no viewpoint")
        self.viewpoint.camera(_ANY_CAMERA)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of a picture that is not from the robot's cameras."""
        usual = _SHEET_PICTURE if self.view == "all" else (WIDTH, HEIGHT)
        return self.width or usual[0], self.height or usual[1]


class SceneRenderer:
    """Draws one scene and target, in any state."""

    def __init__(self, task: Task, scene: Scene, target: str, style: PictureStyle) -> None:
        """Build what does not depend on the state."""
        self._style = style
        self._world = WorldView(scene, None, style.look)
        self._codes = mask_codes(task.masks(scene, target))
        self._mask_count = len(task.mask_names)
        self._image_shape = task.cameras.number, task.cameras.height, task.cameras.width
        self._observer = PointCloudObserver(task)
        self._observer.enter(scene, target)

    def draw(self, instant: ObservationContext, camera: Camera | None = None) -> np.ndarray:
        """Draw the picture, (H, W, 3) uint8; all views but `sensor` need a camera."""
        view, masks = self._style.view, self._style.masks
        if view == "sensor":
            return self._draw_strip(self._see(instant)[0], masks)
        assert camera is not None, "views from outside need a camera"
        if view == "world":
            return self._draw_world(instant, camera, masks)
        cloud, world_to_camera = self._see(instant)
        if view == "cloud":
            return self._draw_cloud(cloud, camera, masks)
        upper = beside([self._draw_world(instant, camera, masks), self._draw_cloud(cloud, camera, True)])
        depth = self._draw_depth(cloud, world_to_camera)
        strips = [self._draw_strip(cloud, False), self._draw_strip(cloud, True), depth]
        return below([upper, *(of_width(strip, upper.shape[1]) for strip in strips)])

    def _see(self, instant: ObservationContext) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Return what the robot's cameras see, as a full cloud, and (C, 4, 4) world to camera."""
        observation = empty_observation(self._observer.space)
        info = self._observer.observe(instant, observation)
        return observation["pointcloud"], info["cameras"]["world_to_camera"]

    def _draw_world(self, instant: ObservationContext, camera: Camera, masks: bool) -> np.ndarray:
        images = self._world.images(instant.snapshot, ("rgb", "geom") if masks else ("rgb",), camera=camera)
        if not masks:
            return images.rgb[0]
        codes = self._codes[images.geom[0] - FIRST_ID]
        seg = (codes[..., None] >> np.arange(self._mask_count, dtype=np.uint8)) & 1
        return paint_masks(images.rgb[0], seg.astype(bool), opacity=0.5)

    def _draw_cloud(self, cloud: dict[str, np.ndarray], camera: Camera, masks: bool) -> np.ndarray:
        seen = cloud["xyz"].any(axis=1)
        colours = cloud["rgb"][seen]
        if masks:
            colours = paint_masks(colours, cloud["seg"][seen])
        return draw_points(cloud["xyz"][seen], colours, camera, _POINT_RADIUS_M)

    def _draw_strip(self, cloud: dict[str, np.ndarray], masks: bool) -> np.ndarray:
        """Draw the cameras' pictures from left to right: a full cloud has a point per pixel."""
        rgb = cloud["rgb"].reshape(*self._image_shape, 3)
        if masks:
            rgb = paint_masks(rgb, cloud["seg"].reshape(*self._image_shape, -1))
        return beside(list(rgb))

    def _draw_depth(self, cloud: dict[str, np.ndarray], world_to_camera: np.ndarray) -> np.ndarray:
        """Draw the cameras' depth, along each optical axis, from left to right."""
        xyz = cloud["xyz"].reshape(self._image_shape[0], -1, 3)
        axis, shift = world_to_camera[:, 2, :3], world_to_camera[:, 2, 3]
        depth = np.where(xyz.any(axis=2), (xyz * axis[:, None]).sum(axis=2) + shift[:, None], 0.0)
        return beside(list(paint_depth(depth.reshape(self._image_shape), _DEPTH_BLACK_M)))


def check_size(width: int | None, height: int | None) -> None:
    """Check the sides of a picture in pixels, None for the default.

    Raises:
        ConfigError: one is not in range.
    """
    for name, pixels in (("width", width), ("height", height)):
        if pixels is not None and not 1 <= pixels <= MOST_PX:
            raise ConfigError(f"the picture's {name} must lie in [1, {MOST_PX}] pixels, not {pixels}")
