"""Ranges and weights from which cabinets are drawn; values: `configs/catalog/cabinet_generator.yaml`."""

from dataclasses import dataclass
from functools import cache
from typing import get_args

from artiskill.assets.cabinets.spec import FaceKind, HandleKind, LegShape, SupportKind
from artiskill.assets.finishes import PAINTS
from artiskill.assets.generators import Range, check_families, check_ranges, check_weights
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

    Attributes:
        name: goes into the object's metadata.
        weight: how often it is drawn, relative to the other held-out, or the other usual, families.
        width_m: outer width of the carcass, along y.
        depth_m: outer depth of the carcass, along x, without overlay fronts.
        height_m: from the ground to the top, support included.
        supports: weights of what it stands on.
        layouts: weights of what a region of the front becomes: `columns`, `rows` and `strip` split it again.
        faces: weights of what the fronts look like.
        handles: weights of the drawers' handles; doors mostly have the same.
        overhang_probability: how often the top stands over the front and the sides.
        inset_probability: how often fronts lie within the carcass instead of over its edges.
        held_out: whether it is kept from training and test.
        cornice_probability: of an overhanging top: how often it is stepped.
        upstand_probability: how often a board stands along the top's back edge.
        finishes: weights of schemes of `appearance.SCHEMES`; empty for the usual ones.
        bow_m: how far the face bulges out; None where it is flat.
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
        check_ranges(self, where)
        for name, legal in (("supports", SUPPORTS), ("layouts", LAYOUTS), ("faces", FACES), ("handles", HANDLES)):
            check_weights(getattr(self, name), legal, f"{where}: {name}")
        flush = {"lip", "slot"} & {name for name, weight in self.handles.items() if weight > 0}
        check(self.bow_m is None or not flush, f"{where}: a bowed front has no handle of kind {sorted(flush)}")

    @property
    def features(self) -> set[str]:
        """Names of what it may have that `CabinetConfig.held_out` may name."""
        weights = {**self.layouts, **self.faces, **self.handles}
        return {name for name, weight in weights.items() if weight > 0} | ({BOW} if self.bow_m else set())


@dataclass(frozen=True)
class HandleConfig:
    """Handles, and where they sit.

    Attributes:
        centres_m: distances of two screws: 80 mm, and multiples of 32 mm, as in the European cabinet system
            ("System 32") and makers' catalogues.
        cup_centres_m: distances of the two screws of cup pulls.
        diameter_m: of a round bar, side of a square one.
        projection_m: from the front's face to the handle's outermost surface.
        clearance_m: at least this much room between the front's face and a bar or bow: a finger must fit behind.
        bar_shapes: weights of `round`, `square` and `flat`.
        bow_shapes: weights of `arch`, `d` and `strap`.
        bow_length_m: longest distance of a bow's feet.
        knob_m: diameter of knobs.
        knob_projection_m: from the front's face to their outermost surface.
        knob_shapes: weights of the forms of heads.
        ring_m: outer diameter of rings.
        ring_wire_m: of a ring's wire.
        lip_m: thickness of a lip's board.
        lip_projection_m: how far lips stand out.
        slot_room_m: from a flush bar to its cavity's edge, on either side: a finger must go in.
        slot_length_m: of the cavity.
        slot_depth_m: of the cavity.
        slot_lowest_m: least height of a cavity's centre: a hand that comes from above does not fit in.
        cup_height_m: of cup pulls.
        edge_m: least distance of an upright handle's axis from the door's free edge.
        height_m: least and largest height of a handle's centre above the ground.
        mixed_probability: how often doors carry another kind than drawers.
    """

    centres_m: tuple[float, ...]
    cup_centres_m: tuple[float, ...]
    diameter_m: Range
    projection_m: Range
    clearance_m: float
    bar_shapes: dict[str, float]
    bow_shapes: dict[str, float]
    bow_length_m: float
    knob_m: Range
    knob_projection_m: Range
    knob_shapes: dict[str, float]
    ring_m: Range
    ring_wire_m: Range
    lip_m: Range
    lip_projection_m: Range
    slot_room_m: float
    slot_length_m: Range
    slot_depth_m: Range
    slot_lowest_m: float
    cup_height_m: Range
    edge_m: float
    height_m: Range
    mixed_probability: float

    def __post_init__(self) -> None:
        check_ranges(self, "handle")
        for name in ("centres_m", "cup_centres_m"):
            check(len(getattr(self, name)) > 0, f"handle: {name} must name at least one distance")
        check_weights(self.bar_shapes, ("round", "square", "flat"), "handle: bar_shapes")
        check_weights(self.bow_shapes, ("arch", "d", "strap"), "handle: bow_shapes")
        check_weights(self.knob_shapes, ("disc", "mushroom", "ball", "cone", "square"), "handle: knob_shapes")
        least = self.diameter_m[1] + self.clearance_m
        check(least <= self.projection_m[1], f"handle: projection_m must reach {least:g} (diameter and clearance)")


