"""Materials: woods with a generated grain, paints and metals, drawn per object.

Palettes are sRGB triples as one would read them off a photograph; `Material` holds linear colours.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from artiskill.assets.articulated_object import Material

# A grain texture covers this square of wood, so that no panel of a cabinet needs it to repeat.
GRAIN_TILE_M = 1.28
_GRAIN_PIXELS = (192, 48)  # across and along the grain
_GRAIN_SEEDS = 2**31

Finish = Literal["wood", "paint", "metal"]

# Light and dark sRGB of common furniture woods.
WOODS: dict[str, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    "birch": ((228, 205, 168), (205, 176, 132)),
    "beech": ((214, 178, 142), (186, 146, 110)),
    "oak": ((202, 170, 130), (164, 128, 90)),
    "ash": ((222, 204, 174), (186, 162, 128)),
    "pine": ((226, 196, 152), (198, 158, 108)),
    "cherry": ((160, 106, 80), (124, 76, 56)),
    "teak": ((164, 122, 86), (120, 84, 56)),
    "walnut": ((118, 82, 56), (74, 48, 32)),
    "wenge": ((78, 60, 50), (46, 34, 28)),
}
PAINTS: dict[str, tuple[int, int, int]] = {
    "white": (240, 240, 236),
    "cream": (234, 226, 206),
    "light_grey": (200, 202, 202),
    "stone": (172, 166, 154),
    "anthracite": (66, 70, 74),
    "black": (38, 38, 40),
    "sage": (142, 160, 136),
    "forest": (56, 86, 66),
    "navy": (48, 66, 96),
    "duck_egg": (164, 196, 194),
    "mustard": (206, 162, 66),
    "brick": (166, 78, 60),
    "blush": (222, 184, 174),
}
METALS: dict[str, tuple[tuple[int, int, int], float]] = {  # sRGB and shininess
    "brushed_steel": ((176, 178, 180), 0.6),
    "chrome": ((214, 216, 220), 0.9),
    "brass": ((194, 156, 88), 0.7),
    "copper": ((184, 116, 84), 0.7),
    "black_iron": ((44, 44, 46), 0.4),
    "nickel": ((168, 164, 156), 0.7),
}
# Which finishes carcass, fronts and top have together, with how often.
_SCHEMES: tuple[tuple[float, tuple[Finish, Finish, Finish]], ...] = (
    (0.35, ("wood", "wood", "wood")),
    (0.25, ("paint", "paint", "paint")),
    (0.15, ("paint", "paint", "wood")),
    (0.15, ("wood", "paint", "wood")),
    (0.10, ("paint", "wood", "wood")),
)


@dataclass(frozen=True)
class Surface:
    """One resolved finish.

    Attributes:
        finish: which palette.
        name: its key there.
        srgb: base colour, 0..255, after the object's own variation.
        grain_seed: seeds the grain of a wood; 0 otherwise.
        shininess: 0 (matt) to 1 (polished).
    """

    finish: Finish
    name: str
    srgb: tuple[int, int, int]
    grain_seed: int
    shininess: float


@dataclass(frozen=True)
class CabinetAppearance:
    """The surfaces of one cabinet."""

    carcass: Surface
    front: Surface
    top: Surface
    interior: Surface
    support: Surface
    handle: Surface
    runner: Surface


def sample_cabinet_appearance(rng: np.random.Generator) -> CabinetAppearance:
    """Draw surfaces that go together: parts of one finish share one wood or one paint, or are two-toned."""
    weights = np.array([w for w, _ in _SCHEMES])
    carcass_finish, front_finish, top_finish = _SCHEMES[int(rng.choice(len(_SCHEMES), p=weights / weights.sum()))][
        1
    ]
    carcass = sample_surface(rng, carcass_finish)
    two_toned = carcass_finish != front_finish or rng.random() < 0.15
    front = sample_surface(rng, front_finish) if two_toned else carcass
    top = sample_surface(rng, top_finish) if top_finish != carcass_finish or rng.random() < 0.25 else carcass
    interior = sample_surface(rng, "wood", ("birch", "beech", "pine")) if rng.random() < 0.6 else _white(rng)
    handle = (
        sample_surface(rng, "metal") if rng.random() < 0.85 else sample_surface(rng, "paint", ("white", "black"))
    )
    support = carcass if rng.random() < 0.7 else sample_surface(rng, "metal", ("brushed_steel", "black_iron"))
    return CabinetAppearance(
        carcass, front, top, interior, support, handle, sample_surface(rng, "metal", ("brushed_steel",))
    )


def sample_surface(rng: np.random.Generator, finish: Finish, names: tuple[str, ...] = ()) -> Surface:
    """Draw a surface of a finish, its colour a little off the palette's; `names` restricts the choice."""
    palette = {"wood": tuple(WOODS), "paint": tuple(PAINTS), "metal": tuple(METALS)}[finish]
    legal = names or palette
    name = legal[int(rng.integers(len(legal)))]
    brightness, tint = rng.uniform(0.94, 1.04), rng.uniform(-5, 5, 3)
    if finish == "wood":
        base, seed, shininess = WOODS[name][0], int(rng.integers(1, _GRAIN_SEEDS)), float(rng.uniform(0.1, 0.35))
    elif finish == "paint":
        base, seed, shininess = PAINTS[name], 0, float(rng.uniform(0.05, 0.5))
    else:
        (base, shininess), seed = METALS[name], 0
    srgb = tuple(int(v) for v in np.clip(np.round(np.array(base) * brightness + tint), 0, 255))
    return Surface(finish, name, (srgb[0], srgb[1], srgb[2]), seed, round(shininess, 3))


