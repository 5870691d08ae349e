"""Point clouds and masks."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from artiskill.errors import ConfigError
from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.camera import Camera, View, Views
from artiskill.sensors.drawing.backdrop import FLOOR
from artiskill.sensors.drawing.buffers import Drawing, Scratch, drawing_of
from artiskill.sensors.drawing.fast_shading import SEEN, UNSEEN, paint_pixel, set_up_faces
from artiskill.sensors.drawing.render import Poses, draw_view, forget_faces
from artiskill.sensors.drawing.scene_tables import SceneTables
from artiskill.sensors.drawing.shading import Lights
from artiskill.sensors.drawing.simd import LANES, count_equal_simd, fill, interleave_floats, interleave_pixels

# ids start at `FLOOR`: the rows of a table are floor, nothing, visual 0, visual 1, ...
FIRST_ID = FLOOR
MOST_MASKS = 7  # one bit of a byte each, the eighth says whether a point counts at all
COUNTS = np.uint8(128)


def mask_codes(masks: np.ndarray) -> np.ndarray:
    """A byte by visual id minus `FIRST_ID`: bit i stands for mask i. (k, G) bool -> (G + 2,) uint8.

    Floor and nothing belong to no mask.

    Raises:
        ConfigError: more masks than `MOST_MASKS`.
    """
    count, visuals = masks.shape
    if count > MOST_MASKS:
        raise ConfigError(f"at most {MOST_MASKS} masks, not {count}")
    codes = np.zeros(visuals - FIRST_ID, dtype=np.uint8)
    codes[-FIRST_ID:] = (masks * np.left_shift(1, np.arange(count))[:, None]).sum(axis=0)
    return codes


@kernel
def write_masks(geom: Array, codes: Array, seg: Array) -> None:
    """Masks of a camera's pixels: (P,) ids, (P, k) bool, False to begin with: most pixels lie in no mask."""
    pixels = geom.shape[0]
    i = 0
    while i < pixels:
        count = count_equal_simd(geom, i) if i + LANES <= pixels else 1
        code = codes[geom[i] - FIRST_ID]
        if code:
            for j in range(i, i + count):
                for k in range(seg.shape[1]):
                    seg[j, k] = (code >> k) & 1
        i += count


@kernel
def masks_of_points(pixels: Array, classes: Array, seg: Array) -> None:
    """Masks of pixels (M,) from the bytes (P,) of all of them, see `classify_pixels`; seg (M, k) bool written."""
    for i in range(pixels.shape[0]):
        for k in range(seg.shape[1]):
            seg[i, k] = (classes[pixels[i]] >> k) & 1


@kernel
def mask_runs(runs: Array, triangle: Array, face_geom: Array, codes: Array, seg: Array) -> None:
    """Masks of a camera's pixels, where they show faces.

    Args:
        runs: (R, 2) of the view, see `list_runs`.
        triangle: (H, W) int32 faces.
        face_geom: (F,) visual of each face.
        codes: (G + 2,) uint8, see `mask_codes`.
        seg: (P, k) bool, False to begin with; written where a pixel lies in a mask.
    """
    faces = triangle.reshape(-1)
    for i in range(runs.shape[0]):
        first = runs[i, 0]
        code = codes[face_geom[faces[first]] - FIRST_ID]
        if code:
            for j in range(first, first + runs[i, 1]):
                for k in range(seg.shape[1]):
                    seg[j, k] = (code >> k) & 1


@kernel
def interleave_channels(pixels: int, rgb: Array, depth: Array, rgb_out: Array, depth_out: Array) -> None:
    """Images one behind the other to channels: all of a camera's together, camera by camera.

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
def write_channels(
    rgb: Array, depth: Array, geom: Array, codes: Array, rgb_out: Array, depth_out: Array, seg_out: Array
) -> None:
    """Images and masks of all cameras to channels.

    Args:
        rgb: (C, H, W, 3) uint8.
        depth: (C, H, W) float32.
        geom: (C, H, W) int32 visual ids.
        codes: (G + 2,) uint8, see `mask_codes`.
        rgb_out: (H, W, C, 3) written.
        depth_out: (H, W, C) written.
        seg_out: (H, W, C, k) bool, False to begin with; written where a pixel lies in a mask.
    """
    cameras, pixels = geom.shape[0], geom.shape[1] * geom.shape[2]
    colours, depths = rgb.reshape(cameras, pixels, 3), depth.reshape(cameras, pixels)
    interleave_channels(pixels, colours, depths, rgb_out, depth_out)
    masks = seg_out.reshape(pixels, cameras, seg_out.shape[3])
    for camera in range(cameras):
        write_masks(geom[camera].reshape(-1), codes, masks[:, camera])


# Points up to this height are ground for down-sampling, as in the benchmark's baselines.
GROUND_HEIGHT_M = 1e-3


class Rays(NamedTuple):
    """What takes pixels to points.

    Attributes:
        position: (C, 3) float64 optical centres, world.
        rotation: (C, 3, 3) float64, columns are the cameras' right, up and backward directions.
        ups: (H,) float64 how far above the optical axis each row lies, at depth 1.
        rights: (W,) float32 how far to the right of it each column lies, at depth 1.
    """

    position: Array
    rotation: Array
    ups: Array
    rights: Array


def rays_of(cameras: Sequence[Camera]) -> Rays:
    """The rays of cameras that share a lens."""
    focal, centre_x, centre_y = cameras[0].lens()[:3].tolist()
    return Rays(
        np.stack([camera.position_w for camera in cameras]),
        np.stack([camera.rotation_w for camera in cameras]),
        (centre_y - 0.5 - np.arange(cameras[0].height)) / focal,
        ((np.arange(cameras[0].width) + 0.5 - centre_x) / focal).astype(np.float32),
    )


@kernel
def row_ray(rays: Rays, camera: int, row: int, k: int) -> tuple[Any, Any, Any]:
    """What a row's pixels share, coordinate k: direction of its middle ray, of the row itself, and the origin."""
    r = rays.rotation
    ray = r[camera, k, 1] * rays.ups[row] - r[camera, k, 2]
    return np.float32(ray), np.float32(r[camera, k, 0]), np.float32(rays.position[camera, k])


