"""`BucketSpec`: every resolved number of one bucket, from which it is built without further choices of form.

Lengths are metres in the object frame: z is the bucket's axis, the bail's pivots lie at -y and +y, the ground is
z = 0. Half widths are measured along y; across flat sides that is the distance of the flats from the axis.
"""

from dataclasses import dataclass
from typing import Literal

from artiskill.assets.finishes import Surface

MaterialKind = Literal["plastic", "galvanised", "enamel", "wood"]
SectionKind = Literal["round", "square", "hexagon", "octagon", "oval"]
ProfileKind = Literal["straight", "stepped", "ribbed", "bellied", "flared"]
FootKind = Literal["flat", "skirt", "ring"]
LipKind = Literal["rolled", "flange", "collar", "plain"]
BailKind = Literal["wire", "moulded", "strap"]
GripKind = Literal["barrel", "sleeve", "bare"]
EarKind = Literal["boss", "tab", "loop"]


@dataclass(frozen=True)
class Section:
    """The outline seen from above."""

    kind: SectionKind  # polygons have flat sides towards -y and +y
    corner: float  # radius of a polygon's corners, relative to the half width
    aspect: float  # half depth along x over half width along y; 1 for all but ovals


@dataclass(frozen=True)
class Profile:
    """The outer face of the wall, from its lower edge to the rim."""

    kind: ProfileKind
    knots: tuple[tuple[float, float], ...]  # heights and half widths, bottom to top, joined by straight lines
    levels: tuple[float, ...]  # heights between which collision walls are straight: lower edge, breaks, rim


@dataclass(frozen=True)
class Foot:
    """What it stands on: its `flat` floor, a `skirt` (the wall runs below the floor) or an inset `ring`."""

    kind: FootKind
    height_m: float
    inset_m: float


@dataclass(frozen=True)
class Lip:
    """The rim: how far it stands out from the wall, and how high it is; a `plain` one is the wall's own edge."""

    kind: LipKind
    overhang_m: float
    height_m: float


@dataclass(frozen=True)
class Hoop:
    """A band around the wall, between two heights."""

    z0: float
    z1: float


@dataclass(frozen=True)
class BailGrip:
    """What the hand holds: a wooden `barrel`, a plastic `sleeve`, or the `bare` bail."""

    kind: GripKind
    length_m: float
    radius_m: float


@dataclass(frozen=True)
class Bail:
    """The hinged handle, upright in the plane x = 0 at joint value 0."""

    kind: BailKind  # round `wire`, `moulded` plastic bow or a flat `strap`
    pivot_z: float  # height of the pivots
    half_span_m: float  # of its arms, along y
    reach_m: float  # from the pivots' line to the middle of the grip
    corner_m: float  # radius of its two bends
    half_width_m: float  # of its section along x when upright
    half_thickness_m: float  # of its section across that; equal to the half width for a wire
    limit_rad: float  # it turns so far to either side
    grip: BailGrip


@dataclass(frozen=True)
class Ear:
    """Two fittings at -y and +y: a moulded `boss` or a metal `tab` for the bail, or a `loop` to lift by."""

    kind: EarKind
    z: float  # height of its middle; that of the pivot where there is a bail
    reach_m: float  # how far it stands out, from the axis
    half_width_m: float  # along x
    radius_m: float  # of a boss's round end, of a loop's rod; half the thickness of a tab


@dataclass(frozen=True)
class BucketAppearance:
    """The surfaces of one bucket."""

    wall: Surface
    inside: Surface
    lip: Surface
    ear: Surface
    bail: Surface
    grip: Surface


@dataclass(frozen=True)
class BucketSpec:
    """One bucket; see the module's docstring for frames and units."""

    family: str
    held_out: bool  # whether the family is kept from training and test objects
    material: str  # one of `MaterialKind`
    section: Section
    profile: Profile
    foot: Foot
    lip: Lip
    ear: Ear
    height_m: float  # from the ground to the rim
    wall_m: float  # thickness as drawn
    floor_m: float  # thickness as drawn
    spout_m: float  # how far the rim is drawn out at the front, 0 for none
    staves: int  # number of staves of a wooden wall, else 0
    hoops: tuple[Hoop, ...]
    bail: Bail | None  # None where there are only ears
    body_kg: float  # without the bail
    bail_kg: float  # 0 where there is none
    appearance: BucketAppearance

    @property
    def top_m(self) -> float:
        """Half width of the wall at the rim, without the lip."""
        return self.profile.knots[-1][1]

    @property
    def floor_z(self) -> float:
        """Height of the floor's upper face."""
        return self.foot.height_m + self.floor_m