@dataclass(frozen=True)
class WallConfig:
    """The wall behind a cabinet that hangs: from the floor up, the cabinet before its middle.

    Attributes:
        width_m: along y, the same for every cabinet.
        height_m: from the floor.
        thickness_m: along x.
        paints: keys of `finishes.PAINTS`, one of which it is painted with.
    """

    width_m: float
    height_m: float
    thickness_m: float
    paints: tuple[str, ...]

    def __post_init__(self) -> None:
        check_positive(self, "width_m", "height_m", "thickness_m")
        check(len(self.paints) > 0, "wall: paints must name at least one paint")
        for name in self.paints:
            check(name in PAINTS, f"wall: paints: unknown name {name!r}; legal: {', '.join(PAINTS)}")


@dataclass(frozen=True)
class CabinetConfig:
    """How cabinets are drawn.

    Attributes:
        families: kinds of furniture.
        held_out: handles, layouts, faces or `bow_front`: what only families with `held_out` may have.
        panel_m: thickness of carcass panels and dividers.
        back_m: thickness of the back panel.
        front_m: thickness of doors and drawer fronts.
        gap_m: width of the slits around fronts.
        frame_m: width of a frame's members.
        plank_m: width of planks.
        slat_m: distance of slats.
        knuckle_m: hinge axes stand this far before the fronts' face.
        plinth_height_m: a plinth's or kick board's height.
        leg_height_m: a leg's height.
        leg_shapes: weights of `round`, `square`, `splayed`, `bun`, `sled`.
        caster_m: diameter of casters' wheels.
        wall: what a cabinet hangs on that does not stand.
        wall_height_m: height above the ground of what hangs on a wall.
        drawer_height_m: height of a drawer's opening.
        drawer_width_m: width of a drawer's opening.
        door_width_m: width of a door's opening.
        door_height_m: height of a door's opening.
        flap_width_m: width of a flap's opening.
        flap_height_m: height of a flap's opening.
        door_limit_deg: how far doors open.
        flap_limit_deg: how far flaps open.
        travel_fraction: how far drawers open, relative to the depth of their boxes.
        travel_m: how far drawers open, which narrows `travel_fraction` where both cannot hold.
        strips: weights of what stands above or below a region: `drawers` (one row), `open`, `blind`.
        strip_below_probability: how often it stands below.
        max_moving: most doors and drawers of one cabinet.
        max_collisions: most collision shapes of one cabinet.
        handle: see there.
    """

    families: tuple[CabinetFamilyConfig, ...]
    held_out: tuple[str, ...]
    panel_m: Range
    back_m: Range
    front_m: Range
    gap_m: Range
    frame_m: Range
    plank_m: Range
    slat_m: Range
    knuckle_m: Range
    plinth_height_m: Range
    leg_height_m: Range
    leg_shapes: dict[str, float]
    caster_m: Range
    wall: WallConfig
    wall_height_m: Range
    drawer_height_m: Range
    drawer_width_m: Range
    door_width_m: Range
    door_height_m: Range
    flap_width_m: Range
    flap_height_m: Range
    door_limit_deg: Range
    flap_limit_deg: Range
    travel_fraction: Range
    travel_m: Range
    strips: dict[str, float]
    strip_below_probability: float
    max_moving: int
    max_collisions: int
    handle: HandleConfig

    def __post_init__(self) -> None:
        check_ranges(self, "cabinet")
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
