"""Pictures of objects: from closed to open in one file per object, contact sheets, and their configuration."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from artiskill.assets.articulated_object import CATEGORIES, ArticulatedObject
from artiskill.config import CONFIG_DIR, check, check_value, load_config
from artiskill.files import atomic_write
from artiskill.gallery.facts import ObjectFacts
from artiskill.sensors.pictures.objects import ObjectView, OrbitView
from artiskill.sensors.render_config import load_render_config

_WEBP_EFFORT = 5  # of WebP's encoder, 0 to 6
_BACKGROUND, _INK = (250, 250, 248), (40, 42, 46)
_LABEL_SHARE, _GAP = 0.13, 6  # height of a label's line, of the picture's width; pixels between pictures
_SHEET_QUALITY = 78
STATES = {"closed": 0, "open": -1}  # name -> step


@dataclass(frozen=True)
class ViewConfig:
    """Where a camera stands; it comes as near as it can.

    Attributes:
        azimuth_deg: counter-clockwise from +x seen from above.
        elevation_deg: above the horizon.
    """

    azimuth_deg: float
    elevation_deg: float


@dataclass(frozen=True)
class SheetConfig:
    """Contact sheets.

    Attributes:
        columns: pictures in a row.
        width: of a picture, pixels.
    """

    columns: int = 8
    width: int = 200

    def __post_init__(self) -> None:
        check_value(self, "columns", self.columns >= 1, "must be at least 1")
        check_value(self, "width", self.width >= 16, "must be at least 16")


@dataclass(frozen=True)
class GalleryConfig:
    """Pictures of one object: `steps` from closed to open, each from every view.

    Attributes:
        width: of a picture, pixels.
        height: of a picture, pixels.
        steps: from closed to open, at least 2.
        webp_quality: 1 to 100.
        endless_turn: how much of a turn joints without limits make on the way.
        views: per category; each category has as many.
        look: over configs/render.yaml.
        sheet: contact sheets.
    """

    width: int
    height: int
    steps: int
    webp_quality: int
    endless_turn: float
    views: Mapping[str, tuple[ViewConfig, ...]]
    look: Mapping[str, Any] = field(default_factory=dict)
    sheet: SheetConfig = SheetConfig()

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            check_value(self, name, getattr(self, name) >= 16, "must be at least 16")
        check_value(self, "steps", self.steps >= 2, "must be at least 2")
        check_value(self, "webp_quality", 1 <= self.webp_quality <= 100, "must lie in [1, 100]")
        check_value(self, "endless_turn", 0 <= self.endless_turn <= 1, "must lie in [0, 1]")
        counts = {category: len(self.views.get(category, ())) for category in CATEGORIES}
        legal = set(self.views) == set(CATEGORIES) and len(set(counts.values())) == 1 and min(counts.values()) > 0
        check(legal, f"views must name as many views, at least one, for each of {', '.join(CATEGORIES)}: {counts}")


def load_gallery_config(overrides: Mapping[str, Any] | None = None) -> GalleryConfig:
    """Load configs/gallery.yaml, with overrides such as `{"steps": 3}`.

    Raises:
        ConfigError: an unknown key or an illegal value.
    """
    return load_config(GalleryConfig, CONFIG_DIR / "gallery.yaml", overrides or {})


def draw_frames(obj: ArticulatedObject, config: GalleryConfig) -> np.ndarray:
    """Draw all pictures of an object, (views * height, steps * width, 3) uint8.

    All steps of a view are seen by one camera, which sees the object whole in each of them.
    """
    view = ObjectView(obj, load_render_config(overrides=config.look))
    shares = joint_shares(obj, config)
    rows = []
    for place in config.views[obj.category]:
        direction = OrbitView(config.width, config.height, place.azimuth_deg, place.elevation_deg)
        camera = view.camera(list(shares), direction)
        rows.append(np.concatenate([view.draw(share, camera) for share in shares], axis=1))
    return np.concatenate(rows, axis=0)


def joint_shares(obj: ArticulatedObject, config: GalleryConfig) -> np.ndarray:
    """Return the share of each joint's range at each step, (steps, J): from 0 to 1, to less for endless joints."""
    reach = [1.0 if np.isfinite(joint.limits).all() else config.endless_turn for joint in obj.joints]
    return np.outer(np.linspace(0.0, 1.0, config.steps), reach)


def frames_name(obj: ArticulatedObject, config: GalleryConfig) -> str:
    """Return the file's name, with a hash of the object and the settings of its pictures."""
    settings = asdict(config) | {"sheet": None, "render": asdict(load_render_config(overrides=config.look))}
    text = json.dumps([obj.content_hash, settings], sort_keys=True, default=dict)
    return f"{obj.id}.{hashlib.sha256(text.encode()).hexdigest()[:10]}.webp"


def write_frames(frames: np.ndarray, path: Path, config: GalleryConfig) -> None:
    """Write the image; it appears whole or not at all."""
    with atomic_write(path) as temporary:
        Image.fromarray(frames).save(temporary, format="WEBP", quality=config.webp_quality, method=_WEBP_EFFORT)


def read_frame(path: Path, step: int, view: int, config: GalleryConfig) -> np.ndarray:
    """Read one of the pictures in a file, (height, width, 3) uint8; a negative step counts from the end."""
    column = step % config.steps
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB"))
    rows = slice(view * config.height, (view + 1) * config.height)
    return pixels[rows, column * config.width : (column + 1) * config.width]


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
    """Arrange pictures in rows, each with its label below, (H, W, 3) uint8."""
    width = config.sheet.width
    height, line = round(width * config.height / config.width), round(width * _LABEL_SHARE)
    columns = min(config.sheet.columns, len(frames))
    rows = -(-len(frames) // columns)
    size = (columns * (width + _GAP) + _GAP, rows * (height + line + _GAP) + _GAP)
    sheet = Image.new("RGB", size, _BACKGROUND)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=0.65 * line)
    for k, (frame, label) in enumerate(zip(frames, labels, strict=True)):
        x, y = _GAP + k % columns * (width + _GAP), _GAP + k // columns * (height + line + _GAP)
        sheet.paste(Image.fromarray(frame).resize((width, height), Image.Resampling.LANCZOS), (x, y))
        draw.text((x + width / 2, y + height + line / 2), label, _INK, font, anchor="mm")
    return np.asarray(sheet)


def _write(sheet: np.ndarray, path: Path) -> None:
    with atomic_write(path) as temporary:
        Image.fromarray(sheet).save(temporary, format="WEBP", quality=_SHEET_QUALITY, method=4)
