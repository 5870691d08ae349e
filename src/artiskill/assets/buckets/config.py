"""Ranges and weights from which buckets are drawn; values: `configs/catalog/bucket_generator.yaml`."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import get_args

from artiskill.assets.buckets.spec import (
    BailKind,
    EarKind,
    FootKind,
    GripKind,
    LipKind,
    MaterialKind,
    ProfileKind,
    SectionKind,
)
from artiskill.assets.generators import Range, check_families, check_fields, check_weights
from artiskill.config import CONFIG_DIR, check, load_config
from artiskill.errors import shown

GENERATOR_YAML: Path = CONFIG_DIR / "catalog" / "bucket_generator.yaml"
NO_BAIL = "none"
MATERIALS: tuple[str, ...] = get_args(MaterialKind)
# Field of a family -> which names its weights may have.
CHOICES: dict[str, tuple[str, ...]] = {
    "sections": get_args(SectionKind),
    "profiles": get_args(ProfileKind),
    "feet": get_args(FootKind),
    "lips": get_args(LipKind),
    "bails": (*get_args(BailKind), NO_BAIL),
    "grips": get_args(GripKind),
    "ears": get_args(EarKind),
}


@dataclass(frozen=True)
class MaterialConfig:
    """What a bucket weighs."""

    name: str  # one of `MATERIALS`; decides its colours too
    density_kg_m3: Range
    gauge_m: Range  # real thickness of its wall, which for sheet metal is less than what is drawn

    def __post_init__(self) -> None:
        check_material("material", self.name)
        check_fields(self, f"material {self.name!r}")


@dataclass(frozen=True)
class BucketFamilyConfig:
    """One kind of bucket: weights of what each part is drawn as, and ranges of its sizes.

    Weights, `{"oval": 1.0}`, name the forms that are drawn, and how often relative to each other. A range has the
    smallest and the largest value, which may be equal.

    Attributes:
        name: goes into the object's metadata.
        weight: how often the family is drawn, relative to the others with the same `held_out`; 0 for never.
        held_out: whether it is drawn only where `held_out=True` is asked for: training and test objects are not.
        material: `plastic`, `galvanised`, `enamel` or `wood`; decides mass and colours.
        sections: weights of outlines from above: `round`, `square`, `hexagon`, `octagon`, `oval`.
        profiles: weights of walls from the side: `straight`, `stepped`, `ribbed`, `bellied`, `flared`.
        feet: weights of what it stands on: `flat`, `skirt`, `ring`.
        lips: weights of rims: `rolled`, `flange`, `collar`, `plain`.
        bails: weights of hinged handles: `wire`, `moulded`, `strap`, `none`.
        grips: weights of what the hand holds of one: `barrel`, `sleeve`, `bare`.
        ears: weights of what is at its sides: `boss` or `tab` for a bail, `loop` to lift by without one.
        top_m: range of the width at the rim across the pivots, without the lip.
        height_m: range from the ground to the rim.
        taper_deg: range of the wall's mean lean, at most 20.
        wall_m: range of the wall's thickness as drawn.
        lip_m: range of how far the lip stands out.
        spout_probability: how often the rim has a spout, 0 to 1.
    """

    name: str
    weight: float
    held_out: bool
    material: str
    sections: dict[str, float]
    profiles: dict[str, float]
    feet: dict[str, float]
    lips: dict[str, float]
    bails: dict[str, float]
    grips: dict[str, float]
    ears: dict[str, float]
    top_m: Range
    height_m: Range
    taper_deg: Range
    wall_m: Range
    lip_m: Range
    spout_probability: float

    def __post_init__(self) -> None:
        where = f"family {self.name!r}"
        check_fields(self, where)
        check_material(f"{where}: material", self.material)
        for field, legal in CHOICES.items():
            check_weights(getattr(self, field), legal, f"{where}: {field}")
        check(self.taper_deg[1] <= 20, f"{where}: taper_deg must stay within 20, not {self.taper_deg[1]!r}")
        bailed = any(weight > 0 for name, weight in self.bails.items() if name != NO_BAIL)
        text = f"{where}: ears must be boss or tab where there is a bail, not {', '.join(self.ears)}"
        check(not bailed or "loop" not in self.ears, text)


@dataclass(frozen=True)
class BailConfig:
    """The hinged handle."""

    wire_radius_m: Range
    moulded_half_m: tuple[Range, Range]  # half width and half thickness of a moulded bow
    strap_half_m: tuple[Range, Range]  # half width and half thickness of a strap
    limit_deg: Range  # it turns so far to either side, less where the wall is in the way
    least_limit_deg: float  # a bucket whose bail turns less is drawn again
    grip_length_m: Range
    grip_radius_m: Range
    gap_m: float  # air that the bail keeps from wall and lip

    def __post_init__(self) -> None:
        check_fields(self, "bail")
        text = f"bail: least_limit_deg must lie in (0, {self.limit_deg[0]:g}], not {shown(self.least_limit_deg)}"
        check(0 < self.least_limit_deg <= self.limit_deg[0], text)
        check(self.gap_m > 0, f"bail: gap_m must be above 0, not {shown(self.gap_m)}")


@dataclass(frozen=True)
class BucketConfig:
    """How buckets are drawn."""

    families: tuple[BucketFamilyConfig, ...]
    materials: tuple[MaterialConfig, ...]
    bail: BailConfig
    least_floor_m: float  # half width of the floor's inside, at least: a ball must lie on it
    # half width of what it stands on, relative to its height, at least: a ball dropped in askew must not topple it
    least_stance: float
    foot_height_m: Range  # of skirts and rings

    def __post_init__(self) -> None:
        check_fields(self, "bucket")
        names = [material.name for material in self.materials]
        for family in self.families:
            text = f"family {family.name!r}: materials have no {family.material!r}, only: {', '.join(names)}"
            check(family.material in names, text)
        check_families(self.families)

    def material(self, name: str) -> MaterialConfig:
        """Return the material that a family names."""
        return next(material for material in self.materials if material.name == name)


def check_material(what: str, name: str) -> None:
    """Raise ConfigError unless buckets can be of this material."""
    check(name in MATERIALS, f"{what}: unknown name {shown(name)}; legal: {', '.join(MATERIALS)}")


@cache
def default_bucket_config() -> BucketConfig:
    """Return the config from which the catalogue and generated buckets are made."""
    return load_config(BucketConfig, GENERATOR_YAML)
