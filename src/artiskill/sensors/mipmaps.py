"""Textures for the kernels: each with ever smaller versions of itself (mipmaps, Williams 1983), in one table."""

import math
from collections.abc import Sequence

import numpy as np
from PIL import Image

from artiskill.assets.articulated_object import VisualMesh

# each half as large as the one before; those that a small texture lacks repeat its smallest
MIP_LEVELS = 10


def pack_textures(visuals: Sequence[VisualMesh], max_px: int) -> tuple[np.ndarray, np.ndarray]:
    """All textures and their smaller versions; who shares an image shares its texels.

    Args:
        visuals: those with a texture and texture coordinates are textured.
        max_px: larger textures are shrunk to this side length.

    Returns:
        (G, MIP_LEVELS, 3) int64 first texel, height and width of each visual's versions, the largest first, all 0
        where it has none; (T, 3) uint8 texels.
    """
    rows = np.zeros((len(visuals), MIP_LEVELS, 3), dtype=np.int64)
    packed: dict[int, np.ndarray] = {}
    texels: list[np.ndarray] = []
    used = 0
    for geom, visual in enumerate(visuals):
        texture = visual.material.texture
        if texture is None or visual.mesh.uvs is None:
            continue
        if id(texture) not in packed:
            entry = []
            for image in _versions(texture, max_px):
                entry.append((used, image.shape[0], image.shape[1]))
                texels.append(image.reshape(-1, 3))
                used += len(texels[-1])
            entry += entry[-1:] * (MIP_LEVELS - len(entry))
            packed[id(texture)] = np.array(entry)
        rows[geom] = packed[id(texture)]
    return rows, np.ascontiguousarray(np.concatenate(texels)) if texels else np.zeros((0, 3), dtype=np.uint8)


def _versions(texture: np.ndarray, max_px: int) -> list[np.ndarray]:
    """The image at most `max_px` large, and halved until one pixel is left or the levels run out."""
    height, width = texture.shape[:2]
    scale = min(1.0, max_px / max(height, width))
    images = [_resized(texture, math.floor(height * scale), math.floor(width * scale))]
    while max(images[-1].shape[:2]) > 1 and len(images) < MIP_LEVELS:
        height, width = images[-1].shape[:2]
        images.append(_resized(images[-1], height // 2, width // 2))
    return images


def _resized(image: np.ndarray, height: int, width: int) -> np.ndarray:
    height, width = max(1, height), max(1, width)
    if image.shape[:2] == (height, width):
        return image
    return np.asarray(Image.fromarray(image).resize((width, height), Image.Resampling.BOX))
