"""`Sight`: what C cameras see of one environment, drawn but not resolved: only what is asked for is computed.

An observation needs images camera by camera, a cloud, or colours of a thousand pixels only. A sight goes from the
buffers straight to its arrays, some rows at a time, so that nothing in between leaves near memory.
"""

from dataclasses import dataclass

import numpy as np

from artiskill.sensors.lighting import Lights
from artiskill.sensors.point_cloud import Rays
from artiskill.sensors.render_views import Poses, Views
from artiskill.sensors.scene_tables import SceneTables
from artiskill.sensors.scratch import Scratch
from artiskill.sensors.sight_images import see_channels, see_cloud
from artiskill.sensors.sight_points import classify_views, points_of_views, see_points


@dataclass(frozen=True, eq=False)
class Sight:
    """See the module; valid until the calling thread draws something else. From `Renderer.sight`.

    Attributes:
        scene: what is drawn.
        poses: of one environment.
        views: C cameras.
        light: lights and the display table.
        plain: (2, 3) uint8 colours of background and floor.
        has_floor: whether the ground is drawn.
        scratch: of the calling thread, for C views.
    """

    scene: SceneTables
    poses: Poses
    views: Views
    light: Lights
    plain: np.ndarray
    has_floor: bool
    scratch: Scratch

    def channels(self, codes: np.ndarray, rgb: np.ndarray, depth: np.ndarray, seg: np.ndarray) -> None:
        """Images, all of a camera's channels together, camera by camera; contiguous arrays.

        Args:
            codes: (G + 2,) uint8, see `mask_codes`.
            rgb: (H, W, C, 3) uint8 written.
            depth: (H, W, C) float32 written.
            seg: (H, W, C, k) bool written.
        """
        looks = self.light, self.plain, self.has_floor
        see_channels(self.scene, self.poses, self.views, *looks, codes, self.scratch, rgb, depth, seg)

    def cloud(self, codes: np.ndarray, rays: Rays, xyz: np.ndarray, rgb: np.ndarray, seg: np.ndarray) -> None:
        """A point for each pixel; contiguous arrays.

        Args:
            codes: (G + 2,) uint8, see `mask_codes`.
            rays: of the cameras.
            xyz: (C, H, W, 3) float32 world, written; the world's origin where nothing is seen.
            rgb: (C, H, W, 3) uint8 written.
            seg: (C, H, W, k) bool written.
        """
        looks = self.light, self.plain, self.has_floor
        see_cloud(self.scene, self.poses, self.views, *looks, codes, rays, self.scratch, xyz, rgb, seg)

    def classified(self, codes: np.ndarray, rays: Rays) -> np.ndarray:
        """A byte for each pixel, (C * H * W,), as from `classify_pixels`; `codes` (G + 2,) see `mask_codes`."""
        out = np.empty(self.scratch.drawings.triangle.shape, dtype=np.uint8)
        classify_views(self.scene, self.poses, self.views, self.has_floor, codes, rays, self.scratch, out)
        return out.reshape(-1)

    def positions(self, pixels: np.ndarray, rays: Rays) -> np.ndarray:
        """World positions (M, 3) float32 of pixels (M,) int32 that show faces; after `classified`."""
        xyz = np.empty((len(pixels), 3), dtype=np.float32)
        points_of_views(pixels, rays, self.scratch, xyz)
        return xyz

    def points(
        self,
        pixels: np.ndarray,
        rays: Rays,
        classes: np.ndarray,
        xyz: np.ndarray,
        rgb: np.ndarray,
        seg: np.ndarray,
    ) -> None:
        """Points of pixels that show faces.

        Args:
            pixels: (M,) int32 numbers in the full cloud.
            rays: of the cameras.
            classes: what `classified` returned.
            xyz: (M, 3) float32 world, written.
            rgb: (M, 3) uint8 written.
            seg: (M, k) bool written.
        """
        looks = self.scene, self.poses, self.views, self.light
        see_points(pixels, *looks, rays, classes, self.scratch, xyz, rgb, seg)
