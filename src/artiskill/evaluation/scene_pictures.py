"""Pictures of a task's scene for people: from the world, through the robot's cameras, as a point cloud."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from artiskill.envs.core import ObservationContext, empty_observation
from artiskill.envs.rendering import HEIGHT, WIDTH, Viewpoint, WorldView
from artiskill.envs.vision import PointCloudObserver, sampled_points
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ConfigError, UnknownNameError
from artiskill.scene.scene import Scene
from artiskill.sensors.camera import Camera
from artiskill.sensors.observations.point_cloud import FIRST_ID, mask_codes
from artiskill.sensors.pictures.compose import (
    MASK_COLOURS,
    below,
    beside,
    draw_points,
    of_width,
    paint_depth,
    paint_masks,
)
from artiskill.sensors.pictures.framing import WorldCameraConfig, following_cameras
from artiskill.sensors.render_config import RenderConfig
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.task import Task

VIEWS = ("world", "sensor", "cloud", "all", "points")
MOST_PX = 4096
_POINT_RADIUS_M = 0.007
_DEPTH_BLACK_M = 7.0  # a little farther than the floor that the usual cameras see
_SHEET_PICTURE = 600, 450  # of each of the two upper pictures of a sheet
_PANEL = 480, 360  # of each of the two pictures of the view `points`
_WHOLE_CLOUD = Sampling(4000, "uniform")  # of the view `points`, where a policy is given every pixel's point
_DARK, _LIFT = 28, 60  # grey levels of that view: of its background, and of a black point before it
_INK = 225, 225, 225
_SQUARE_M, _MASK_OPACITY = 0.006, 0.85
_NEAR_M = 0.15  # hands so near to what is seen must be in the picture
# a hand as points, from what its own joints say: palm, fingers and wrist, in the frame of its tool
_HAND = np.array(
    [(0.0, y, -0.06) for y in np.linspace(-0.05, 0.05, 11)]
    + [(0.0, y, z) for y in (-0.05, 0.05) for z in np.linspace(-0.06, 0.0, 7)]
    + [(0.0, 0.0, z) for z in np.linspace(-0.14, -0.06, 7)]
)
_HAND_COLOUR = 235, 235, 235
_LETTERS_SHARE = 0.036  # height of a legend's letters, of the picture's


# any will do to see whether a viewpoint is legal
_ANY_CAMERA = WorldCameraConfig((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 45.0)


@dataclass(frozen=True)
class PictureStyle:
    """What a picture shows, and how.

    Attributes:
        view: `world`, `sensor` (the robot's cameras side by side), `cloud` (what they see, as points), `all`, or
            `points` (the world and, beside it, the points that a policy is given).
        masks: whether the task's masks are painted over the colours.
        width: pixels; None for the usual. The robot's cameras have theirs from the task.
        height: pixels, likewise.
        viewpoint: of the views from outside.
        look: how the view `world` is drawn; None for the usual.
        sampling: which points a policy is given, in the view `points`; None for all, of which some are drawn.

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
    sampling: Sampling | None = None

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
        """Width and height of a picture that is not from the robot's cameras; of each of a pair."""
        usual = {"all": _SHEET_PICTURE, "points": _PANEL}.get(self.view, (WIDTH, HEIGHT))
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
        if view in ("world", "points"):
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


class PointsPanel:
    """Draws the points that a policy is given in an episode, coloured by mask, all from one place near them.

    The hands are drawn from the robot's own joints, which policies are told as numbers.

    Args:
        task: what is asked.
        scene: of the episode.
        target: the target link.
        sampling: which points; None for the full cloud.
        moments: of the episode; the same moment of the same level has the same points.
        beside: a camera of the world, whose direction and size are kept.
        free_below: share of the picture's height that is left free at its lower edge.
    """

    def __init__(
        self,
        task: Task,
        scene: Scene,
        target: str,
        sampling: Sampling | None,
        moments: Sequence[ObservationContext],
        beside: Camera,
        free_below: float = 0.0,
    ) -> None:
        self._moments, self._clouds = moments, list(given_points(task, scene, target, sampling, moments))
        shown = np.any([cloud["seg"].any(axis=0) for cloud in self._clouds], axis=0).tolist()
        colours = [tuple(colour) for colour in MASK_COLOURS[: len(shown)].tolist()]
        named = zip(task.mask_names, colours, shown, strict=False)
        self._legend = {name: colour for name, colour, is_shown in named if is_shown} | {"hand": _HAND_COLOUR}
        hands = np.concatenate([_hands(moment.snapshot) for moment in moments])
        points = np.concatenate([cloud["xyz"] for cloud in self._clouds]).astype(np.float64)
        low, high = (points if len(points) else hands).min(axis=0), (points if len(points) else hands).max(axis=0)
        near = ((hands > low - _NEAR_M) & (hands < high + _NEAR_M)).all(axis=1)
        points = np.concatenate((points, hands[near]))
        x, y, z = beside.rotation_w[:, 2].tolist()
        direction = math.degrees(math.atan2(y, x)), math.degrees(math.asin(min(max(z, -1.0), 1.0)))
        size, fov_deg = (beside.width, beside.height), math.degrees(beside.fov_rad)
        self._camera = following_cameras([points], *direction, *size, fov_deg, free_below=free_below)[0]

    def draw(self, number: int) -> np.ndarray:
        """Draw one of the moments, (H, W, 3) uint8."""
        cloud, hands = self._clouds[number], _hands(self._moments[number].snapshot)
        lifted = (_LIFT + cloud["rgb"] * ((255 - _LIFT) / 255)).astype(np.uint8)
        colours = paint_masks(lifted, cloud["seg"], _MASK_OPACITY)
        both = np.concatenate((colours, np.full(hands.shape, _HAND_COLOUR, dtype=np.uint8)))
        xyz = np.concatenate((cloud["xyz"], hands))
        picture = draw_points(xyz, both, self._camera, _SQUARE_M, _DARK)
        return self._write_legend(picture, len(cloud["xyz"]))

    def _write_legend(self, picture: np.ndarray, count: int) -> np.ndarray:
        """Return the picture with what the colours mean, below."""
        image = Image.fromarray(picture)
        pen, size = ImageDraw.Draw(image), max(9, round(_LETTERS_SHARE * picture.shape[0]))
        font, x, y = ImageFont.load_default(size), float(size), picture.shape[0] - 1.2 * size
        head = f"{count:,} points"
        pen.text((x, y), head, _INK, font, anchor="lm")
        x += size + font.getlength(head)
        for name, colour in self._legend.items():
            pen.rectangle((x, y - size / 3, x + size / 1.5, y + size / 3), colour)
            pen.text((x + size, y), name, _INK, font, anchor="lm")
            x += 2.0 * size + font.getlength(name)
        return np.asarray(image)


def given_points(
    task: Task, scene: Scene, target: str, sampling: Sampling | None, moments: Sequence[ObservationContext]
) -> Iterator[dict[str, np.ndarray]]:
    """Yield the points that a policy is given in each moment: `xyz` (N, 3) world, `rgb` and `seg`.

    Args:
        task: what is asked.
        scene: of the episode.
        target: the target link.
        sampling: which points; None for some of the full cloud.
        moments: of the episode.
    """
    wanted = sampling or _WHOLE_CLOUD
    observer = sampled_points(task, wanted.method, wanted.num_points, "world", **wanted.all_settings)
    observer.enter(scene, target)
    observation = empty_observation(observer.space)
    for moment in moments:
        observer.observe(moment, observation)
        cloud = observation["pointcloud"]
        seen = cloud["xyz"].any(axis=1)
        yield {name: part[seen] for name, part in cloud.items()}


def _hands(snapshot: Snapshot) -> np.ndarray:
    """Return the outlines of all hands of the first environment, (N, 3) world."""
    turned = [_HAND @ rotation.T for rotation in snapshot.tool_rotation_w[0]]
    return np.concatenate(
        [points + place for points, place in zip(turned, snapshot.tool_position_w[0], strict=True)]
    )


def check_size(width: int | None, height: int | None) -> None:
    """Check the sides of a picture in pixels, None for the default.

    Raises:
        ConfigError: one is not in range.
    """
    for name, pixels in (("width", width), ("height", height)):
        if pixels is not None and not 1 <= pixels <= MOST_PX:
            raise ConfigError(f"the picture's {name} must lie in [1, {MOST_PX}] pixels, not {pixels}")
