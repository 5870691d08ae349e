"""Surfaces and materials of buckets: finishes that go together, drawn per object, and zinc with its spangles."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from artiskill.assets.articulated_object import Material
from artiskill.assets.buckets.spec import BucketAppearance
from artiskill.assets.finishes import Surface, make_materials, sample_surface

_STEEL = ("brushed_steel", "nickel")
_SPANGLE_SEEDS = 2**31
_ZINC_SHININESS = 0.45
# A spangle texture covers this square and repeats.
SPANGLE_TILE_M = 0.20
_SPANGLE_PIXELS, _SPANGLES = 96, 160
_DARKEST = 0.90  # of a spangle, relative to the lightest


def sample_bucket_appearance(rng: np.random.Generator, material: str, metal_bail: bool) -> BucketAppearance:
    """Draw surfaces that go together.

    Args:
        rng: random generator.
        material: `plastic`, `galvanised`, `enamel` or `wood`.
        metal_bail: whether the bail is of wire or strap metal, not moulded.
    """
    return _SCHEMES[material](rng, metal_bail)


def _plastic(rng: np.random.Generator, metal_bail: bool) -> BucketAppearance:
    wall = sample_surface(rng, "plastic")
    accent = sample_surface(rng, "plastic")
    lip = accent if rng.random() < 0.12 else wall
    if metal_bail:
        bail = sample_surface(rng, "metal", (*_STEEL, "black_iron"))
        grip = sample_surface(rng, "plastic", ("white", "black", "grey", "red", "blue"))
        return BucketAppearance(wall, wall, lip, wall, bail, grip)
    bail = wall if rng.random() < 0.4 else accent
    return BucketAppearance(wall, wall, lip, wall, bail, bail)


def _galvanised(rng: np.random.Generator, metal_bail: bool) -> BucketAppearance:
    bare = sample_surface(rng, "metal", ("brushed_steel",) * 5 + ("nickel", "copper", "brass"))
    if bare.name in _STEEL:  # as dipped in zinc: its crystals are seen
        bare = replace(bare, grain_seed=int(rng.integers(1, _SPANGLE_SEEDS)), shininess=_ZINC_SHININESS)
    painted = sample_surface(rng, "paint") if rng.random() < 0.35 else bare
    fitting = bare if painted is bare or rng.random() < 0.5 else painted
    bail = sample_surface(rng, "metal", (*_STEEL, "black_iron"))
    return BucketAppearance(painted, bare, painted if rng.random() < 0.7 else bare, fitting, bail, _grip(rng))


def _enamel(rng: np.random.Generator, metal_bail: bool) -> BucketAppearance:
    wall = replace(sample_surface(rng, "paint"), shininess=0.7)
    inside = replace(sample_surface(rng, "paint", ("white", "cream")), shininess=0.7)
    rim = replace(sample_surface(rng, "paint", ("navy", "black", "anthracite", "forest", "brick")), shininess=0.7)
    if rng.random() < 0.2:
        rim = wall
    return BucketAppearance(wall, inside, rim, rim, sample_surface(rng, "metal", _STEEL), _grip(rng))


def _wood(rng: np.random.Generator, metal_bail: bool) -> BucketAppearance:
    wall = sample_surface(rng, "wood")
    metal = sample_surface(rng, "metal", ("black_iron", "brushed_steel", "brass", "copper"))
    return BucketAppearance(wall, wall, wall, metal, metal, _grip(rng))


def _grip(rng: np.random.Generator) -> Surface:
    if rng.random() < 0.75:
        return sample_surface(rng, "wood", ("beech", "birch", "oak", "walnut", "cherry"))
    return sample_surface(rng, "plastic", ("black", "white", "grey", "red"))


_SCHEMES: dict[str, Callable[[np.random.Generator, bool], BucketAppearance]] = {
    "plastic": _plastic,
    "galvanised": _galvanised,
    "enamel": _enamel,
    "wood": _wood,
}


def make_bucket_materials(appearance: BucketAppearance) -> dict[str, Material]:
    """Build one material per surface, textures included; metals with a grain are galvanised."""
    made = make_materials(appearance)
    galvanised: dict[Surface, Material] = {}
    for name, material in made.items():
        surface: Surface = getattr(appearance, name)
        if surface.finish == "metal" and surface.grain_seed:
            if surface not in galvanised:
                galvanised[surface] = replace(material, texture=_zinc_spangle(surface.grain_seed))
            made[name] = galvanised[surface]
    return made


def _zinc_spangle(seed: int) -> np.ndarray:
    """Return a repeating texture of the crystals that zinc forms on hot-dipped steel: each cell has its own grey.

    (H, W, 3) uint8 sRGB, 255 where the base colour is left as it is.
    """
    rng = np.random.default_rng(seed)
    centres, shades = rng.random((_SPANGLES, 2)), rng.random(_SPANGLES)
    places = (np.arange(_SPANGLE_PIXELS) + 0.5) / _SPANGLE_PIXELS
    apart = np.abs(places - centres.T[..., None])
    apart = np.minimum(apart, 1.0 - apart)  # (2, cells, pixels): the shorter way around
    distance = apart[0][:, :, None] ** 2 + apart[1][:, None, :] ** 2
    nearest = np.argmin(distance, axis=0)
    grey = np.round(255 * (_DARKEST + (1 - _DARKEST) * shades[nearest]))
    return np.repeat(grey[..., None], 3, axis=-1).astype(np.uint8)
