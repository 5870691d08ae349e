"""`RasterBuffers`: what C cameras see of one environment, of which only what is asked for is computed.

An observation needs images camera by camera, a cloud, or colours of a thousand pixels only. Each goes from the
buffers straight to its arrays, some rows at a time, so that nothing in between leaves near memory.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.camera import view_at
from artiskill.sensors.drawing.buffers import BAND_ROWS, Scratch, ViewBuffers, buffers_at
from artiskill.sensors.drawing.fast_shading import (
    forget_faces,
    list_faces,
    list_runs,
    paint_pixels,
    set_up_faces,
)
from artiskill.sensors.drawing.rasterise import draw_view
from artiskill.sensors.drawing.render import RenderInputs, colour_rows, pose_at
from artiskill.sensors.drawing.simd import LANES, copy, fill, interleave_floats, interleave_pixels
from artiskill.sensors.observations.point_cloud import (
    FIRST_ID,
    classify_view,
    masks_of_points,
    positions_of_pixels,
    unproject_rows,
)


class ImageArrays(NamedTuple):
    """Images, all of a camera's channels together, camera by camera; contiguous.

    `rgb` (H, W, C, 3) uint8, `depth` (H, W, C) float32 metres, `seg` (H, W, C, k) bool.
    """

    rgb: Array
    depth: Array
    seg: Array


class CloudArrays(NamedTuple):
    """Points; contiguous.

    `xyz` (..., 3) float32 world, the world's origin where nothing is seen, `rgb` (..., 3) uint8, `seg` (..., k)
    bool; for a full cloud ... is (C, H, W).
    """

    xyz: Array
    rgb: Array
    seg: Array


@dataclass(frozen=True, eq=False)
class RasterBuffers:
    """See the module; valid until the calling thread draws something else. From `Renderer.rasterise`.

    Attributes:
        inputs: what is drawn, of one environment with C views.
        scratch: of the calling thread, for C views.
    """

    inputs: RenderInputs
    scratch: Scratch

    def write_images(self, codes: np.ndarray, out: ImageArrays) -> None:
        """Write images and masks of all cameras; `codes` (G + 2,) see `mask_codes`."""
        write_images(self.inputs, codes, self.scratch, out)

    def write_cloud(self, codes: np.ndarray, out: CloudArrays) -> None:
        """Write a point for each pixel; `codes` (G + 2,) see `mask_codes`."""
        write_cloud(self.inputs, codes, self.scratch, out)

    def classify(self, codes: np.ndarray) -> np.ndarray:
        """Return a byte for each pixel, (C * H * W,): its masks' bits, and `COUNTS` where it is above the ground.

        0 stands for ground and nothing; `codes` (G + 2,) see `mask_codes`.
        """
        classes = np.empty(self.scratch.views.triangle.shape, dtype=np.uint8)
        classify_views(self.inputs, codes, self.scratch, classes)
        return classes.reshape(-1)

    def positions(self, pixels: np.ndarray) -> np.ndarray:
        """Return world positions (M, 3) float32 of pixels (M,) int32 that show faces; after `classify`."""
        xyz = np.empty((len(pixels), 3), dtype=np.float32)
        positions_of_pixels(pixels, self.inputs.views, self.scratch.views.inverse_depth, xyz)
        return xyz

    def write_points(self, pixels: np.ndarray, classes: np.ndarray, out: CloudArrays) -> None:
        """Write points of pixels that show faces.

        Args:
            pixels: (M,) int32 numbers in the full cloud.
            classes: what `classify` returned.
            out: M points.
        """
        write_points(self.inputs, pixels, classes, self.scratch, out)


@kernel
def write_images(inputs: RenderInputs, codes: Array, scratch: Scratch, out: ImageArrays) -> None:
    """See `RasterBuffers.write_images`."""
    rgb, depth, seg = out.rgb, out.depth, out.seg
    scene, light, views = inputs.scene, inputs.light, inputs.views
    height, width, cameras = depth.shape
    prepare_views(inputs, scratch)
    for top in range(0, height, BAND_ROWS):
        rows = min(BAND_ROWS, height - top)
        for camera in range(cameras):
            colour_rows(camera, top, rows, scene, view_at(views, camera), light, inputs.picture, scratch)
        bottom = top + rows
        interleave_channels(rows * width, scratch.rgb, scratch.depth, rgb[top:bottom], depth[top:bottom])
    fill(seg.reshape(-1), False)
    masks = seg.reshape(height * width, cameras, seg.shape[3])
    for camera in range(cameras):
        buffers = buffers_at(scratch.views, camera)
        mask_runs(buffers, scene.face_geom, codes, masks[:, camera])
        forget_faces(buffers)


@kernel
def write_cloud(inputs: RenderInputs, codes: Array, scratch: Scratch, out: CloudArrays) -> None:
    """See `RasterBuffers.write_cloud`."""
    xyz, rgb, seg = out.xyz, out.rgb, out.seg
    scene, light, views = inputs.scene, inputs.light, inputs.views
    cameras, height, width, _ = xyz.shape
    prepare_views(inputs, scratch)
    fill(seg.reshape(-1), False)
    for camera in range(cameras):
        view = view_at(views, camera)
        for top in range(0, height, BAND_ROWS):
            rows = min(BAND_ROWS, height - top)
            colour_rows(camera, top, rows, scene, view, light, inputs.picture, scratch)
            copy(scratch.rgb[camera, : rows * width].reshape(-1), rgb[camera, top:].reshape(-1))
            depth = scratch.depth[camera, : rows * width].reshape(rows, width)
            unproject_rows(depth, views, camera, top, scratch.coordinates, xyz[camera, top : top + rows])
        buffers = buffers_at(scratch.views, camera)
        masks = seg[camera].reshape(height * width, seg.shape[3])
        mask_runs(buffers, scene.face_geom, codes, masks)
        forget_faces(buffers)


@kernel
def prepare_views(inputs: RenderInputs, scratch: Scratch) -> None:
    """Draw all views into their buffers, list their runs and faces, and set the faces up."""
    scene, light, pose = inputs.scene, inputs.light, pose_at(inputs.poses, 0)
    for camera in range(scratch.views.triangle.shape[0]):
        view, buffers = view_at(inputs.views, camera), buffers_at(scratch.views, camera)
        draw_view(scene, pose, view, light.has_floor, buffers, scratch)
        list_runs(buffers)
        if inputs.picture.size == 0:
            set_up_faces(scene, pose.rotations, view, light, buffers, scratch.lit)


@kernel
def interleave_channels(pixels: int, rgb: Array, depth: Array, rgb_out: Array, depth_out: Array) -> None:
    """Turn images one behind the other into channels: all of a camera's together, camera by camera.

    Args:
        pixels: how many.
        rgb: (C, P, 3) uint8, P may be more.
        depth: (C, P) float32.
        rgb_out: (R, W, C, 3) written.
        depth_out: (R, W, C) written.
    """
    cameras, stride = depth.shape
    done = 0
    while cameras == 3 and done + LANES <= pixels:
        interleave_floats(depth_out, 3 * done, depth, done, stride + done, 2 * stride + done)
        interleave_pixels(rgb_out, done, rgb, done, stride + done, 2 * stride + done)
        done += LANES
    colours, depths = rgb_out.reshape(-1), depth_out.reshape(-1)
    for i in range(done, pixels):
        for camera in range(cameras):
            place = i * cameras + camera
            for k in range(3):
                colours[3 * place + k] = rgb[camera, i, k]
            depths[place] = depth[camera, i]


@kernel
def mask_runs(buffers: ViewBuffers, face_geom: Array, codes: Array, seg: Array) -> None:
    """Write the masks of a view's pixels where they show faces.

    Args:
        buffers: of the view, whose runs are listed.
        face_geom: (F,) visual of each face.
        codes: (G + 2,) uint8, see `mask_codes`.
        seg: (P, k) bool, False to begin with: most pixels lie in no mask.
    """
    runs, faces = buffers.runs, buffers.triangle.reshape(-1)
    for i in range(buffers.row_runs[-1]):
        first = runs[i, 0]
        code = codes[face_geom[faces[first]] - FIRST_ID]
        if code:
            for j in range(first, first + runs[i, 1]):
                for k in range(seg.shape[1]):
                    seg[j, k] = (code >> k) & 1


@kernel
def classify_views(inputs: RenderInputs, codes: Array, scratch: Scratch, classes: Array) -> None:
    """Draw all views into their buffers, and write a byte per pixel: see `RasterBuffers.classify`."""
    fill(classes.reshape(-1), np.uint8(0))
    scene, views, pose = inputs.scene, inputs.views, pose_at(inputs.poses, 0)
    for camera in range(classes.shape[0]):
        buffers = buffers_at(scratch.views, camera)
        draw_view(scene, pose, view_at(views, camera), inputs.light.has_floor, buffers, scratch)
        classify_view(camera, buffers, scene.face_geom, codes, views, scratch.coordinates[0], classes[camera])


@kernel
def write_points(inputs: RenderInputs, pixels: Array, classes: Array, scratch: Scratch, out: CloudArrays) -> None:
    """See `RasterBuffers.write_points`: only the faces that these pixels show are set up."""
    scene, light, rgb, pose = inputs.scene, inputs.light, out.rgb, pose_at(inputs.poses, 0)
    positions_of_pixels(pixels, inputs.views, scratch.views.inverse_depth, out.xyz)
    masks_of_points(pixels, classes, out.seg)
    if inputs.picture.size > 0:
        colours = inputs.picture.reshape(-1, 3)
        for i in range(pixels.shape[0]):
            for k in range(3):
                rgb[i, k] = colours[pixels[i], k]
        return
    for camera in range(scratch.views.triangle.shape[0]):
        view, buffers = view_at(inputs.views, camera), buffers_at(scratch.views, camera)
        list_faces(camera, pixels, buffers)
        set_up_faces(scene, pose.rotations, view, light, buffers, scratch.lit)
        paint_pixels(camera, pixels, view.lens, scene, buffers, rgb)
        forget_faces(buffers)
