"""What is drawn over the scene, anew in every moment: what the robot's cameras see, contacts and forces."""

import math
from typing import Any

import numpy as np

from artiskill.envs.core import ObservationContext, empty_observation
from artiskill.envs.vision import PointCloudObserver
from artiskill.errors import check_name
from artiskill.geometry.rotations import quat_from_matrix
from artiskill.scene.scene import Scene
from artiskill.sensors.pictures.compose import below, paint_depth, paint_masks
from artiskill.sim.simulation import Contacts
from artiskill.tasks.task import Task

PICTURES = ("colour", "masks", "depth", "off")
CONTACTS = "contacts and forces"
_BLUE, _RED = (60, 120, 220), (220, 40, 40)
_MOST_POINTS = 40_000
_CONTACT_M, _M_PER_N, _LEAST_N = 0.012, 0.004, 0.5  # a contact; an arrow of a force, and which forces have one
_POINT_M, _FRUSTUM_M, _FRUSTUM_LINE_M, _DEPTH_BLACK_M = 0.009, 0.12, 0.004, 7.0


class ContactView:
    """Contacts as points, and the forces in them as arrows, 4 mm for each newton.

    Args:
        server: of viser.
    """

    def __init__(self, server: Any) -> None:
        self._server = server
        self._handles: list[Any] = []

    def show(self, contacts: Contacts) -> None:
        """Draw contacts instead of those that were shown."""
        self.remove()
        points = contacts.position_w.astype(np.float32)
        if not len(points):
            return
        forces = contacts.force_w.astype(np.float32)
        strong = np.linalg.norm(forces, axis=1) > _LEAST_N
        scene = self._server.scene
        with self._server.atomic():
            self._handles.append(
                scene.add_point_cloud("/contacts/points", points, _RED, point_size=_CONTACT_M, precision="float32")
            )
            if strong.any():
                ends = np.stack((points[strong], points[strong] + _M_PER_N * forces[strong]), axis=1)
                sizes = {"shaft_radius": 0.003, "head_radius": 0.008, "head_length": 0.02}
                self._handles.append(scene.add_arrows("/contacts/forces", ends, _RED, **sizes))

    def remove(self) -> None:
        """Take them away."""
        for handle in self._handles:
            handle.remove()
        self._handles = []


class SensorView:
    """What the robot's cameras see: pictures, the cameras themselves, and their points where they are.

    Args:
        server: of viser.
        task: whose cameras and masks these are.
        scene: what they see.
        target: the target link.
    """

    def __init__(self, server: Any, task: Task, scene: Scene, target: str) -> None:
        self._server, self._shape = server, (task.cameras.number, task.cameras.height, task.cameras.width)
        self._observer = PointCloudObserver(task)
        self._observer.enter(scene, target)
        self._observation = empty_observation(self._observer.space)
        self._cameras = np.zeros((0, 4, 4))
        order = np.random.default_rng(0).permutation(task.cameras.pixels)  # every tenth pixel would make stripes
        self._chosen = np.sort(order[:_MOST_POINTS])
        self._frustums: list[Any] = []
        self._points: Any = None
        self._fov_rad = math.radians(task.cameras.fov_deg)

    def observe(self, context: ObservationContext) -> None:
        """Look at a moment."""
        self._cameras = self._observer.observe(context, self._observation)["cameras"]["world_to_camera"]

    def picture(self, kind: str) -> np.ndarray:
        """Return the cameras' pictures, one below the other, (H, W, 3) uint8.

        Raises:
            UnknownNameError: not one of `PICTURES`, or `off`.
        """
        check_name("picture", kind, PICTURES[:-1])
        cloud = self._observation["pointcloud"]
        rgb = cloud["rgb"].reshape(*self._shape, 3)
        if kind == "masks":
            rgb = paint_masks(rgb, cloud["seg"].reshape(*self._shape, -1))
        elif kind == "depth":
            rgb = paint_depth(self._depth(cloud["xyz"]), _DEPTH_BLACK_M)
        return below(list(rgb))

    def _depth(self, xyz: np.ndarray) -> np.ndarray:
        """Return the depth along each optical axis, (C, H, W) metres, 0 where nothing is seen."""
        points = xyz.reshape(self._shape[0], -1, 3)
        axis, shift = self._cameras[:, 2, :3], self._cameras[:, 2, 3]
        depth = (points * axis[:, None]).sum(axis=2) + shift[:, None]
        return np.where(points.any(axis=2), depth, 0.0).reshape(self._shape)

    def cloud(self) -> tuple[np.ndarray, np.ndarray]:
        """Return points (P, 3) float32 in the world and colours (P, 3) uint8, thinned out where there are many."""
        cloud = self._observation["pointcloud"]
        xyz, rgb = cloud["xyz"][self._chosen], cloud["rgb"][self._chosen]
        seen = xyz.any(axis=1)
        return xyz[seen], rgb[seen]

    def show_cloud(self, is_visible: bool) -> None:
        """Draw points and cameras, or take them away."""
        if not is_visible:
            self.remove()
            return
        xyz, rgb = self.cloud()
        if self._points is None:
            self._points = self._server.scene.add_point_cloud(
                "/sensors/points", xyz, rgb, point_size=_POINT_M, precision="float32", point_shading="flat"
            )
            self._frustums = [self._add_frustum(k) for k in range(self._shape[0])]
        else:
            self._points.points, self._points.colors = xyz, rgb
        for frustum, (position, quaternion) in zip(self._frustums, self.camera_poses(), strict=True):
            frustum.position, frustum.wxyz = position, quaternion

    def camera_poses(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return position (3,) and orientation (4,) of each camera in the world; x right, y down, z forward."""
        poses = []
        for matrix in self._cameras:
            rotation = matrix[:3, :3].T
            poses.append((-rotation @ matrix[:3, 3], quat_from_matrix(rotation)))
        return poses

    def _add_frustum(self, number: int) -> Any:
        _, height, width = self._shape
        return self._server.scene.add_camera_frustum(
            f"/sensors/camera-{number}",
            fov=self._fov_rad,
            aspect=width / height,
            scale=_FRUSTUM_M,
            thickness=_FRUSTUM_LINE_M,
            color=_BLUE,
            cast_shadow=False,
        )

    def remove(self) -> None:
        """Take points and cameras away."""
        for handle in (*self._frustums, *([] if self._points is None else [self._points])):
            handle.remove()
        self._frustums, self._points = [], None
