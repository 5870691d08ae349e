"""The modes `rgbd` and `pointcloud`: what the cameras on the robot's base see, and the robot's own state.

The object shows in its pixels and masks only.
"""

import math
from functools import lru_cache
from typing import Any, Literal

import gymnasium as gym
import numpy as np

from artiskill.envs.core import ObservationContext
from artiskill.errors import check_name
from artiskill.scene.scene import Scene
from artiskill.sensors.observations.cameras import Panorama
from artiskill.sensors.observations.point_cloud import mask_codes, move_to_frame
from artiskill.sensors.observations.raster_buffers import CloudArrays, ImageArrays, RasterBuffers
from artiskill.sensors.observations.sampling import Sampler, make_sampler
from artiskill.sensors.render_config import RenderConfig
from artiskill.sensors.renderer import BodyVisual, Renderer
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.state_vector import field_bounds, observe_robot, robot_fields
from artiskill.tasks.task import Task

Frame = Literal["world", "robot", "end_effector"]
FRAMES: tuple[Frame, ...] = ("world", "robot", "end_effector")

_RENDERERS = 128  # scenes; a generated cabinet's takes about 3 MB
_BASE_REACH_M = 20.0  # bound of the base's place, as in the robot's part of the state


@lru_cache(maxsize=_RENDERERS)
def _renderer(scene: Scene, config: RenderConfig) -> Renderer:
    """Return a scene's renderer; the last ones are kept."""
    visuals = [BodyVisual(body, visual) for body, visual in scene.visuals]
    return Renderer(visuals, config)


class CameraRig:
    """The cameras, masks and proprioception of a task's robot; what both visual modes share."""

    def __init__(self, task: Task) -> None:
        """Compute what does not depend on the scene."""
        self.task = task
        self.panorama = Panorama(task.cameras)
        self.masks = len(task.mask_names)
        self._upper = field_bounds(robot_fields(len(task.robot.mounts)))
        self.agent_space = gym.spaces.Box(-self._upper, self._upper, dtype=np.float32)
        self._scene: Scene | None = None
        self.shape = task.cameras.number, task.cameras.height, task.cameras.width
        self.codes = np.zeros(0, dtype=np.uint8)

    def enter(self, scene: Scene, target: str) -> None:
        """Resolve the masks once for all pictures of this scene and target."""
        self._scene = scene
        self.codes = mask_codes(self.task.masks(scene, target))

    def render(self, context: ObservationContext) -> tuple[RasterBuffers, dict[str, Any]]:
        """Return what all cameras see, valid until this thread's next call, and `info["cameras"]`."""
        assert self._scene is not None, "an observer is entered before it observes"
        snapshot, row = context.snapshot, context.row
        base = snapshot.robot_qpos[row, :3].tolist()
        views = self.panorama.views(*base)
        renderer = _renderer(self._scene, self.task.render)
        poses = snapshot.body_position_w[row], snapshot.body_quaternion_w[row]
        return renderer.rasterise(*poses, views), {"cameras": self.panorama.parameters(views)}

    def proprioception(self, context: ObservationContext, out: np.ndarray) -> None:
        """Write the robot's part of the state, (38,) or (68,) float32."""
        values = observe_robot(context.snapshot, context.row)[0]
        np.minimum(np.maximum(values, -self._upper), self._upper, out=out)


