"""The materials of one bucket, made once and shared by its parts."""

from dataclasses import dataclass, replace

import numpy as np

from artiskill.assets.articulated_object import Material
from artiskill.assets.buckets.appearance import BucketAppearance
from artiskill.assets.finishes import Surface, make_materials

# A spangle texture covers this square and repeats.
SPANGLE_TILE_M = 0.20
_SPANGLE_PIXELS, _SPANGLES = 96, 160
_DARKEST = 0.90  # of a spangle, relative to the lightest


@dataclass(frozen=True, eq=False)
class Materials:
    """One material per surface of `BucketAppearance`; equal surfaces share one."""

    wall: Material
    inside: Material
    lip: Material
    ear: Material
    bail: Material
    grip: Material


def make_bucket_materials(appearance: BucketAppearance) -> Materials:
    """Build the materials, textures included; metals with a grain are galvanised."""
    made = make_materials(appearance)
    galvanised: dict[Surface, Material] = {}
    for name, material in made.items():
        surface: Surface = getattr(appearance, name)
        if surface.finish == "metal" and surface.grain_seed:
            if surface not in galvanised:
                galvanised[surface] = replace(material, texture=zinc_spangle(surface.grain_seed))
            made[name] = galvanised[surface]
    return Materials(**made)


def zinc_spangle(seed: int) -> np.ndarray:
    """A repeating texture of the crystals that zinc forms on hot-dipped steel: each cell has its own grey.

    Args:
        seed: of the crystals.

    Returns:
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
