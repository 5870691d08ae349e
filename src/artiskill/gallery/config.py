"""Gallery configuration: how pictures are taken and how large they are."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from artiskill.assets.articulated_object import CATEGORIES
from artiskill.config import CONFIG_DIR, check, check_value, load_config


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
    """The values of configs/gallery.yaml, with overrides such as `{"steps": 3}`.

    Raises:
        ConfigError: an unknown key or an illegal value.
    """
    return load_config(GalleryConfig, CONFIG_DIR / "gallery.yaml", overrides or {})