def make_material(surface: Surface) -> Material:
    """The engine-free material of a surface; woods come with their grain."""
    linear = srgb_to_linear(np.array(surface.srgb))
    red, green, blue = (round(float(v), 4) for v in linear)
    texture = wood_grain(surface.name, surface.grain_seed) if surface.finish == "wood" else None
    return Material(surface.name, (red, green, blue, 1.0), texture, surface.shininess)


def wood_grain(name: str, seed: int) -> np.ndarray:
    """A texture that darkens a wood's base colour along streaks.

    Texture coordinate u runs along the grain, v across it; the image covers `GRAIN_TILE_M` either way.

    Args:
        name: a key of `WOODS`.
        seed: of the streaks.

    Returns:
        (H, W, 3) uint8 sRGB, 255 where the base colour is left as it is.
    """
    rng = np.random.default_rng(seed)
    across, along = _GRAIN_PIXELS
    rings = _noise(rng, (across, along), (24, 3))  # broad figure
    fibres = _noise(rng, (across, along), (across, 6))  # fine streaks
    amount = np.clip(0.65 * rings + 0.35 * fibres, 0.0, 1.0)[..., None]
    light, dark = (np.array(rgb, dtype=float) for rgb in WOODS[name])
    return np.round(255 * (1 - amount * (1 - dark / light))).astype(np.uint8)


def srgb_to_linear(srgb: np.ndarray) -> np.ndarray:
    """Decode sRGB values 0..255 to linear intensities 0..1 (IEC 61966-2-1)."""
    c = np.asarray(srgb, dtype=float) / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def _white(rng: np.random.Generator) -> Surface:
    return sample_surface(rng, "paint", ("white",))


def _noise(rng: np.random.Generator, shape: tuple[int, int], cells: tuple[int, int]) -> np.ndarray:
    """Smooth noise in [0, 1] with so many cells along each side, interpolated linearly."""
    coarse = rng.random((cells[0] + 1, cells[1] + 1))
    for axis in (0, 1):
        at = np.linspace(0, cells[axis], shape[axis])
        low = np.minimum(at.astype(int), cells[axis] - 1)
        blend = (at - low).reshape((-1, 1) if axis == 0 else (1, -1))
        coarse = np.take(coarse, low, axis) * (1 - blend) + np.take(coarse, low + 1, axis) * blend
    return coarse
