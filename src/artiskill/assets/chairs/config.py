"""Ranges and weights from which chairs are drawn; values: `configs/catalog/chair_generator.yaml`."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from artiskill.assets.finishes import Finish
from artiskill.assets.generators import Range, check_ranges, check_weights
from artiskill.config import CONFIG_DIR, check, load_config
from artiskill.errors import shown

GENERATOR_YAML: Path = CONFIG_DIR / "catalog" / "chair_generator.yaml"


BASES = ("star4", "star5", "disc", "sled", "cantilever")
CASTERS = ("twin", "single", "ball")
SEATS = ("square", "round", "waterfall", "saddle")
BACKS = ("none", "low", "high", "mesh", "curved", "slats")
ARMS = ("none", "tee", "loop", "cantilever")
TILTS = ("none", "seat", "back", "both")
STRUCTURES: tuple[Finish, ...] = ("plastic", "metal", "wood")
COVERS: tuple[Finish, ...] = ("fabric", "leather", "plastic", "wood")
_MOST_LEAN_DEG = 25.0


@dataclass(frozen=True)
class ChairFamilyConfig:
    """One kind of chair: which parts it is put together from, with which weights.

    Attributes:
        name: goes into the object's metadata.
        weight: how often it is drawn, relative to the other families of its split.
        held_out: whether it is kept out of training and test objects.
        bases: weights of `star4` and `star5` (legs with casters), `disc`, `sled` and `cantilever` (without).
        casters: weights of `twin`, `single`, `ball`; empty for bases without.
        seats: weights of `square`, `round`, `waterfall` (its front falls off), `saddle`.
        backs: weights of `none`, `low`, `high`, `mesh` (a frame with a net), `curved` (a shell), `slats`.
        arms: weights of `none`, `tee`, `loop`, `cantilever`.
        tilts: weights of what leans back under a load: `none`, `seat` (with the back), `back`, `both`.
        seat_height_m: from the ground to the seat's top.
        seat_width_m: along y.
        seat_depth_m: along x.
        headrest_probability: how often a back carries one.
        footrest_probability: how often a ring for the feet goes around the column.
        structures: weights of what base and frame are made of: `plastic`, `metal`, `wood`.
        covers: weights of what seat and back are covered with or made of: `fabric`, `leather`, `plastic`, `wood`.
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
        check(self.weight >= 0, f"{where}: weight must be at least 0, not {shown(self.weight)}")
        check_ranges(self, where, zero=True)
        for name, legal in (
            ("bases", BASES),
            ("seats", SEATS),
            ("backs", BACKS),
            ("arms", ARMS),
            ("tilts", TILTS),
            ("structures", STRUCTURES),
            ("covers", COVERS),
        ):
            check_weights(getattr(self, name), legal, f"{where}: {name}")
        if any(self.bases.get(name, 0) > 0 for name in ("star4", "star5")):
            check_weights(self.casters, CASTERS, f"{where}: casters")


@dataclass(frozen=True)
class SeatConfig:
    """One kind of seat: thickness of the cushion, and how far a front falls or a saddle's sides hang."""

    thickness_m: Range
    shape_m: Range

    def __post_init__(self) -> None:
        check_ranges(self, "seat", zero=True)


@dataclass(frozen=True)
class BackConfig:
    """One kind of back.

    Attributes:
        height_m: of the panel, along it.
        width_m: at its widest.
        gap_m: from the seat's top to the panel's lower edge.
        thickness_m: of cushion, shell, net or slats.
        lean_deg: from the vertical.
        wrap_m: how far the sides come forward of the middle.
    """

    height_m: Range
    width_m: Range
    gap_m: Range
    thickness_m: Range
    lean_deg: Range
    wrap_m: Range

    def __post_init__(self) -> None:
        check_ranges(self, "back", zero=True)
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
        check_ranges(self, "masses", zero=True)
        check(set(self.base_kg) >= set(STRUCTURES), f"masses: base_kg needs the keys {', '.join(STRUCTURES)}")


@dataclass(frozen=True)
class ChairConfig:
    """How chairs are drawn.

    Attributes:
        families: kinds of chairs.
        seats, backs: by kind, sizes.
        hard_seat_m: thickness of a seat that is a board or a shell.
        height_m: from the ground to the top of a chair with a back.
        headrest_height_m: of one with a headrest, which is included.
        stool_height_m: of one without.
        base_radius_m: from the column to a caster's stem.
        caster_diameter_m: of the wheels.
        caster_trail_m: from the stem's axis to the wheel's.
        split_probability: how often the two wheels of twin casters turn separately.
        lift_probability: how often the column is a gas lift.
        lift_travel_m: how far it extends.
        lift_force_n: the force with which its spring holds it at its lower end.
        tilt_deg: how far the seat leans back.
        tilt_moment_n_m: with which its spring holds it upright.
        recline_deg: how far the back leans back against the seat.
        arm_height_m: from the seat's top to the armrests'.
        arm_length_m: of the armrests.
        arm_clear_m: between the armrests.
        mass_kg: least and largest mass of a chair.
        masses: of the parts.
    """

    families: tuple[ChairFamilyConfig, ...]
    seats: dict[str, SeatConfig]
    hard_seat_m: Range
    backs: dict[str, BackConfig]
    height_m: Range
    headrest_height_m: Range
    stool_height_m: Range
    base_radius_m: Range
    caster_diameter_m: Range
    caster_trail_m: Range
    split_probability: float
    lift_probability: float
    lift_travel_m: Range
    lift_force_n: Range
    tilt_deg: Range
    tilt_moment_n_m: Range
    recline_deg: Range
    arm_height_m: Range
    arm_length_m: Range
    arm_clear_m: Range
    mass_kg: Range
    masses: MassConfig

    def __post_init__(self) -> None:
        check_ranges(self, "chair", zero=True)
        for held_out in (False, True):
            weights = [f.weight for f in self.families if f.held_out == held_out]
            check(any(weights), f"families: at least one with held_out {held_out} needs a weight above 0")
        check(set(self.seats) >= set(SEATS), f"seats needs the keys {', '.join(SEATS)}")
        check(set(self.backs) >= set(BACKS), f"backs needs the keys {', '.join(BACKS)}")


@cache
def default_chair_config() -> ChairConfig:
    """The config from which the catalogue and generated chairs are made; read once, to be left as it is."""
    return load_config(ChairConfig, GENERATOR_YAML)
