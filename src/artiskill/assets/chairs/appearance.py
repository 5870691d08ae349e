"""Which surfaces the parts of a chair have: finishes that go together, drawn per object."""

from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import Material
from artiskill.assets.finishes import GRAIN_TILE_M, Finish, Surface, make_materials, sample_surface

_DARK_PLASTIC = ("black", "black", "grey")
_BRIGHT_METAL = ("chrome", "brushed_steel", "brushed_steel", "nickel", "nickel")
_WARM_WOOD = ("oak", "beech", "cherry", "walnut", "teak", "wenge")
_SLATS = ("black", "black", "grey", "light_grey", "white", "white", "beige", "sky", "red", "blue")
_TREADS = ("black", "grey", "light_grey")
# Upholstery of chairs is woven finely: threads of 5 mm, as coarse as a picture from 1 m needs them to be seen.
_TILES_M = {"fabric": 0.08}


@dataclass(frozen=True)
class ChairAppearance:
    """The surfaces of one chair.

    Attributes:
        base: legs, disc or frame.
        caster: hoods and forks.
        wheel: their treads.
        tube: the column's outer tube, its cover, the mechanism.
        piston: the column's inner tube.
        seat: what one sits on.
        back: what one leans against.
        shell: the seat's pan and the back's rear.
        frame: what carries the back and the armrests.
        pad: the armrests' tops.
    """

    base: Surface
    caster: Surface
    wheel: Surface
    tube: Surface
    piston: Surface
    seat: Surface
    back: Surface
    shell: Surface
    frame: Surface
    pad: Surface


@dataclass(frozen=True, eq=False)
class Skin:
    """A material, and the side of the square that its texture covers."""

    material: Material
    tile_m: float


@dataclass(frozen=True, eq=False)
class Skins:
    """One skin per surface of `ChairAppearance`; equal surfaces share a material."""

    base: Skin
    caster: Skin
    wheel: Skin
    tube: Skin
    piston: Skin
    seat: Skin
    back: Skin
    shell: Skin
    frame: Skin
    pad: Skin


def make_skins(appearance: ChairAppearance) -> Skins:
    """Build the materials, textures included."""
    made = make_materials(appearance)
    tiles = {name: _TILES_M.get(getattr(appearance, name).finish, GRAIN_TILE_M) for name in made}
    return Skins(**{name: Skin(material, tiles[name]) for name, material in made.items()})


def sample_chair_appearance(
    rng: np.random.Generator, structure: Finish, cover: Finish, back_kind: str
) -> ChairAppearance:
    """Draw surfaces that go together.

    Args:
        rng: draws.
        structure: what the base and the frame are made of: plastic, metal or wood.
        cover: what the seat and the back are covered with or made of.
        back_kind: a net is woven whatever the seat is, slats are not.
    """
    base = _structure(rng, structure)
    dark = sample_surface(rng, "plastic", _DARK_PLASTIC)
    seat = sample_surface(rng, cover, _WARM_WOOD) if cover == "wood" else sample_surface(rng, cover)
    if structure == "wood" and cover == "wood" and rng.random() < 0.8:
        seat = base
    back = seat
    if back_kind == "mesh":
        back = sample_surface(rng, "fabric", () if rng.random() < 0.4 else ("black", "charcoal", "grey"))
    light = structure == "plastic" and rng.random() < 0.25
    shell = sample_surface(rng, "plastic", ("light_grey",)) if light else dark
    if cover in ("wood", "plastic"):
        shell = seat
    elif structure == "wood":
        shell = base
    if back_kind == "slats" and cover != "wood":
        back = base if structure != "metal" else sample_surface(rng, "plastic", _SLATS)
    frame = base if structure != "metal" or rng.random() < 0.6 else dark
    caster = dark
    if (structure == "metal" and rng.random() < 0.35) or (structure == "wood" and rng.random() < 0.6):
        caster = sample_surface(rng, "metal", ("brass", "nickel", "chrome", "black_iron"))
    return ChairAppearance(
        base=base,
        caster=caster,
        wheel=sample_surface(rng, "plastic", _TREADS),
        tube=_tube(rng, structure),
        piston=sample_surface(rng, "metal", ("chrome", "brushed_steel", "black_iron")),
        seat=seat,
        back=back,
        shell=shell,
        frame=frame,
        pad=base if structure == "wood" else _pad(rng, seat, dark),
    )


def _structure(rng: np.random.Generator, structure: Finish) -> Surface:
    if structure == "wood":
        return sample_surface(rng, "wood", _WARM_WOOD)
    if structure == "plastic":
        return sample_surface(rng, "plastic", ("black", "black", "black", "grey", "light_grey", "white"))
    if rng.random() < 0.35:
        return sample_surface(rng, "paint", ("black", "black", "white", "anthracite", "light_grey"))
    return sample_surface(rng, "metal", _BRIGHT_METAL)


def _tube(rng: np.random.Generator, structure: Finish) -> Surface:
    if structure == "metal" and rng.random() < 0.5:
        return sample_surface(rng, "metal", _BRIGHT_METAL)
    return sample_surface(rng, "plastic", ("black",))


def _pad(rng: np.random.Generator, seat: Surface, dark: Surface) -> Surface:
    """Armrests of leather chairs are covered alike, most others are of dark plastic."""
    if seat.finish == "leather" and rng.random() < 0.7:
        return seat
    return dark
