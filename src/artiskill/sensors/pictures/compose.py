"""Pictures for people from arrays: masks over colours, depth as grey, clouds as squares, several as one."""

from collections.abc import Sequence

import numpy as np
from PIL import Image

from artiskill.sensors.camera import Camera

# Okabe and Ito's (2008), told apart by most people: vermilion, sky blue, green, yellow, blue, orange, purple
MASK_COLOURS = np.array(
    ((213, 94, 0), (86, 180, 233), (0, 158, 115), (240, 228, 66), (0, 114, 178), (230, 159, 0), (204, 121, 167)),
    dtype=np.uint8,
)
_OPACITY = 0.7
_GAMMA = 0.6  # spreads the near, which matters more
_MOST_HALF_PX = 12  # of a square: a point before the lens shall not cover the picture, nor take minutes


def paint_masks(rgb: np.ndarray, seg: np.ndarray, opacity: float = _OPACITY) -> np.ndarray:
    """Colours under masks, where they overlap the first: (..., 3) uint8 and (..., k) bool -> (..., 3) uint8."""
    painted = rgb.astype(np.float32)
    for k in reversed(range(seg.shape[-1])):
        colour = MASK_COLOURS[k % len(MASK_COLOURS)].astype(np.float32)
        painted[seg[..., k]] = (1.0 - opacity) * rgb[seg[..., k]] + opacity * colour
    return painted.round().astype(np.uint8)


def paint_depth(depth: np.ndarray, far_m: float) -> np.ndarray:
    """Depth as grey, near is bright, nothing is black: (...) metres -> (..., 3) uint8."""
    bright = 255.0 * (1.0 - np.clip(depth / far_m, 0.0, 1.0) ** _GAMMA)
    grey = np.where(depth > 0, bright, 0.0).round().astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=-1)


def draw_points(
    xyz_w: np.ndarray, rgb: np.ndarray, camera: Camera, radius_m: float = 0.006, background: int = 255
) -> np.ndarray:
    """A cloud as little squares, nearer ones over farther ones.

    Args:
        xyz_w: (N, 3) world.
        rgb: (N, 3) uint8.
        camera: where it is looked at from.
        radius_m: half the side of a square; it covers at least its own pixel, and no more than 25 each way.
        background: grey level.

    Returns:
        (H, W, 3) uint8.
    """
    picture = np.full((camera.height, camera.width, 3), background, dtype=np.uint8)
    in_camera = xyz_w @ camera.extrinsics[:3, :3].T + camera.extrinsics[:3, 3]
    depth = in_camera[:, 2]
    visible = np.flatnonzero((depth > camera.near_m) & (depth < camera.far_m))
    visible = visible[np.argsort(-depth[visible], kind="stable")]  # far ones first
    column, row = (
        (camera.focal_px * in_camera[visible, :2] / depth[visible, None]) + (camera.width / 2, camera.height / 2)
    ).T
    half = np.clip(np.round(camera.focal_px * radius_m / depth[visible]), 0, _MOST_HALF_PX).astype(int)
    most = int(half.max(initial=0))
    # squares grow from far to near, so painting them size by size keeps nearer ones on top
    for reach in range(most + 1):
        members = half == reach
        for dy in range(-reach, reach + 1):
            for dx in range(-reach, reach + 1):
                x, y = np.floor(column[members] + dx).astype(int), np.floor(row[members] + dy).astype(int)
                inside = (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)
                picture[y[inside], x[inside]] = rgb[visible[members][inside]]
    return picture


GAP_PX = 6


def beside(pictures: Sequence[np.ndarray]) -> np.ndarray:
    """Pictures (H, W_i, 3) uint8 of one height, left to right."""
    gap = np.full((pictures[0].shape[0], GAP_PX, 3), 255, dtype=np.uint8)
    parts = [part for picture in pictures for part in (picture, gap)]
    return np.concatenate(parts[:-1], axis=1)


def below(pictures: Sequence[np.ndarray]) -> np.ndarray:
    """Pictures (H_i, W, 3) uint8 of one width, top to bottom."""
    return beside([picture.swapaxes(0, 1) for picture in pictures]).swapaxes(0, 1)


def of_width(picture: np.ndarray, width: int) -> np.ndarray:
    """A picture enlarged or shrunk to a width, its proportions kept."""
    if picture.shape[1] == width:
        return picture
    height = max(1, round(picture.shape[0] * width / picture.shape[1]))
    return np.asarray(Image.fromarray(np.ascontiguousarray(picture)).resize((width, height), Image.Resampling.BOX))
