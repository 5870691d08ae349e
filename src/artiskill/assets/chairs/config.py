"""Ranges and weights from which chairs are drawn; values: `configs/catalog/chair_generator.yaml`."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import get_args

from artiskill.assets.chairs.spec import ArmKind, BackKind, CasterKind, SeatKind
from artiskill.assets.finishes import Finish
from artiskill.assets.generators import Range, check_families, check_fields, check_weights
from artiskill.config import CONFIG_DIR, check, load_config

GENERATOR_YAML: Path = CONFIG_DIR / "catalog" / "chair_generator.yaml"

_STRUCTURES: tuple[Finish, ...] = ("plastic", "metal", "wood")
_COVERS: tuple[Finish, ...] = ("fabric", "leather", "plastic", "wood")
# Field of a family -> which names its weights may have.
_CHOICES: dict[str, tuple[str, ...]] = {
    "bases": ("star4", "star5", "disc", "sled", "cantilever"),
    "seats": get_args(SeatKind),
    "backs": get_args(BackKind),
    "arms": get_args(ArmKind),
    "tilts": ("none", "seat", "back", "both"),
    "structures": _STRUCTURES,
    "covers": _COVERS,
}
_MOST_LEAN_DEG = 25.0


@dataclass(frozen=True)
class ChairFamilyConfig:
    """One kind of chair: which parts it is put together from, with which weights.

    Weights, `{"round": 1.0}`, name the forms that are drawn, and how often relative to each other. A range has the
    smallest and the largest value, which may be equal.

    Attributes:
        name: goes into the object's metadata.
        weight: how often the family is drawn, relative to the others with the same `held_out`; 0 for never.
        held_out: whether it is drawn only where `held_out=True` is asked for: training and test objects are not.
        bases: weights of `star4` and `star5`, whose legs have casters, `disc`, `sled`, `cantilever`.
        casters: weights of `twin`, `single`, `ball`; empty for bases without.
        seats: weights of `square`, `round`, `waterfall`, whose front falls off, `saddle`.
        backs: weights of `none`, `low`, `high`, `mesh`, a frame with a net, `curved`, a shell, `slats`.
        arms: weights of `none`, `tee`, `loop`, `cantilever`.
        tilts: weights of what leans back under a load: `none`, `seat` (with the back), `back`, `both`.
        seat_height_m: range from the ground to the seat's top.
        seat_width_m: range along y.
        seat_depth_m: range along x.
        headrest_probability: how often a back carries one.
        footrest_probability: how often a ring for the feet goes around the column.
        structures: weights of what base and frame are made of: `plastic`, `metal`, `wood`.
        covers: weights of what seat and back are covered with: `fabric`, `leather`, `plastic`, `wood`.
    """

    name: str
    weight: float
    held_out: bool
    bases: dict[str, float]
    casters: dict[str, float]
    seats: dict[str, float]
    backs: dict[str, float]
    arms: dict[str, float]
    tilts: dict[str, float]
    seat_height_m: Range
    seat_width_m: Range
    seat_depth_m: Range
    headrest_probability: float
    footrest_probability: float
    structures: dict[str, float]
    covers: dict[str, float]

    def __post_init__(self) -> None:
        where = f"family {self.name!r}"
        check_fields(self, where, zero=True)
        for name, legal in _CHOICES.items():
            check_weights(getattr(self, name), legal, f"{where}: {name}")
        if any(self.bases.get(name, 0) > 0 for name in ("star4", "star5")):
            check_weights(self.casters, get_args(CasterKind), f"{where}: casters")


@dataclass(frozen=True)
class SeatConfig:
    """One kind of seat: thickness of the cushion, and how far a front falls or a saddle's sides hang."""

    thickness_m: Range
    shape_m: Range

    def __post_init__(self) -> None:
        check_fields(self, "seat", zero=True)


@dataclass(frozen=True)
class BackConfig:
    """One kind of back."""

    height_m: Range  # of the panel, along it
    width_m: Range  # at its widest
    gap_m: Range  # from the seat's top to the panel's lower edge
    thickness_m: Range  # of cushion, shell, net or slats
    lean_deg: Range  # from the vertical
    wrap_m: Range  # how far the sides come forward of the middle

    def __post_init__(self) -> None:
        check_fields(self, "back", zero=True)
        check(self.lean_deg[1] <= _MOST_LEAN_DEG, f"back: lean_deg must stay within {_MOST_LEAN_DEG:g}")


@dataclass(frozen=True)
class MassConfig:
    """What parts weigh; the keys of `base_kg` are structures, `*_m2` are per area of the panel."""

    base_kg: dict[str, Range]
    disc_kg: Range
    frame_kg: Range
    tube_kg: Range
    piston_kg: Range
    mechanism_kg: Range
    caster_kg: Range
    wheel_kg: Range
    seat_kg_m2: Range
    back_kg_m2: Range
    arms_kg: Range
    headrest_kg: Range

    def __post_init__(self) -> None:
        check_fields(self, "masses", zero=True)
        check(set(self.base_kg) >= set(_STRUCTURES), f"masses: base_kg needs the keys {', '.join(_STRUCTURES)}")


@dataclass(frozen=True)
class ChairConfig:
    """How chairs are drawn."""

    families: tuple[ChairFamilyConfig, ...]
    seats: dict[str, SeatConfig]  # by kind
    hard_seat_m: Range  # thickness of a seat that is a board or a shell
    backs: dict[str, BackConfig]  # by kind
    height_m: Range  # from the ground to the top of a chair with a back
    headrest_height_m: Range  # of one with a headrest, which is included
    stool_height_m: Range  # of one without a back
    base_radius_m: Range  # from the column to a caster's stem
    caster_diameter_m: Range  # of the wheels
    caster_trail_m: Range  # from the stem's axis to the wheel's
    split_probability: float  # how often the two wheels of twin casters turn separately
    lift_probability: float  # how often the column is a gas lift
    lift_travel_m: Range  # how far it extends
    lift_force_n: Range  # with which its spring holds it at its lower end
    tilt_deg: Range  # how far the seat leans back
    tilt_moment_n_m: Range  # with which its spring holds it upright
    recline_deg: Range  # how far the back leans back against the seat
    arm_height_m: Range  # from the seat's top to the armrests'
    arm_length_m: Range
    arm_clear_m: Range  # between the armrests
    mass_kg: Range  # of a whole chair
    masses: MassConfig

    def __post_init__(self) -> None:
        check_fields(self, "chair", zero=True)
        check_families(self.families)
        check(set(self.seats) >= set(get_args(SeatKind)), f"seats needs the keys {', '.join(get_args(SeatKind))}")
        check(set(self.backs) >= set(get_args(BackKind)), f"backs needs the keys {', '.join(get_args(BackKind))}")


@cache
def default_chair_config() -> ChairConfig:
    """Return the config from which the catalogue and generated chairs are made; it must not be changed."""
    return load_config(ChairConfig, GENERATOR_YAML)
