"""Several pictures as one: beside and below each other, with white between them."""

from collections.abc import Sequence

import numpy as np
from PIL import Image

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
