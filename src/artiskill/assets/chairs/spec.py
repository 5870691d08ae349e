"""`ChairSpec`: every resolved number of one chair, from which it is built without further choices of form.

Lengths are metres in the object frame: z up from the ground, the chair faces -x, y to the right of whoever sits on
it. The column's axis, or the middle of the frame, is the z axis.
"""

import math
from dataclasses import dataclass
from typing import Literal

from artiskill.assets.finishes import Surface

BaseKind = Literal["star", "disc", "sled", "cantilever"]
CasterKind = Literal["twin", "single", "ball"]
SeatKind = Literal["square", "round", "waterfall", "saddle"]
BackKind = Literal["none", "low", "high", "mesh", "curved", "slats"]
ArmKind = Literal["none", "tee", "loop", "cantilever"]

# Gaps between a wheel's top, the plate or fork crown above it, and the leg above that.
CROWN_GAP_M, CROWN_M, STEM_GAP_M = 0.0015, 0.005, 0.0035
# Wheels that turn separately lean, as real ones do: each stands on its inner rim, and the pair turns on the spot.
CAMBER_RAD = math.radians(2.0)
WEB_M = 0.008  # between the two wheels of a twin caster
DISC_M = 0.010  # thickness of a disc at its rim
_HUB_RIM_M = 0.012
_SEAT_GAP_M = 0.004  # between a tilting seat and the mechanism below it


@dataclass(frozen=True)
class Base:
    """What a chair stands on."""

    kind: BaseKind  # `star` with legs and casters, `disc`, `sled` (two runners), `cantilever` (no rear legs)
    legs: int  # of a star, else 0
    radius_m: float  # star: column to caster stem; disc: its radius; frames: half their length along x
    leg_width_m: tuple[float, float]  # star: at the hub and at the tip; frames: distance of the runners, twice
    leg_height_m: tuple[float, float]  # star: at the hub and at the tip; frames: diameter of the tube, twice
    hub_radius_m: float  # of a star's hub
    rise_m: float  # how much higher a star's legs meet the hub than the casters; disc: height of the cone
    arched: bool  # whether the legs bend down near the casters
    round: bool  # whether their section is round
    turn_rad: float  # angle of the first leg about z


@dataclass(frozen=True)
class Casters:
    """The casters of a star base."""

    kind: CasterKind  # two wheels under a hood, one wheel in a fork, or a ball under a cap
    diameter_m: float  # of the wheels
    width_m: float  # over the wheel, or over both
    trail_m: float  # from the swivel axis to the wheel's
    split: bool  # whether the two wheels of a twin caster turn separately
    yaws_rad: tuple[float, ...]  # where each wheel stands at joint value 0, seen from its swivel axis

    @property
    def sides(self) -> tuple[int, ...]:
        """One entry per wheel link: 0 for one wheel or a pair in the middle, -1 and 1 for two separate wheels."""
        return (-1, 1) if self.split else (0,)

    @property
    def split_half_m(self) -> float:
        """Half the width of one of two separate wheels."""
        return (self.width_m - WEB_M) / 4

    @property
    def axle_height_m(self) -> float:
        """Height of a wheel's middle when it stands on the ground."""
        radius = self.diameter_m / 2
        if not self.split:
            return radius
        return radius * math.cos(CAMBER_RAD) + self.split_half_m * math.sin(CAMBER_RAD)

    @property
    def wheel_top_m(self) -> float:
        """Height of a wheel's uppermost point."""
        return 2 * self.axle_height_m

    @property
    def stem_height_m(self) -> float:
        """Height of the underside of what a caster is plugged into."""
        return self.wheel_top_m + CROWN_GAP_M + CROWN_M + STEM_GAP_M


@dataclass(frozen=True)
class Column:
    """The column of a star or disc base."""

    tube_m: float  # radius of the outer tube
    piston_m: float  # radius of the piston in it
    top_share: float  # where the outer tube ends, from the hub (0) to the mechanism (1)
    cover: bool  # whether a telescopic cover hides it
    travel_m: float  # how far it extends; 0 where it is fixed
    force_n: float  # with which its spring holds it at its lower end
    stiffness_n_m: float  # of that spring
    footrest_m: float  # radius of the ring for the feet; 0 for none
    footrest_height_m: float  # of that ring


@dataclass(frozen=True)
class Mechanism:
    """The box under the seat, and the preloaded springs that let seat and back lean back."""

    length_m: float
    width_m: float
    height_m: float
    pivot_m: float  # the tilt axis' distance behind the column
    tilt_rad: float  # how far the seat leans back; 0 where it is fixed
    tilt_moment_n_m: float
    tilt_stiffness_n_m: float
    recline_rad: float  # how far the back leans back against the seat; 0 where it is fixed
    recline_moment_n_m: float
    recline_stiffness_n_m: float
    lever: bool  # whether a lever sticks out at the side


