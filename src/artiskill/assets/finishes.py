"""Finishes: woods with a generated grain, woven fabrics, paints, plastics and metals, drawn per object.

Palettes are sRGB triples as one would read them off a photograph; `Material` holds linear colours.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np

from artiskill.assets.articulated_object import Material
from artiskill.geometry.arrays import power

# A grain texture covers this square of wood, so that no panel of a cabinet needs it to repeat.
GRAIN_TILE_M = 1.28
_GRAIN_PIXELS = (192, 48)  # across and along the grain
# A fabric's texture covers this square; its weave is coarser than a real one, which no camera here resolves.
WEAVE_TILE_M = 0.32
_WEAVE_PIXELS, _WEAVE_THREADS = 64, 16
_GRAIN_SEEDS = 2**31

# One material per field of an appearance, `materials["front"]` say.
Materials = dict[str, Material]
Finish = Literal["wood", "paint", "metal", "plastic", "fabric", "leather"]

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
# Injection-moulded and rotational-moulded goods: strong colours as well as neutral ones.
PLASTICS: dict[str, tuple[int, int, int]] = {
    "white": (238, 238, 236),
    "light_grey": (188, 190, 192),
    "grey": (120, 122, 126),
    "black": (34, 34, 36),
    "red": (196, 44, 40),
    "orange": (224, 118, 38),
    "yellow": (234, 196, 62),
    "green": (66, 138, 78),
    "blue": (46, 96, 168),
    "sky": (132, 182, 214),
    "pink": (220, 140, 164),
    "beige": (214, 200, 172),
}
# Light and dark sRGB of woven upholstery: warp and weft.
FABRICS: dict[str, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    "black": ((58, 58, 62), (34, 34, 38)),
    "charcoal": ((92, 94, 98), (62, 64, 68)),
    "grey": ((152, 154, 156), (118, 120, 124)),
    "sand": ((206, 192, 164), (176, 160, 132)),
    "navy": ((66, 80, 116), (44, 54, 84)),
    "petrol": ((52, 108, 116), (34, 80, 88)),
    "moss": ((112, 124, 84), (84, 96, 60)),
    "rust": ((176, 96, 66), (142, 72, 48)),
    "wine": ((136, 52, 66), (104, 36, 48)),
    "mustard": ((204, 162, 74), (172, 132, 52)),
}

# Leather, and what is made to look like it.
LEATHERS: dict[str, tuple[int, int, int]] = {
    "black": (40, 38, 38),
    "brown": (92, 64, 46),
    "cognac": (156, 96, 56),
    "cream": (222, 210, 188),
    "grey": (122, 120, 118),
    "oxblood": (102, 40, 42),
    "white": (232, 230, 224),
}


@dataclass(frozen=True)
class Surface:
    """One resolved finish."""

    finish: Finish  # which palette
    name: str  # its key there
    srgb: tuple[int, int, int]  # base colour, 0..255, after the object's own variation
    grain_seed: int  # seeds the grain of a wood and the weave of a fabric; 0 otherwise
    shininess: float  # 0 (matt) to 1 (polished)


def sample_surface(rng: np.random.Generator, finish: Finish, names: tuple[str, ...] = ()) -> Surface:
    """Draw a surface of a finish, its colour a little off the palette's; `names` restricts the choice."""
    legal = names or tuple(_PALETTES[finish])
    name = legal[int(rng.integers(len(legal)))]
    brightness, tint = rng.uniform(0.94, 1.04), rng.uniform(-5, 5, 3)
    seed = int(rng.integers(1, _GRAIN_SEEDS)) if finish in _TEXTURES else 0
    base = _PALETTES[finish][name]
    shininess = METALS[name][1] if finish == "metal" else float(rng.uniform(*_SHININESS[finish]))
    srgb = tuple(int(v) for v in np.clip(np.round(np.array(base) * brightness + tint), 0, 255))
    return Surface(finish, name, (srgb[0], srgb[1], srgb[2]), seed, round(shininess, 3))


