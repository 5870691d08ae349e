"""Ranges and weights from which cabinets are drawn; values: `configs/catalog/cabinet_generator.yaml`."""

from dataclasses import dataclass
from functools import cache
from typing import get_args

from artiskill.assets.cabinets.appearance import SCHEMES
from artiskill.assets.cabinets.spec import FaceKind, HandleKind, LegShape, SupportKind
from artiskill.assets.finishes import PAINTS
from artiskill.assets.generators import Range, check_families, check_fields, check_weights
from artiskill.config import CONFIG_DIR, check, check_positive, load_config

LAYOUTS = ("columns", "rows", "strip", "drawers", "door", "flap", "open", "blind")
STRIPS = ("drawers", "open", "blind")
SUPPORTS, LEG_SHAPES = get_args(SupportKind), get_args(LegShape)
FACES, HANDLES = get_args(FaceKind), get_args(HandleKind)
BOW = "bow_front"  # a bulging face, in `CabinetConfig.held_out`
HOLDABLE = (*HANDLES, *LAYOUTS, *FACES, BOW)


@dataclass(frozen=True)
class CabinetFamilyConfig:
    """One kind of furniture: its outer sizes and what its front is made of.

    Weights, `{"legs": 1.0}`, name the forms that are drawn, and how often relative to each other. A range has the
    smallest and the largest value, which may be equal.

    Attributes:
        name: goes into the object's metadata.
        weight: how often the family is drawn, relative to the others with the same `held_out`; 0 for never.
        width_m: range of the carcass's outer width, along y.
        depth_m: range of its outer depth, along x, without overlay fronts.
        height_m: range from the ground to the top, support included.
        supports: weights of what it stands on: `plinth`, `sides`, `legs`, `casters`, `floor`, `wall`.
        layouts: weights of what a region of the front becomes: `columns`, `rows` and `strip` split it again;
            `drawers`, `door`, `flap`, `open`, `blind`.
        faces: weights of what the fronts look like: `slab`, `shaker`, `raised`, `glazed`, `louvred`, `planks`.
        handles: weights of the drawers' handles, which doors mostly share: `bar`, `bow`, `knob`, `ring`, `lip`,
            `slot`, `cup`.
        overhang_probability: how often the top stands over the front and the sides.
        inset_probability: how often fronts lie within the carcass instead of over its edges.
        held_out: whether it is drawn only where `held_out=True` is asked for: training and test objects are not.
        cornice_probability: of an overhanging top, how often it is stepped.
        upstand_probability: how often a board stands along the top's back edge.
        finishes: weights of keys of `appearance.SCHEMES`; None for the usual ones.
        bow_m: range of how far the face bulges out; None where it is flat.
    """

    name: str
    weight: float
    width_m: Range
    depth_m: Range
    height_m: Range
    supports: dict[str, float]
    layouts: dict[str, float]
    faces: dict[str, float]
    handles: dict[str, float]
    overhang_probability: float
    inset_probability: float
    held_out: bool = False
    cornice_probability: float = 0.0
    upstand_probability: float = 0.0
    finishes: dict[str, float] | None = None
    bow_m: Range | None = None

    def __post_init__(self) -> None:
        where = f"family {self.name!r}"
        check_fields(self, where)
        for name, legal in (("supports", SUPPORTS), ("layouts", LAYOUTS), ("faces", FACES), ("handles", HANDLES)):
            check_weights(getattr(self, name), legal, f"{where}: {name}")
        if self.finishes:
            check_weights(self.finishes, tuple(SCHEMES), f"{where}: finishes")
        flush = {"lip", "slot"} & {name for name, weight in self.handles.items() if weight > 0}
        check(self.bow_m is None or not flush, f"{where}: a bowed front has no handle of kind {sorted(flush)}")

    @property
    def features(self) -> set[str]:
        """Names of what it may have that `CabinetConfig.held_out` may name."""
        weights = {**self.layouts, **self.faces, **self.handles}
        return {name for name, weight in weights.items() if weight > 0} | ({BOW} if self.bow_m else set())