@kernel
def unproject(depth: Any, right: Any, ray: Any, along_row: Any, origin: Any) -> Any:
    """One world coordinate of what a pixel sees; all float32, `right` of `Rays`, the last three of `row_ray`."""
    return depth * (ray + right * along_row) + origin


@kernel
def unproject_row(depth: Array, rights: Array, ray: Any, along: Any, origin: Any, out: Array) -> None:
    """One coordinate of all points of a row, (W,), 0 where nothing is seen; plain enough to be vectorised."""
    for column in range(depth.shape[0]):
        d = depth[column]
        from_origin = origin if d > 0.0 else np.float32(0.0)
        out[column] = unproject(d, rights[column], ray, along, from_origin)


@kernel
def unproject_rows(depth: Array, rays: Rays, camera: int, top: int, xyz: Array) -> None:
    """All points of some rows of a camera: depths (R, W) from row `top` on, to (R, W, 3) float32 world."""
    rows, width = depth.shape
    rights = rays.rights
    line = np.empty((3, width), dtype=np.float32)
    for row in range(rows):
        for k in range(3):
            ray, along, origin = row_ray(rays, camera, top + row, k)
            unproject_row(depth[row], rights, ray, along, origin, line[k])
        start, done = 3 * width * row, 0
        while done + LANES <= width:
            interleave_floats(xyz, start + 3 * done, line, done, width + done, 2 * width + done)
            done += LANES
        for column in range(done, width):
            for k in range(3):
                xyz[row, column, k] = line[k, column]


@kernel
def write_cloud(depth: Array, geom: Array, codes: Array, rays: Rays, xyz: Array, seg: Array) -> None:
    """All points and their masks.

    Args:
        depth: (C, H, W) float32 metres.
        geom: (C, H, W) int32 visual ids.
        codes: (G + 2,) uint8, see `mask_codes`.
        rays: of the cameras.
        xyz: (C, H, W, 3) float32 world, written; the world's origin where nothing is seen.
        seg: (C, H, W, k) bool, False to begin with; written where a point lies in a mask.
    """
    for camera in range(depth.shape[0]):
        unproject_rows(depth[camera], rays, camera, 0, xyz[camera])
    write_masks(geom.reshape(-1), codes, seg.reshape(-1, seg.shape[3]))


@kernel
def classify_pixels(depth: Array, geom: Array, codes: Array, rays: Rays, out: Array) -> None:
    """A byte per pixel: its masks' bits, and `COUNTS` where it sees something above the ground.

    Args:
        depth: (C, H, W) float32 metres.
        geom: (C, H, W) int32 visual ids.
        codes: (G + 2,) uint8, see `mask_codes`.
        rays: of the cameras.
        out: (C, H, W) uint8, written; 0 for ground and nothing.
    """
    ground = np.float32(GROUND_HEIGHT_M)
    cameras, height, width = depth.shape
    line = np.empty(width, dtype=np.float32)
    for camera in range(cameras):
        for row in range(height):
            ray, along, origin = row_ray(rays, camera, row, 2)
            unproject_row(depth[camera, row], rays.rights, ray, along, origin, line)
            for column in range(width):
                visual = geom[camera, row, column]
                code = np.uint8(0)
                if visual >= 0 and line[column] > ground:
                    code = codes[visual - FIRST_ID] | COUNTS
                out[camera, row, column] = code


@kernel
def points_of_pixels(depth: Array, chosen: Array, rays: Rays, xyz: Array) -> None:
    """World positions of pixels that see something, by their index in the full cloud. (M,) -> (M, 3) float32."""
    height, width = depth.shape[1], depth.shape[2]
    for i in range(chosen.shape[0]):
        image, column = chosen[i] // width, chosen[i] % width
        camera, row = image // height, image % height
        d, right = depth[camera, row, column], rays.rights[column]
        for k in range(3):
            ray, along, origin = row_ray(rays, camera, row, k)
            xyz[i, k] = unproject(d, right, ray, along, origin)


@kernel
def classify_points(xyz: Array, seg: Array, out: Array) -> None:
    """`classify_pixels` for clouds that exist already: (N, 3), (N, k) -> (N,) uint8."""
    ground = np.float32(GROUND_HEIGHT_M)
    for i in range(xyz.shape[0]):
        code = np.uint8(0)
        if xyz[i, 2] > ground:
            code = COUNTS
            for k in range(seg.shape[1]):
                if seg[i, k]:
                    code |= np.uint8(1 << k)
        out[i] = code


@kernel
def move_to_frame(xyz: Array, origin: Array, rotation: Array) -> None:
    """World points to a frame, in place: (M, 3), the frame's origin (3,) and axes as columns (3, 3)."""
    for i in range(xyz.shape[0]):
        x, y, z = xyz[i, 0] - origin[0], xyz[i, 1] - origin[1], xyz[i, 2] - origin[2]
        for k in range(3):
            xyz[i, k] = np.float32(rotation[0, k] * x + rotation[1, k] * y + rotation[2, k] * z)


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
            count = min(count_equal_simd(triangle, index), end - column) if index + LANES <= triangle.size else 1
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
