"""The modes `rgbd` and `pointcloud`: what the cameras on the robot's base see, and what the robot feels of itself.

Neither says anything about the object but by its pixels and masks.
"""

import math
import threading
from functools import lru_cache
from typing import Any, Literal

import gymnasium as gym
import numpy as np

from artiskill.envs.observation import Instant
from artiskill.errors import UnknownNameError
from artiskill.scene.scene import Scene
from artiskill.sensors.downsample import Sampler
from artiskill.sensors.panorama import Panorama
from artiskill.sensors.point_cloud import (
    Rays,
    classify_pixels,
    move_to_frame,
    points_of_pixels,
    write_cloud,
)
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import Images, Renderer
from artiskill.sensors.segmentation import mask_codes, write_channels
from artiskill.sensors.triangle_soup import BodyVisual
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.fields import field_bounds, observe_robot, robot_fields
from artiskill.tasks.levels import Stream, level_generator
from artiskill.tasks.task import Task

Frame = Literal["world", "robot", "end_effector"]
FRAMES: tuple[Frame, ...] = ("world", "robot", "end_effector")

_CHANNELS = ("rgb", "depth", "geom")
_RENDERERS = 64  # scenes per process and thread; a generated cabinet's takes about 3 MB
_BASE_REACH_M = 20.0  # bound of the base's place, as in the robot's part of the state


@lru_cache(maxsize=_RENDERERS)
def _renderer(scene: Scene, thread: int) -> Renderer:
    """A scene's renderer, remembered; renderers keep buffers, so each thread has its own."""
    visuals = [BodyVisual(body, visual) for body, visual in scene.visuals]
    return Renderer(visuals, load_render_config("fast"))


class Eyes:
    """The cameras, masks and own body of a task's robot; what both visual modes share."""

    def __init__(self, task: Task) -> None:
        """Compute what does not depend on the scene."""
        self.task = task
        self.panorama = Panorama(task.cameras)
        self.masks = len(task.mask_names)
        self._upper = field_bounds(robot_fields(len(task.robot.mounts)))
        self.agent_space = gym.spaces.Box(-self._upper, self._upper, dtype=np.float32)
        self._scene: Scene | None = None
        shape = task.cameras.number, task.cameras.height, task.cameras.width
        self._depth = np.empty(shape, dtype=np.float32)
        self._geom = np.empty(shape, dtype=np.int32)
        self.codes = np.zeros(0, dtype=np.uint8)

    def enter(self, scene: Scene, target: str) -> None:
        """Resolve the masks once for all pictures of this scene and target."""
        self._scene = scene
        self.codes = mask_codes(self.task.masks(scene, target))

    def look(self, snapshot: Snapshot) -> tuple[Images, Rays, dict[str, Any]]:
        """Colour, depth and ids of all cameras, their rays, and `info["cameras"]`.

        Colours are the caller's to keep, depth and ids are overwritten by the next look.
        """
        assert self._scene is not None, "an observer is entered before it observes"
        base = snapshot.robot_qpos[0, :3].tolist()
        cameras, rays = self.panorama.place(*base)
        images = _renderer(self._scene, threading.get_ident()).render(
            snapshot.body_position_w[0], snapshot.body_quaternion_w[0], cameras, _CHANNELS, self._canvas()
        )
        return images, rays, {"cameras": self.panorama.parameters(cameras)}

    def _canvas(self) -> Images:
        """Where to render to: memory used before, except for what goes out as it is; new memory takes time."""
        rgb = np.empty((*self._depth.shape, 3), dtype=np.uint8)
        return Images({"rgb": rgb, "depth": self._depth, "geom": self._geom})

    def feel(self, snapshot: Snapshot) -> np.ndarray:
        """The robot's part of the state, (38,) or (68,) float32."""
        return np.minimum(np.maximum(observe_robot(snapshot)[0], -self._upper), self._upper)


class RgbdObserver:
    """The mode `rgbd`: images, the C cameras' channels one after the other.

    `{"rgbd": {"rgb": (H, W, 3C) uint8, "depth": (H, W, C) float32, "seg": (H, W, C k) bool}, "agent": (38,)}`;
    camera c has the channels 3c to 3c + 2, c, and ck to ck + k - 1. Depth is in metres along the optical axis, 0
    where nothing is seen.
    """

    def __init__(self, task: Task) -> None:
        """Compute the space."""
        self._eyes = eyes = Eyes(task)
        c = task.cameras
        size = c.height, c.width
        rgbd: dict[str, gym.Space[Any]] = {
            "rgb": gym.spaces.Box(0, 255, (*size, 3 * c.number), np.uint8),
            "depth": gym.spaces.Box(0.0, c.far_m, (*size, c.number), np.float32),
            "seg": gym.spaces.Box(0, 1, (*size, c.number * eyes.masks), np.bool_),
        }
        self.space: gym.spaces.Dict = gym.spaces.Dict({"rgbd": gym.spaces.Dict(rgbd), "agent": eyes.agent_space})

    def enter(self, scene: Scene, target: str) -> None:
        """Resolve the masks."""
        self._eyes.enter(scene, target)

    def observe(self, instant: Instant) -> tuple[dict[str, Any], dict[str, Any]]:
        """See the class."""
        images, _, info = self._eyes.look(instant.snapshot)
        number, height, width = images.geom.shape
        rgb = np.empty((height, width, number, 3), dtype=np.uint8)
        depth = np.empty((height, width, number), dtype=np.float32)
        seg = np.zeros((height, width, number, self._eyes.masks), dtype=np.bool_)
        write_channels(images.rgb, images.depth, images.geom, self._eyes.codes, rgb, depth, seg)
        rgbd = {"rgb": rgb.reshape(height, width, -1), "depth": depth, "seg": seg.reshape(height, width, -1)}
        return {"rgbd": rgbd, "agent": self._eyes.feel(instant.snapshot)}, info


