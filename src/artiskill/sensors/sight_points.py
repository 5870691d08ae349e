"""Kernels that draw all cameras of one environment and look only at pixels that are asked for."""

from typing import Any

import numpy as np

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.lanes import LANES, equal_lanes
from artiskill.sensors.lighting import Lights, View
from artiskill.sensors.paint import paint_pixel
from artiskill.sensors.point_cloud import GROUND_HEIGHT_M, Rays, row_ray, unproject
from artiskill.sensors.render_views import Poses, Views, draw_view, forget_faces
from artiskill.sensors.row_fill import fill
from artiskill.sensors.runs import SEEN, UNSEEN
from artiskill.sensors.scene_tables import SceneTables
from artiskill.sensors.scratch import Drawing, Scratch, drawing_of
from artiskill.sensors.segmentation import COUNTS, FIRST_ID, masks_of_points
from artiskill.sensors.shade_fast import set_up_faces


@kernel
def classify_views(
    scene: SceneTables,
    poses: Poses,
    views: Views,
    has_floor: bool,
    codes: Array,
    rays: Rays,
    scratch: Scratch,
    out: Array,
) -> None:
    """Draw all views into their buffers, and write a byte per pixel: see `Sight.classified`."""
    fill(out.reshape(-1), np.uint8(0))
    for camera in range(out.shape[0]):
        view = View(views.positions[camera], views.rotations[camera], views.lenses[camera])
        drawing = drawing_of(scratch.drawings, camera)
        draw_view(scene, poses.positions[0], poses.rotations[0], view, has_floor, drawing, scratch)
        classify_view(camera, drawing, scene.face_geom, codes, rays, out[camera])


@kernel
def classify_view(camera: int, drawing: Drawing, face_geom: Array, codes: Array, rays: Rays, out: Array) -> None:
    """A byte per pixel of one view, 0 to begin with."""
    ground = np.float32(GROUND_HEIGHT_M)
    triangle, inverse_depth, drawn, rights = drawing.triangle, drawing.inverse_depth, drawing.drawn, rays.rights
    height, width = triangle.shape
    line = np.empty(width, dtype=np.float32)
    for row in range(height):
        column, end = drawn[row, 0], drawn[row, 1]
        ray, along, origin = row_ray(rays, camera, row, 2)
        unproject_drawn(inverse_depth[row, column:end], rights[column:end], ray, along, origin, line[column:end])
        while column < end:
            index = row * width + column
            t = triangle[row, column]
            count = min(equal_lanes(triangle, index), end - column) if index + LANES <= triangle.size else 1
            if t >= 0:
                code = codes[face_geom[t] - FIRST_ID] | COUNTS
                for i in range(column, column + count):
                    if line[i] > ground:
                        out[row, i] = code
            column += count


@kernel
def unproject_drawn(inverse_depth: Array, rights: Array, ray: Any, along: Any, origin: Any, out: Array) -> None:
    """One world coordinate of pixels of a row that see something, all (N,)."""
    for i in range(out.shape[0]):
        out[i] = unproject(np.float32(1.0) / inverse_depth[i], rights[i], ray, along, origin)


@kernel
def points_of_views(pixels: Array, rays: Rays, scratch: Scratch, xyz: Array) -> None:
    """See `Sight.positions`; the buffers are those of the latest `classify_views`."""
    inverse_depth, rights = scratch.drawings.inverse_depth, rays.rights
    height, width = inverse_depth.shape[1], inverse_depth.shape[2]
    for i in range(pixels.shape[0]):
        image, column = pixels[i] // width, pixels[i] % width
        camera, row = image // height, image % height
        depth = np.float32(1.0) / inverse_depth[camera, row, column]
        for k in range(3):
            ray, along, origin = row_ray(rays, camera, row, k)
            xyz[i, k] = unproject(depth, rights[column], ray, along, origin)


@kernel
def see_points(
    pixels: Array,
    scene: SceneTables,
    poses: Poses,
    views: Views,
    light: Lights,
    rays: Rays,
    classes: Array,
    scratch: Scratch,
    xyz: Array,
    rgb: Array,
    seg: Array,
) -> None:
    """See `Sight.points`: only the faces that these show are set up."""
    points_of_views(pixels, rays, scratch, xyz)
    masks_of_points(pixels, classes, seg)
    for camera in range(views.positions.shape[0]):
        view = View(views.positions[camera], views.rotations[camera], views.lenses[camera])
        drawing = drawing_of(scratch.drawings, camera)
        count = list_faces(camera, pixels, drawing)
        set_up_faces(count, scene, poses.rotations[0], view, light, drawing, scratch.lit)
        colour_pixels(camera, pixels, scene, view.lens, drawing, rgb)
        forget_faces(count, drawing)


@kernel
def list_faces(camera: int, pixels: Array, drawing: Drawing) -> int:
    """List the faces that pixels of one view show, each once; returns how many."""
    triangle, state, seen = drawing.triangle.reshape(-1), drawing.face_state, drawing.seen
    count = 0
    start = camera * triangle.shape[0]
    for i in range(pixels.shape[0]):
        if start <= pixels[i] < start + triangle.shape[0]:
            t = triangle[pixels[i] - start]
            if state[t] == UNSEEN:
                state[t] = SEEN
                seen[count] = t
                count += 1
    return count


@kernel
def colour_pixels(
    camera: int, pixels: Array, scene: SceneTables, lens: Array, drawing: Drawing, rgb: Array
) -> None:
    """Colours of those pixels that belong to one view, whose faces are set up."""
    triangle, inverse_depth = drawing.triangle, drawing.inverse_depth
    state, planes = drawing.face_state, drawing.face_planes
    face_geom, textures, texels = scene.face_geom, scene.textures, scene.texels
    width = triangle.shape[1]
    start = camera * triangle.size
    per_px = np.float32(1.0 / lens[0])
    centre_x, centre_y = np.float32(lens[1] - 0.5), np.float32(lens[2] - 0.5)
    for i in range(pixels.shape[0]):
        if start <= pixels[i] < start + triangle.size:
            row, column = (pixels[i] - start) // width, (pixels[i] - start) % width
            x, y = (np.float32(column) - centre_x) * per_px, (centre_y - np.float32(row)) * per_px
            z, t = np.float32(1.0) / inverse_depth[row, column], triangle[row, column]
            paint_pixel(i, x, y, z, t, state, planes, face_geom, textures, texels, rgb)