def make_material(surface: Surface) -> Material:
    """Make the engine-free material of a surface; woods come with their grain, fabrics with their weave."""
    linear = srgb_to_linear(np.array(surface.srgb))
    red, green, blue = (round(float(v), 4) for v in linear)
    make_texture = _TEXTURES.get(surface.finish)
    texture = None if make_texture is None else make_texture(surface.name, surface.grain_seed)
    return Material(surface.name, (red, green, blue, 1.0), texture, surface.shininess)


def make_materials(appearance: Any) -> Materials:
    """Make the materials of a dataclass whose fields are all `Surface`s; equal surfaces share one."""
    made: dict[Surface, Material] = {}
    for field in fields(appearance):
        surface = getattr(appearance, field.name)
        if surface not in made:
            made[surface] = make_material(surface)
    return {field.name: made[getattr(appearance, field.name)] for field in fields(appearance)}


def wood_grain(name: str, seed: int) -> np.ndarray:
    """Make a texture that darkens a wood's base colour along streaks.

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


def fabric_weave(name: str, seed: int) -> np.ndarray:
    """Make a texture of crossing threads of varying brightness, which darkens a fabric's base colour.

    The image covers `WEAVE_TILE_M` either way and repeats.

    Args:
        name: a key of `FABRICS`.
        seed: of the threads.

    Returns:
        (H, W, 3) uint8 sRGB, 255 where the base colour is left as it is.
    """
    rng = np.random.default_rng(seed)
    cell = np.arange(_WEAVE_PIXELS) * _WEAVE_THREADS // _WEAVE_PIXELS
    over = (cell[:, None] + cell[None]) % 2 == 0  # plain weave: over one, under one
    warp, weft = rng.random((2, _WEAVE_THREADS))[:, cell]
    amount = np.where(over, 0.35 * warp[None, :], 0.6 + 0.4 * weft[:, None])[..., None]
    light, dark = (np.array(rgb, dtype=float) for rgb in FABRICS[name])
    return np.round(255 * (1 - amount * (1 - dark / light))).astype(np.uint8)


def srgb_to_linear(srgb: np.ndarray) -> np.ndarray:
    """Decode sRGB values 0..255 to linear intensities 0..1 (IEC 61966-2-1)."""
    c = np.asarray(srgb, dtype=float) / 255
    return np.where(c <= 0.04045, c / 12.92, power((c + 0.055) / 1.055, 2.4))


def _noise(rng: np.random.Generator, shape: tuple[int, int], cells: tuple[int, int]) -> np.ndarray:
    """Return smooth noise in [0, 1] with so many cells along each side, interpolated linearly."""
    coarse = rng.random((cells[0] + 1, cells[1] + 1))
    for axis in (0, 1):
        at = np.linspace(0, cells[axis], shape[axis])
        low = np.minimum(at.astype(int), cells[axis] - 1)
        blend = (at - low).reshape((-1, 1) if axis == 0 else (1, -1))
        coarse = np.take(coarse, low, axis) * (1 - blend) + np.take(coarse, low + 1, axis) * blend
    return coarse


_PALETTES: dict[Finish, dict[str, tuple[int, int, int]]] = {
    "wood": {name: light for name, (light, _) in WOODS.items()},
    "paint": PAINTS,
    "metal": {name: srgb for name, (srgb, _) in METALS.items()},
    "plastic": PLASTICS,
    "fabric": {name: light for name, (light, _) in FABRICS.items()},
    "leather": LEATHERS,
}
_TEXTURES: dict[Finish, Callable[[str, int], np.ndarray]] = {"wood": wood_grain, "fabric": fabric_weave}
_SHININESS: dict[Finish, tuple[float, float]] = {  # matt to polished; metals have their own
    "wood": (0.1, 0.35),
    "paint": (0.05, 0.5),
    "plastic": (0.1, 0.55),
    "fabric": (0.0, 0.05),
    "leather": (0.15, 0.35),
}
