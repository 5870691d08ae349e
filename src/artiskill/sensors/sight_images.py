"""Kernels that draw all cameras of one environment and write images or a full cloud, some rows at a time."""

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.backdrop import Backdrop
from artiskill.sensors.lighting import Lights, View
from artiskill.sensors.point_cloud import Rays, unproject_rows
from artiskill.sensors.render_views import Poses, Views, colour_rows, draw_view, forget_faces
from artiskill.sensors.row_fill import copy, fill
from artiskill.sensors.runs import list_runs
from artiskill.sensors.scene_tables import SceneTables
from artiskill.sensors.scratch import BAND_ROWS, Drawing, Scratch, drawing_of
from artiskill.sensors.segmentation import mask_runs, weave_channels
from artiskill.sensors.shade_fast import set_up_faces


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
        weave_channels(rows * width, scratch.rgb, scratch.depth, rgb[top : top + rows], depth[top : top + rows])
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
