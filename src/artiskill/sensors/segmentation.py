"""Masks: which pixels belong to which part, by tables over the visuals that are made once per episode's target."""

import numpy as np

from artiskill.errors import ConfigError
from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.rasterise import FLOOR

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
    """Masks of a row of pixels: (W,) ids, (W, k) bool, False to begin with: most pixels lie in no mask."""
    for column in range(geom.shape[0]):
        code = codes[geom[column] - FIRST_ID]
        if code:
            for k in range(seg.shape[1]):
                seg[column, k] = (code >> k) & 1


@kernel
def write_channels(
    rgb: Array, depth: Array, geom: Array, codes: Array, rgb_out: Array, depth_out: Array, seg_out: Array
) -> None:
    """Images one behind the other to channels: all of a camera's together, camera by camera.

    Args:
        rgb: (C, H, W, 3) uint8.
        depth: (C, H, W) float32.
        geom: (C, H, W) int32 visual ids.
        codes: (G + 2,) uint8, see `mask_codes`.
        rgb_out: (H, W, C, 3) written.
        depth_out: (H, W, C) written.
        seg_out: (H, W, C, k) bool, False to begin with; written where a pixel lies in a mask.
    """
    for row in range(geom.shape[1]):
        for camera in range(geom.shape[0]):
            for column in range(geom.shape[2]):
                rgb_out[row, column, camera, 0] = rgb[camera, row, column, 0]
                rgb_out[row, column, camera, 1] = rgb[camera, row, column, 1]
                rgb_out[row, column, camera, 2] = rgb[camera, row, column, 2]
            for column in range(geom.shape[2]):
                depth_out[row, column, camera] = depth[camera, row, column]
            write_masks(geom[camera, row], codes, seg_out[row, :, camera])
