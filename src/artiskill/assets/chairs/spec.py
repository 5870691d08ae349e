"""`ChairSpec`: every resolved number of one chair, from which it is built without further choices of form.

Lengths are metres in the object frame: z up from the ground, the chair faces -x, y to the right of whoever sits on
it. The column's axis, or the middle of the frame, is the z axis.
"""

import math
from dataclasses import dataclass
from typing import Literal

from artiskill.assets.chairs.appearance import ChairAppearance

BaseKind = Literal["star", "disc", "sled", "cantilever"]
CasterKind = Literal["twin", "single", "ball"]
SeatKind = Literal["square", "round", "waterfall", "saddle"]
BackKind = Literal["none", "low", "high", "mesh", "curved", "slats"]
ArmKind = Literal["none", "tee", "loop", "cantilever"]

# Room between a wheel's top, the plate or fork crown above it, and the leg above that.
CROWN_GAP_M, CROWN_M, STEM_GAP_M = 0.0015, 0.005, 0.0035
SEAT_GAP_M = 0.004  # between a tilting seat and the mechanism below it


@dataclass(frozen=True)
class Base:
    """What a chair stands on.

    Attributes:
        kind: `star` with legs and casters, `disc`, `sled` (two runners), `cantilever` (no rear legs).
        legs: of a star, else 0.
        radius_m: star: column to caster stem; disc: its radius; frames: half their length along x.
        leg_width_m: star: at the hub and at the tip; frames: distance of the runners, twice.
        leg_height_m: star: at the hub and at the tip; frames: diameter of the tube, twice.
        hub_radius_m: of a star's hub.
        rise_m: how much higher a star's legs meet the hub than the casters; disc: height of the cone.
        arched: whether the legs bend down near the casters.
        round: whether their section is round.
        turn_rad: angle of the first leg about z.
    """

    kind: BaseKind
    legs: int
    radius_m: float
    leg_width_m: tuple[float, float]
    leg_height_m: tuple[float, float]
    hub_radius_m: float
    rise_m: float
    arched: bool
    round: bool
    turn_rad: float


@dataclass(frozen=True)
class Casters:
    """The casters of a star base.

    Attributes:
        kind: two wheels under a hood, one wheel in a fork, or a ball under a cap.
        diameter_m: of the wheels.
        width_m: over the wheel, or over both.
        trail_m: from the swivel axis to the wheel's.
        split: whether the two wheels of a twin caster turn separately.
        yaws_rad: where each wheel stands at joint value 0, seen from its swivel axis.
    """

    kind: CasterKind
    diameter_m: float
    width_m: float
    trail_m: float
    split: bool
    yaws_rad: tuple[float, ...]


@dataclass(frozen=True)
class Column:
    """The column of a star or disc base.

    Attributes:
        tube_m: radius of the outer tube.
        piston_m: radius of the piston in it.
        top_share: where the outer tube ends, from the hub (0) to the mechanism (1).
        cover: whether a telescopic cover hides it.
        travel_m: how far it extends; 0 where it is fixed.
        force_n: with which its spring holds it at its lower end.
        stiffness_n_m: of that spring.
        footrest_m: radius of the ring for the feet; 0 for none.
        footrest_height_m: of that ring.
    """

    tube_m: float
    piston_m: float
    top_share: float
    cover: bool
    travel_m: float
    force_n: float
    stiffness_n_m: float
    footrest_m: float
    footrest_height_m: float


@dataclass(frozen=True)
class Mechanism:
    """The box under the seat, and the springs that let it lean back.

    Attributes:
        length_m, width_m, height_m: of the box.
        pivot_m: the tilt axis' distance behind the column.
        tilt_rad: how far the seat leans back; 0 where it is fixed.
        tilt_moment_n_m, tilt_stiffness_n_m: preload and stiffness of its spring.
        recline_rad: how far the back leans back against the seat; 0 where it is fixed.
        recline_moment_n_m, recline_stiffness_n_m: likewise.
        lever: whether a lever sticks out at the side.
    """

    length_m: float
    width_m: float
    height_m: float
    pivot_m: float
    tilt_rad: float
    tilt_moment_n_m: float
    tilt_stiffness_n_m: float
    recline_rad: float
    recline_moment_n_m: float
    recline_stiffness_n_m: float
    lever: bool


@dataclass(frozen=True)
class Seat:
    """The seat; its middle lies on the column's axis.

    Attributes:
        kind: outline and form.
        width_m, depth_m: along y and x.
        height_m: from the ground to the middle of its top.
        thickness_m: in the middle.
        exponent: of the superellipse that is its outline.
        edge_m: radius of its upper edge.
        shape_m: how far a waterfall's front falls, or a saddle's sides hang.
        soft: whether it is upholstered, on a pan.
    """

    kind: SeatKind
    width_m: float
    depth_m: float
    height_m: float
    thickness_m: float
    exponent: float
    edge_m: float
    shape_m: float
    soft: bool


@dataclass(frozen=True)
class Headrest:
    """A pad above the back, `gap_m` above its edge; None where there is none."""

    width_m: float
    height_m: float
    thickness_m: float
    gap_m: float


@dataclass(frozen=True)
class Back:
    """The back; see `config.BackConfig`.

    Attributes:
        kind: what it is.
        width_m, height_m, thickness_m: of the panel, along it.
        gap_m: from the seat's top to the panel's lower edge.
        lean_rad: from the vertical.
        wrap_m: how far the sides come forward.
        lumbar_m: how far the panel bulges forward at the small of the back.
        exponent: of its outline.
        taper: how much narrower it is at the top, relative.
        slats: number of slats of a slatted back, else 0.
        upright: whether the slats stand upright.
        rolls: into how many horizontal rolls the cushion is sewn, at least 1.
        soft: whether it is upholstered.
        headrest: see there.
    """

    kind: BackKind
    width_m: float
    height_m: float
    gap_m: float
    thickness_m: float
    lean_rad: float
    wrap_m: float
    lumbar_m: float
    exponent: float
    taper: float
    slats: int
    upright: bool
    rolls: int
    soft: bool
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
    def seat_bottom_m(self) -> float:
        """Height of the seat's flat underside."""
        return self.seat.height_m - self.seat.thickness_m

    @property
    def mechanism_top_m(self) -> float:
        """Height of the mechanism's top."""
        return self.seat_bottom_m - SEAT_GAP_M

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
    def mass_kg(self) -> float:
        """Of the whole chair."""
        m, casters = self.masses, self.casters
        count = 0 if casters is None else len(casters.yaws_rad)
        wheels = count * (2 if casters is not None and casters.split else 1)
        return m.base + count * m.caster + wheels * m.wheel + m.piston + m.mechanism + m.seat + m.back

    @property
    def joint_count(self) -> int:
        """How many joints the built chair has."""
        count = int(self.mechanism.tilt_rad > 0) + int(self.mechanism.recline_rad > 0)
        count += self.base.kind != "cantilever"
        count += self.column is not None and self.column.travel_m > 0
        if self.casters is not None:
            count += len(self.casters.yaws_rad) * (3 if self.casters.split else 2)
        return count