class PointCloudObserver:
    """The mode `pointcloud`: what all cameras see as one cloud.

    `{"pointcloud": {"xyz": (N, 3) float32, "rgb": (N, 3) uint8, "seg": (N, k) bool}, "agent": (38,)}`. The full
    cloud has a point per pixel, camera by camera and row by row, in the world frame; pixels that see nothing have
    xyz (0, 0, 0), the background's colour and no mask. With a sampler, N is its number of points, in the chosen
    frame, and rows of zeros stand at the end where there are too few.
    """

    def __init__(self, task: Task, sampler: Sampler | None = None, frame: str = "world") -> None:
        """Compute the space.

        Args:
            task: what is asked.
            sampler: None for the full cloud.
            frame: `world`, `robot` (on the floor below the base, x forward) or `end_effector` (between the fingers
                of the first arm, z forward, the fingers close along y); of sampled points.

        Raises:
            UnknownNameError: no such frame.
        """
        if frame not in FRAMES:
            raise UnknownNameError("frame", frame, FRAMES)
        self._eyes = eyes = Eyes(task)
        self.sampler, self._frame = sampler, frame
        count = task.cameras.pixels if sampler is None else sampler.num_points
        reach = _BASE_REACH_M * math.sqrt(2.0) + abs(task.cameras.mount_height_m) + task.cameras.reach_m
        if frame != "world":
            reach *= 2.0  # the frame's origin may lie on the other side
        cloud: dict[str, gym.Space[Any]] = {
            "xyz": gym.spaces.Box(-reach, reach, (count, 3), np.float32),
            "rgb": gym.spaces.Box(0, 255, (count, 3), np.uint8),
            "seg": gym.spaces.Box(0, 1, (count, eyes.masks), np.bool_),
        }
        self.space: gym.spaces.Dict = gym.spaces.Dict(
            {"pointcloud": gym.spaces.Dict(cloud), "agent": eyes.agent_space}
        )

    def enter(self, scene: Scene, target: str) -> None:
        """Resolve the masks."""
        self._eyes.enter(scene, target)

    def observe(self, instant: Instant) -> tuple[dict[str, Any], dict[str, Any]]:
        """See the class."""
        images, rays, info = self._eyes.look(instant.snapshot)
        cloud = self._all(images, rays) if self.sampler is None else self._sampled(images, rays, instant)
        return {"pointcloud": cloud, "agent": self._eyes.feel(instant.snapshot)}, info

    def _all(self, images: Images, rays: Rays) -> dict[str, np.ndarray]:
        shape, masks = images.geom.shape, self._eyes.masks
        xyz = np.empty((*shape, 3), dtype=np.float32)
        seg = np.zeros((*shape, masks), dtype=np.bool_)
        write_cloud(images.depth, images.geom, self._eyes.codes, rays, xyz, seg)
        return {"xyz": xyz.reshape(-1, 3), "rgb": images.rgb.reshape(-1, 3), "seg": seg.reshape(-1, masks)}

    def _sampled(self, images: Images, rays: Rays, instant: Instant) -> dict[str, np.ndarray]:
        """The sampler's choice of pixels; only those become points."""
        sampler, depth, geom = self.sampler, images.depth, images.geom
        assert sampler is not None

        def positions_of(pixels: np.ndarray) -> np.ndarray:
            xyz = np.empty((len(pixels), 3), dtype=np.float32)
            points_of_pixels(depth, pixels, rays, xyz)
            return xyz

        code_images = np.empty(geom.shape, dtype=np.uint8)
        classify_pixels(depth, geom, self._eyes.codes, rays, code_images)
        pixel_codes = code_images.reshape(-1)
        generator = level_generator(instant.level, Stream.POINTS, instant.elapsed)
        chosen = sampler.choose(pixel_codes, positions_of, generator)
        found, masks = len(chosen), self._eyes.masks
        xyz = np.zeros((sampler.num_points, 3), dtype=np.float32)
        rgb = np.zeros((sampler.num_points, 3), dtype=np.uint8)
        seg = np.zeros((sampler.num_points, masks), dtype=np.bool_)
        xyz[:found] = positions_of(chosen)
        if self._frame != "world":
            move_to_frame(xyz[:found], *_frame_pose(self._frame, instant.snapshot))
        rgb[:found] = images.rgb.reshape(-1, 3)[chosen]
        seg[:found] = (pixel_codes[chosen, None] >> np.arange(masks, dtype=np.uint8)) & 1
        return {"xyz": xyz, "rgb": rgb, "seg": seg}


def _frame_pose(frame: str, snapshot: Snapshot) -> tuple[np.ndarray, np.ndarray]:
    """Origin (3,) and axes as columns (3, 3), in the world."""
    if frame == "end_effector":
        return snapshot.tool_position_w[0, 0], np.ascontiguousarray(snapshot.tool_rotation_w[0, 0])
    x, y, yaw = snapshot.robot_qpos[0, :3].tolist()
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array((x, y, 0.0)), np.array(((cosine, -sine, 0.0), (sine, cosine, 0.0), (0.0, 0.0, 1.0)))
