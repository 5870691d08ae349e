"""What pictures look like: lights, shadows, floor and background (values: configs/render.yaml)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from artiskill.config import CONFIG_DIR, check, check_vector, from_layers, load_yaml, merge_overrides
from artiskill.errors import shown

QUALITIES = ("picture", "fast")
_FILE = CONFIG_DIR / "render.yaml"


@dataclass(frozen=True)
class SunConfig:
    """A directional light.

    Attributes:
        azimuth_deg: direction in which the sun stands, counter-clockwise from +x.
        elevation_deg: above the horizon, in (0, 90].
        colour: linear RGB.
        strength: factor on the colour.
    """

    azimuth_deg: float
    elevation_deg: float
    colour: tuple[float, ...]
    strength: float

    def __post_init__(self) -> None:
        check(math.isfinite(self.azimuth_deg), f"azimuth_deg must be finite, not {self.azimuth_deg}")
        check(0 < self.elevation_deg <= 90, f"elevation_deg must lie in (0, 90], not {self.elevation_deg}")
        _check_colour("colour", self.colour)
        _check_not_negative("strength", self.strength)

    @property
    def direction_w(self) -> tuple[float, float, float]:
        """Unit vector that points at the sun."""
        azimuth, elevation = math.radians(self.azimuth_deg), math.radians(self.elevation_deg)
        return (
            math.cos(elevation) * math.cos(azimuth),
            math.cos(elevation) * math.sin(azimuth),
            math.sin(elevation),
        )


@dataclass(frozen=True)
class LampConfig:
    """A point light. Lamps throw no shadows; at `fast` quality faces take their light at the corners only.

    Attributes:
        position_w: (x, y, z) in the world.
        colour: linear RGB.
        strength: factor on the colour; the light on a surface that faces the lamp 1 m away.
        range_m: the light falls with the square of the distance, and is gone here.
    """

    position_w: tuple[float, ...]
    colour: tuple[float, ...]
    strength: float
    range_m: float

    def __post_init__(self) -> None:
        check_vector(self, "position_w")
        _check_colour("colour", self.colour)
        _check_not_negative("strength", self.strength)
        check(0 < self.range_m < math.inf, f"range_m must be positive and finite, not {self.range_m}")


@dataclass(frozen=True)
class AmbientConfig:
    """Hemisphere light: what comes from above and what the ground throws back.

    Attributes:
        sky: linear RGB on a surface that faces up.
        ground: linear RGB on a surface that faces down.
    """

    sky: tuple[float, ...]
    ground: tuple[float, ...]

    def __post_init__(self) -> None:
        _check_colour("sky", self.sky)
        _check_colour("ground", self.ground)


@dataclass(frozen=True)
class ShadowConfig:
    """Shadows of the sun, in pictures only.

    Attributes:
        enabled: whether there are shadows.
        resolution: texels along each side of the shadow map, 64 to 4096.
        softness_m: width of the soft edge.
    """

    enabled: bool
    resolution: int
    softness_m: float

    def __post_init__(self) -> None:
        check(64 <= self.resolution <= 4096, f"resolution must lie in [64, 4096], not {self.resolution}")
        _check_not_negative("softness_m", self.softness_m)


@dataclass(frozen=True)
class OcclusionConfig:
    """Ambient occlusion, in pictures only: shadows of the sky, from a few directions with wide soft edges.

    Attributes:
        enabled: whether there is occlusion.
        resolution: texels along each side of a direction's shadow map, 64 to 4096.
        softness_m: width of the soft edges.
        strength: how much of the ambient light hiding from the whole sky takes away, in [0, 1].
    """

    enabled: bool
    resolution: int
    softness_m: float
    strength: float

    def __post_init__(self) -> None:
        check(64 <= self.resolution <= 4096, f"resolution must lie in [64, 4096], not {self.resolution}")
        _check_not_negative("softness_m", self.softness_m)
        check(0 <= self.strength <= 1, f"strength must lie in [0, 1], not {self.strength}")


@dataclass(frozen=True)
class FloorConfig:
    """The ground plane z = 0, seen from above only.

    Attributes:
        enabled: whether there is a floor.
        colour: linear RGB.
        tile_m: side of the checker's squares; in pictures only.
        contrast: of the checker, in [0, 1].
        fade_start_m: where the floor begins to melt into the horizon, metres from the camera.
        fade_end_m: where it has melted, metres from the camera.
    """

    enabled: bool
    colour: tuple[float, ...]
    tile_m: float
    contrast: float
    fade_start_m: float
    fade_end_m: float

    def __post_init__(self) -> None:
        _check_colour("colour", self.colour)
        check(self.tile_m > 0, f"tile_m must be positive, not {self.tile_m}")
        check(0 <= self.contrast <= 1, f"contrast must lie in [0, 1], not {self.contrast}")
        check(
            0 <= self.fade_start_m < self.fade_end_m,
            f"0 <= fade_start_m < fade_end_m must hold, not {self.fade_start_m} and {self.fade_end_m}",
        )


@dataclass(frozen=True)
class BackgroundConfig:
    """What is seen where nothing is hit; sRGB as it shall appear on the screen, in [0, 1].

    Attributes:
        horizon: colour level with the camera and below; also the plain background of `fast`.
        zenith: colour straight up.
    """

    horizon: tuple[float, ...]
    zenith: tuple[float, ...]

    def __post_init__(self) -> None:
        _check_colour("horizon", self.horizon)
        _check_colour("zenith", self.zenith)
        check(max(*self.horizon, *self.zenith) <= 1, "background colours must lie in [0, 1]")


@dataclass(frozen=True)
class RenderConfig:
    """How a `Renderer` draws.

    Attributes:
        quality: `picture` (per-pixel light, shadows, antialiasing; for people) or `fast` (light per corner, one
            sample per pixel; for observations). Depth, positions and ids are the same in both.
        crease_angle_deg: edges flatter than this look smooth, [0, 180].
        max_texture_px: larger textures are shrunk to this side length.
        samples_per_axis: antialiasing of pictures: its square is the number of samples per pixel, 1 to 4.
        exposure: factor on all light before tone mapping.
        sun: the directional light.
        lamps: point lights, any number.
        ambient: the hemisphere light.
        shadows: of the sun; in pictures only.
        occlusion: of the sky; in pictures only.
        floor: the ground plane.
        background: behind everything.
    """

    quality: Literal["picture", "fast"]
    crease_angle_deg: float
    max_texture_px: int
    samples_per_axis: int
    exposure: float
    sun: SunConfig
    lamps: tuple[LampConfig, ...]
    ambient: AmbientConfig
    shadows: ShadowConfig
    occlusion: OcclusionConfig
    floor: FloorConfig
    background: BackgroundConfig

    def __post_init__(self) -> None:
        check(
            self.quality in QUALITIES, f"quality must be one of {', '.join(QUALITIES)}, not {shown(self.quality)}"
        )
        check(
            0 <= self.crease_angle_deg <= 180,
            f"crease_angle_deg must lie in [0, 180], not {self.crease_angle_deg}",
        )
        check(self.max_texture_px >= 1, f"max_texture_px must be at least 1, not {self.max_texture_px}")
        check(1 <= self.samples_per_axis <= 4, f"samples_per_axis must lie in [1, 4], not {self.samples_per_axis}")
        _check_not_negative("exposure", self.exposure)


def load_render_config(quality: str = "picture", overrides: Mapping[str, Any] | None = None) -> RenderConfig:
    """The values of configs/render.yaml at the chosen quality, with overrides such as `{"sun.strength": 1.0}`.

    Raises:
        ConfigError: an unknown key, an illegal value, or no such quality.
    """
    return from_layers(RenderConfig, lambda given: render_mapping(quality, given), overrides, _FILE.name)


def render_mapping(quality: str, overrides: Any = None) -> Any:
    """The plain values that `load_render_config` reads; overrides that are no mapping come back as they are."""
    if overrides is not None and not isinstance(overrides, Mapping):
        return overrides  # for `from_mapping` to refuse
    return merge_overrides(load_yaml(_FILE) | {"quality": quality}, overrides or {})


def _check_colour(name: str, colour: tuple[float, ...]) -> None:
    legal = len(colour) == 3 and all(0 <= c < math.inf for c in colour)
    check(legal, f"{name} must be three numbers that are not negative, not {colour}")


def _check_not_negative(name: str, value: float) -> None:
    check(0 <= value < math.inf, f"{name} must not be negative, not {value}")
