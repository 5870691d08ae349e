"""Contact sheets: all objects of a category and split in one picture, closed and open."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

import numpy as np

from artiskill.files import atomic_write
from artiskill.gallery.config import GalleryConfig
from artiskill.gallery.facts import ObjectFacts
from artiskill.gallery.frames import read_frame

_BACKGROUND, _INK = (250, 250, 248), (40, 42, 46)
_LABEL_SHARE, _GAP = 0.13, 6  # height of a label's line, of the picture's width; pixels between pictures
_WEBP_QUALITY = 78

STATES = {"closed": 0, "open": -1}  # name -> step


def write_sheets(
    facts: Sequence[ObjectFacts], files: Sequence[Path], folder: Path, config: GalleryConfig
) -> list[Path]:
    """Write `<category>-<split>-<closed or open>.webp`.

    Args:
        facts: of the objects.
        files: their pictures, as `frames.write_frames` wrote them.
        folder: where to; it is there.
        config: sizes.
    """
    pairs = sorted(zip(facts, files, strict=True), key=lambda pair: (pair[0].category, pair[0].split, pair[0].id))
    written = []
    for (category, split), group in groupby(pairs, key=lambda pair: (pair[0].category, pair[0].split)):
        members = list(group)
        for state, step in STATES.items():
            frames = [read_frame(file, step, 0, config) for _, file in members]
            path = folder / f"{category}-{split}-{state}.webp"
            _write(contact_sheet(frames, [fact.id for fact, _ in members], config), path)
            written.append(path)
    return written


def contact_sheet(frames: Sequence[np.ndarray], labels: Sequence[str], config: GalleryConfig) -> np.ndarray:
    """Pictures in rows, each with its label below, (H, W, 3) uint8."""
    from PIL import Image, ImageDraw, ImageFont

    width = config.sheet.width
    height, line = round(width * config.height / config.width), round(width * _LABEL_SHARE)
    columns = min(config.sheet.columns, len(frames))
    rows = -(-len(frames) // columns)
    size = (columns * (width + _GAP) + _GAP, rows * (height + line + _GAP) + _GAP)
    sheet = Image.new("RGB", size, _BACKGROUND)
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=0.65 * line)
    for k, (frame, label) in enumerate(zip(frames, labels, strict=True)):
        x, y = _GAP + k % columns * (width + _GAP), _GAP + k // columns * (height + line + _GAP)
        sheet.paste(Image.fromarray(frame).resize((width, height), Image.Resampling.LANCZOS), (x, y))
        pen.text((x + width / 2, y + height + line / 2), label, _INK, font, anchor="mm")
    return np.asarray(sheet)


def _write(sheet: np.ndarray, path: Path) -> None:
    from PIL import Image

    with atomic_write(path) as temporary:
        Image.fromarray(sheet).save(temporary, format="WEBP", quality=_WEBP_QUALITY, method=4)