@dataclass(frozen=True)
class Seat:
    """The seat; its middle lies on the column's axis."""

    kind: SeatKind  # outline and form
    width_m: float  # along y
    depth_m: float  # along x
    height_m: float  # from the ground to the middle of its top
    thickness_m: float  # in the middle
    exponent: float  # of the superellipse that is its outline
    edge_m: float  # radius of its upper edge
    shape_m: float  # how far a waterfall's front falls, or a saddle's sides hang
    soft: bool  # whether it is upholstered, on a pan


@dataclass(frozen=True)
class Headrest:
    """A pad above the back, `gap_m` above its edge."""

    width_m: float
    height_m: float
    thickness_m: float
    gap_m: float


@dataclass(frozen=True)
class Back:
    """The back; width, height and thickness are those of the panel, along it."""

    kind: BackKind
    width_m: float
    height_m: float
    gap_m: float  # from the seat's top to the panel's lower edge
    thickness_m: float
    lean_rad: float  # from the vertical
    wrap_m: float  # how far the sides come forward
    lumbar_m: float  # how far the panel bulges forward at the small of the back
    exponent: float  # of its outline
    taper: float  # how much narrower it is at the top, relative
    slats: int  # number of slats of a slatted back, else 0
    upright: bool  # whether the slats stand upright
    rolls: int  # into how many horizontal rolls the cushion is sewn, at least 1
    soft: bool  # whether it is upholstered
    headrest: Headrest | None


@dataclass(frozen=True)
class Arms:
    """The armrests: their top's height above the seat's, the clear distance between them, and their own sizes."""

    kind: ArmKind
    height_m: float
    clear_m: float
    length_m: float
    width_m: float
    thickness_m: float
    padded: bool


@dataclass(frozen=True)
class Masses:
    """What the links weigh, kg; a part that shares its link with others adds to that link."""

    base: float
    caster: float
    wheel: float
    piston: float
    mechanism: float
    seat: float
    back: float


@dataclass(frozen=True)
class ChairAppearance:
    """The surfaces of one chair."""

    base: Surface  # legs, disc or frame
    caster: Surface  # hoods and forks
    wheel: Surface  # their treads
    tube: Surface  # the column's outer tube, its cover, the mechanism
    piston: Surface  # the column's inner tube
    seat: Surface  # what one sits on
    back: Surface  # what one leans against
    shell: Surface  # the seat's pan and the back's rear
    frame: Surface  # what carries the back and the armrests
    pad: Surface  # the armrests' tops


@dataclass(frozen=True)
class ChairSpec:
    """One chair; see the module's docstring for frames and units."""

    family: str
    held_out: bool
    base: Base
    casters: Casters | None
    column: Column | None
    mechanism: Mechanism
    seat: Seat
    back: Back
    arms: Arms
    masses: Masses
    appearance: ChairAppearance

    @property
    def hub_middle_m(self) -> float:
        """Height of the middle of a star's hub."""
        assert self.casters is not None, "a star has casters"
        return self.casters.stem_height_m + self.base.leg_height_m[1] / 2 + self.base.rise_m

    @property
    def hub_top_m(self) -> float:
        """Height at which the column comes out of a star's hub or a disc's cone."""
        if self.base.kind == "disc":
            return DISC_M + self.base.rise_m
        return self.hub_middle_m + self.base.leg_height_m[0] / 2 + _HUB_RIM_M

    @property
    def tube_top_m(self) -> float:
        """Height at which the column's outer tube ends."""
        assert self.column is not None, "only a column has a tube"
        return self.hub_top_m + self.column.top_share * (self.mechanism_bottom_m - self.hub_top_m)

    @property
    def seat_bottom_m(self) -> float:
        """Height of the seat's flat underside."""
        return self.seat.height_m - self.seat.thickness_m

    @property
    def mechanism_top_m(self) -> float:
        """Height of the mechanism's top."""
        return self.seat_bottom_m - _SEAT_GAP_M

    @property
    def mechanism_bottom_m(self) -> float:
        """Height of the mechanism's underside."""
        return self.mechanism_top_m - self.mechanism.height_m

    @property
    def top_m(self) -> float:
        """Height of the uppermost point, nearly."""
        back = self.back
        if back.kind == "none":
            return self.seat.height_m
        length = back.height_m
        if back.headrest is not None:
            length += back.headrest.gap_m + back.headrest.height_m
        return self.seat.height_m + back.gap_m + length * math.cos(back.lean_rad)

    @property
    def wheel_counts(self) -> tuple[int, int]:
        """Number of casters, and of wheel links."""
        casters = self.casters
        return (0, 0) if casters is None else (len(casters.yaws_rad), len(casters.yaws_rad) * len(casters.sides))

    @property
    def mass_kg(self) -> float:
        """Of the whole chair."""
        m, (casters, wheels) = self.masses, self.wheel_counts
        return m.base + casters * m.caster + wheels * m.wheel + m.piston + m.mechanism + m.seat + m.back

    @property
    def joint_count(self) -> int:
        """How many joints the built chair has."""
        count = int(self.mechanism.tilt_rad > 0) + int(self.mechanism.recline_rad > 0)
        count += self.base.kind != "cantilever"
        count += self.column is not None and self.column.travel_m > 0
        casters, wheels = self.wheel_counts
        return count + casters + wheels
