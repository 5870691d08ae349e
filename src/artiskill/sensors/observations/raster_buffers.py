"""`Sight`: what C cameras see of one environment, drawn but not resolved: only what is asked for is computed.

An observation needs images camera by camera, a cloud, or colours of a thousand pixels only. A sight goes from the
buffers straight to its arrays, some rows at a time, so that nothing in between leaves near memory.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.camera import View, Views
from artiskill.sensors.drawing.backdrop import Backdrop
from artiskill.sensors.drawing.buffers import BAND_ROWS, Drawing, Scratch, drawing_of
from artiskill.sensors.drawing.fast_shading import list_runs, set_up_faces
from artiskill.sensors.drawing.render import Poses, colour_rows, draw_view, forget_faces
from artiskill.sensors.drawing.scene_tables import SceneTables
from artiskill.sensors.drawing.shading import Lights
from artiskill.sensors.drawing.simd import copy, fill
from artiskill.sensors.observations.point_cloud import (
    Rays,
    classify_pixels,
    classify_views,
    interleave_channels,
    mask_runs,
    masks_of_points,
    points_of_pixels,
    points_of_views,
    see_points,
    unproject_rows,
    write_channels,
    write_cloud,
)

if TYPE_CHECKING:
    from artiskill.sensors.renderer import Images


@kernel
def see_channels(
    scene: SceneTables,
    poses: Poses,
    views: Views,
    light: Lights,
    plain: Array,
    has_floor: bool,
    codes: Array,
    scratch: Scratch,
    rgb: Array,
    depth: Array,
    seg: Array,
) -> None:
    """See `Sight.channels`."""
    height, width, cameras = depth.shape
    prepare_views(scene, poses, views, light, has_floor, scratch)
    for top in range(0, height, BAND_ROWS):
        rows = min(BAND_ROWS, height - top)
        for camera in range(cameras):
            colour_band(camera, top, rows, scene, views, light, plain, scratch)
        interleave_channels(
            rows * width, scratch.rgb, scratch.depth, rgb[top : top + rows], depth[top : top + rows]
        )
    fill(seg.reshape(-1), False)
    masks = seg.reshape(height * width, cameras, seg.shape[3])
    for camera in range(cameras):
        drawing = drawing_of(scratch.drawings, camera)
        mask_runs(drawing.runs[: drawing.row_runs[-1]], drawing.triangle, scene.face_geom, codes, masks[:, camera])
        forget_faces(scratch.faces[camera], drawing)


@kernel
def see_cloud(
    scene: SceneTables,
    poses: Poses,
    views: Views,
    light: Lights,
    plain: Array,
    has_floor: bool,
    codes: Array,
    rays: Rays,
    scratch: Scratch,
    xyz: Array,
    rgb: Array,
    seg: Array,
) -> None:
    """See `Sight.cloud`."""
    cameras, height, width, _ = xyz.shape
    prepare_views(scene, poses, views, light, has_floor, scratch)
    fill(seg.reshape(-1), False)
    for camera in range(cameras):
        drawing = drawing_of(scratch.drawings, camera)
        for top in range(0, height, BAND_ROWS):
            rows = min(BAND_ROWS, height - top)
            colour_band(camera, top, rows, scene, views, light, plain, scratch)
            copy(scratch.rgb[camera, : rows * width].reshape(-1), rgb[camera, top:].reshape(-1))
            band = scratch.depth[camera, : rows * width].reshape(rows, width)
            unproject_rows(band, rays, camera, top, xyz[camera, top : top + rows])
        masks = seg[camera].reshape(height * width, seg.shape[3])
        mask_runs(drawing.runs[: drawing.row_runs[-1]], drawing.triangle, scene.face_geom, codes, masks)
        forget_faces(scratch.faces[camera], drawing)


@kernel
def prepare_views(
    scene: SceneTables, poses: Poses, views: Views, light: Lights, has_floor: bool, scratch: Scratch
) -> None:
    """Draw all views into their buffers, list their runs and faces, and set the faces up."""
    positions, rotations = poses.positions[0], poses.rotations[0]
    for camera in range(views.positions.shape[0]):
        view = View(views.positions[camera], views.rotations[camera], views.lenses[camera])
        drawing = drawing_of(scratch.drawings, camera)
        backdrop = draw_view(scene, positions, rotations, view, has_floor, drawing, scratch)
        numbers = scratch.backdrops[camera]
        numbers[0], numbers[1], numbers[2] = backdrop.corner, backdrop.per_column, backdrop.per_row
        numbers[3] = backdrop.farthest
        scratch.faces[camera] = list_runs(
            drawing.triangle,
            drawing.drawn,
            drawing.face_state,
            drawing.seen,
            drawing.runs,
            drawing.row_runs,
        )
        set_up_faces(scratch.faces[camera], scene, rotations, view, light, drawing, scratch.lit)


@kernel
def colour_band(
    camera: int,
    top: int,
    rows: int,
    scene: SceneTables,
    views: Views,
    light: Lights,
    plain: Array,
    scratch: Scratch,
) -> None:
    """Colours and depths of some rows of a view, in the scratch's own."""
    view = View(views.positions[camera], views.rotations[camera], views.lenses[camera])
    drawing = drawing_of(scratch.drawings, camera)
    backdrop = kept_backdrop(scratch.backdrops[camera], drawing)
    depth, rgb = scratch.depth[camera], scratch.rgb[camera]
    colour_rows(top, rows, scene, view, light, plain, backdrop, drawing, scratch.textured, depth, rgb)


@kernel
def kept_backdrop(numbers: Array, drawing: Drawing) -> Backdrop:
    """A view's backdrop, from what `prepare_views` wrote down."""
    return Backdrop(numbers[0], numbers[1], numbers[2], np.float32(numbers[3]), drawing.floor)


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


CHANNELS = ("rgb", "depth", "geom")


@dataclass(frozen=True, eq=False)
class PictureSight:
    """Methods as of `Sight`; the images have `CHANNELS`."""

    images: "Images"

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