@dataclass(frozen=True)
class HandleConfig:
    """Handles, and where they sit."""

    # distances of two screws: 80 mm, and multiples of 32 mm, as in the European cabinet system ("System 32")
    # and makers' catalogues
    centres_m: tuple[float, ...]
    cup_centres_m: tuple[float, ...]  # distances of the two screws of cup pulls
    diameter_m: Range  # of a round bar, side of a square one
    projection_m: Range  # from the front's face to the handle's outermost surface
    # at least this much room between the front's face and a bar or bow: a finger must fit behind
    clearance_m: float
    bar_shapes: dict[str, float]  # weights of `round`, `square` and `flat`
    bow_shapes: dict[str, float]  # weights of `arch`, `d` and `strap`
    bow_length_m: float  # longest distance of a bow's feet
    knob_m: Range  # diameter of knobs
    knob_projection_m: Range  # from the front's face to their outermost surface
    knob_shapes: dict[str, float]  # weights of the forms of heads
    ring_m: Range  # outer diameter of rings
    ring_wire_m: Range  # of a ring's wire
    lip_m: Range  # thickness of a lip's board
    lip_projection_m: Range  # how far lips stand out
    slot_room_m: float  # from a flush bar to its cavity's edge, on either side: a finger must go in
    slot_length_m: Range  # of the cavity
    slot_depth_m: Range  # of the cavity
    slot_lowest_m: float  # least height of a cavity's centre: a hand that comes from above does not fit in
    cup_height_m: Range  # of cup pulls
    edge_m: float  # least distance of an upright handle's axis from the door's free edge
    height_m: Range  # least and largest height of a handle's centre above the ground
    mixed_probability: float  # how often doors carry another kind than drawers

    def __post_init__(self) -> None:
        check_fields(self, "handle")
        for name in ("centres_m", "cup_centres_m"):
            check(len(getattr(self, name)) > 0, f"handle: {name} must name at least one distance")
        check_weights(self.bar_shapes, ("round", "square", "flat"), "handle: bar_shapes")
        check_weights(self.bow_shapes, ("arch", "d", "strap"), "handle: bow_shapes")
        check_weights(self.knob_shapes, ("disc", "mushroom", "ball", "cone", "square"), "handle: knob_shapes")
        least = self.diameter_m[1] + self.clearance_m
        check(least <= self.projection_m[1], f"handle: projection_m must reach {least:g} (diameter and clearance)")


@dataclass(frozen=True)
class WallConfig:
    """The wall behind a cabinet that hangs: from the floor up, the cabinet before its middle."""

    width_m: float  # along y, the same for every cabinet
    height_m: float  # from the floor
    thickness_m: float  # along x
    paints: tuple[str, ...]  # keys of `finishes.PAINTS`, one of which it is painted with

    def __post_init__(self) -> None:
        check_positive(self, "width_m", "height_m", "thickness_m")
        check(len(self.paints) > 0, "wall: paints must name at least one paint")
        for name in self.paints:
            check(name in PAINTS, f"wall: paints: unknown name {name!r}; legal: {', '.join(PAINTS)}")


@dataclass(frozen=True)
class CabinetConfig:
    """How cabinets are drawn."""

    families: tuple[CabinetFamilyConfig, ...]  # kinds of furniture
    # handles, layouts, faces or `bow_front`: what only families with `held_out` may have
    held_out: tuple[str, ...]
    panel_m: Range  # thickness of carcass panels and dividers
    back_m: Range  # thickness of the back panel
    front_m: Range  # thickness of doors and drawer fronts
    gap_m: Range  # width of the slits around fronts
    frame_m: Range  # width of a frame's members
    plank_m: Range  # width of planks
    slat_m: Range  # distance of slats
    knuckle_m: Range  # hinge axes stand this far before the fronts' face
    plinth_height_m: Range  # a plinth's or kick board's height
    leg_height_m: Range  # a leg's height
    leg_shapes: dict[str, float]  # weights of `round`, `square`, `splayed`, `bun`, `sled`
    caster_m: Range  # diameter of casters' wheels
    wall: WallConfig  # what a cabinet hangs on that does not stand
    wall_height_m: Range  # height above the ground of what hangs on a wall
    drawer_height_m: Range  # height of a drawer's opening
    drawer_width_m: Range  # width of a drawer's opening
    door_width_m: Range  # width of a door's opening
    door_height_m: Range  # height of a door's opening
    flap_width_m: Range  # width of a flap's opening
    flap_height_m: Range  # height of a flap's opening
    door_limit_deg: Range  # how far doors open
    flap_limit_deg: Range  # how far flaps open
    travel_fraction: Range  # how far drawers open, relative to the depth of their boxes
    travel_m: Range  # how far drawers open, which narrows `travel_fraction` where both cannot hold
    # weights of what stands above or below a region: `drawers` (one row), `open`, `blind`
    strips: dict[str, float]
    strip_below_probability: float  # how often it stands below
    max_moving: int  # most doors and drawers of one cabinet
    max_collisions: int  # most collision shapes of one cabinet
    handle: HandleConfig

    def __post_init__(self) -> None:
        check_fields(self, "cabinet")
        check_weights(self.strips, STRIPS, "strips")
        check_weights(self.leg_shapes, LEG_SHAPES, "leg_shapes")
        check_families(self.families)
        check(self.gap_m[0] >= 0.002, f"gap_m must be at least 0.002, not {self.gap_m[0]!r}: fronts would touch")
        check(self.door_limit_deg[1] <= 175, f"door_limit_deg must stay below 175, not {self.door_limit_deg[1]!r}")
        check(self.travel_fraction[1] <= 1, f"travel_fraction must stay within 1, not {self.travel_fraction[1]!r}")
        for name in self.held_out:
            check(name in HOLDABLE, f"held_out: unknown name {name!r}; legal: {', '.join(HOLDABLE)}")
        for family in self.families:
            kept = sorted(family.features & set(self.held_out))
            check(family.held_out or not kept, f"family {family.name!r} is not held out but has {', '.join(kept)}")


@cache
def default_cabinet_config() -> CabinetConfig:
    """Read the config from which the catalogue and `generated:<seed>` are made."""
    return load_config(CabinetConfig, CONFIG_DIR / "catalog" / "cabinet_generator.yaml")