class RgbdObserver:
    """The mode `rgbd`: images, the C cameras' channels one after the other.

    `{"rgbd": {"rgb": (H, W, 3C) uint8, "depth": (H, W, C) float32, "seg": (H, W, C k) bool}, "agent": (38,)}`;
    camera c has the channels 3c to 3c + 2, c, and ck to ck + k - 1. Depth is in metres along the optical axis, 0
    where nothing is seen.
    """

    def __init__(self, task: Task) -> None:
        """Compute the space."""
        self._rig = rig = CameraRig(task)
        c = task.cameras
        size = c.height, c.width
        rgbd: dict[str, gym.Space[Any]] = {
            "rgb": gym.spaces.Box(0, 255, (*size, 3 * c.number), np.uint8),
            "depth": gym.spaces.Box(0.0, c.far_m, (*size, c.number), np.float32),
            "seg": gym.spaces.Box(0, 1, (*size, c.number * rig.masks), np.bool_),
        }
        self.space: gym.spaces.Dict = gym.spaces.Dict({"rgbd": gym.spaces.Dict(rgbd), "agent": rig.agent_space})

    def enter(self, scene: Scene, target: str) -> None:
        """Resolve the masks."""
        self._rig.enter(scene, target)

    def observe(self, context: ObservationContext, out: dict[str, Any]) -> dict[str, Any]:
        """Write the images and the robot's part of the state."""
        buffers, info = self._rig.render(context)
        number, height, width = self._rig.shape
        rgb = out["rgbd"]["rgb"].reshape(height, width, number, 3)
        seg = out["rgbd"]["seg"].reshape(height, width, number, self._rig.masks)
        buffers.write_images(self._rig.codes, ImageArrays(rgb, out["rgbd"]["depth"], seg))
        self._rig.proprioception(context, out["agent"])
        return info


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
        check_name("frame", frame, FRAMES)
        self._rig = rig = CameraRig(task)
        self.sampler, self._frame = sampler, frame
        count = task.cameras.pixels if sampler is None else sampler.num_points
        reach = _BASE_REACH_M * math.sqrt(2.0) + abs(task.cameras.mount_height_m) + task.cameras.reach_m
        if frame != "world":
            reach *= 2.0  # the frame's origin may lie on the other side
        cloud: dict[str, gym.Space[Any]] = {
            "xyz": gym.spaces.Box(-reach, reach, (count, 3), np.float32),
            "rgb": gym.spaces.Box(0, 255, (count, 3), np.uint8),
            "seg": gym.spaces.Box(0, 1, (count, rig.masks), np.bool_),
        }
        self.space: gym.spaces.Dict = gym.spaces.Dict(
            {"pointcloud": gym.spaces.Dict(cloud), "agent": rig.agent_space}
        )

    def enter(self, scene: Scene, target: str) -> None:
        """Resolve the masks."""
        self._rig.enter(scene, target)

    def observe(self, context: ObservationContext, out: dict[str, Any]) -> dict[str, Any]:
        """Write the cloud and the robot's part of the state."""
        cloud = out["pointcloud"]
        self._rig.proprioception(context, out["agent"])
        buffers, info = self._rig.render(context)
        if self.sampler is None:
            parts = (cloud[name].reshape(*self._rig.shape, -1) for name in ("xyz", "rgb", "seg"))
            buffers.write_cloud(self._rig.codes, CloudArrays(*parts))
            return info
        classes = buffers.classify(self._rig.codes)
        generator = level_generator(context.level, RngStream.POINTS, context.elapsed)
        chosen = self.sampler.choose(classes, buffers.positions, generator)
        found = len(chosen)  # only these pixels become points
        for part in cloud.values():
            part[found:] = 0
        xyz = cloud["xyz"]
        buffers.write_points(chosen, classes, CloudArrays(xyz[:found], cloud["rgb"][:found], cloud["seg"][:found]))
        if self._frame != "world":
            move_to_frame(xyz[:found], *_frame_pose(self._frame, context))
        return info


def sampled_points(task: Task, method: str, num_points: int, frame: str, **settings: Any) -> PointCloudObserver:
    """Return a `PointCloudObserver` of fewer points, from what names its sampler.

    Raises:
        UnknownNameError: no such method or frame.
        ConfigError: an illegal setting.
    """
    return PointCloudObserver(task, make_sampler(method, num_points, settings), frame)


def _frame_pose(frame: str, context: ObservationContext) -> tuple[np.ndarray, np.ndarray]:
    """Return the origin (3,) and the axes as columns (3, 3) of a frame, in the world."""
    snapshot, row = context.snapshot, context.row
    if frame == "end_effector":
        return snapshot.tool_position_w[row, 0], np.ascontiguousarray(snapshot.tool_rotation_w[row, 0])
    x, y, yaw = snapshot.robot_qpos[row, :3].tolist()
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array((x, y, 0.0)), np.array(((cosine, -sine, 0.0), (sine, cosine, 0.0), (0.0, 0.0, 1.0)))
