"""`PictureSight`: what `Sight` offers, from images that are drawn already: those of `picture` quality."""

from dataclasses import dataclass

import numpy as np

from artiskill.sensors.images import Images
from artiskill.sensors.point_cloud import Rays, classify_pixels, points_of_pixels, write_cloud
from artiskill.sensors.segmentation import masks_of_points, write_channels

CHANNELS = ("rgb", "depth", "geom")


@dataclass(frozen=True, eq=False)
class PictureSight:
    """Methods as of `Sight`; the images have `CHANNELS`."""

    images: Images

    def channels(self, codes: np.ndarray, rgb: np.ndarray, depth: np.ndarray, seg: np.ndarray) -> None:
        """See `Sight.channels`."""
        seg[...] = False
        write_channels(self.images.rgb, self.images.depth, self.images.geom, codes, rgb, depth, seg)

    def cloud(self, codes: np.ndarray, rays: Rays, xyz: np.ndarray, rgb: np.ndarray, seg: np.ndarray) -> None:
        """See `Sight.cloud`."""
        seg[...] = False
        rgb[...] = self.images.rgb
        write_cloud(self.images.depth, self.images.geom, codes, rays, xyz, seg)

    def classified(self, codes: np.ndarray, rays: Rays) -> np.ndarray:
        """See `Sight.classified`."""
        out = np.empty(self.images.geom.shape, dtype=np.uint8)
        classify_pixels(self.images.depth, self.images.geom, codes, rays, out)
        return out.reshape(-1)

    def positions(self, pixels: np.ndarray, rays: Rays) -> np.ndarray:
        """See `Sight.positions`."""
        xyz = np.empty((len(pixels), 3), dtype=np.float32)
        points_of_pixels(self.images.depth, pixels, rays, xyz)
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
        """See `Sight.points`."""
        points_of_pixels(self.images.depth, pixels, rays, xyz)
        rgb[...] = self.images.rgb.reshape(-1, 3)[pixels]
        masks_of_points(pixels, classes, seg)
