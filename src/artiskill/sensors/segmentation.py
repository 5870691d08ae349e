"""Masks: which pixels belong to which part, by tables over the visuals that are made once per episode's target."""

import numpy as np

from artiskill.errors import ConfigError
from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.backdrop import FLOOR
from artiskill.sensors.lanes import LANES, equal_lanes, weave_lanes, weave_pixels

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
        count = equal_lanes(geom, i) if i + LANES <= pixels else 1
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
def weave_channels(pixels: int, rgb: Array, depth: Array, rgb_out: Array, depth_out: Array) -> None:
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
        weave_lanes(depth_out, 3 * done, depth, done, stride + done, 2 * stride + done)
        weave_pixels(rgb_out, done, rgb, done, stride + done, 2 * stride + done)
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
    weave_channels(pixels, colours, depths, rgb_out, depth_out)
    masks = seg_out.reshape(pixels, cameras, seg_out.shape[3])
    for camera in range(cameras):
        write_masks(geom[camera].reshape(-1), codes, masks[:, camera])
