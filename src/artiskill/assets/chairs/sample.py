"""From a random generator to a `ChairSpec`: family, kinds of parts, sizes, springs, masses and surfaces."""

import math
from typing import Any

import numpy as np

from artiskill.assets.chairs.config import ChairConfig, ChairFamilyConfig, MassConfig
from artiskill.assets.chairs.spec import (
    ArmKind,
    Arms,
    Back,
    BackKind,
    Base,
    CasterKind,
    Casters,
    ChairAppearance,
    ChairSpec,
    Column,
    Headrest,
    Masses,
    Mechanism,
    Seat,
    SeatKind,
)
from artiskill.assets.finishes import Finish, Surface, sample_surface
from artiskill.assets.generators import Range, chance, pick, pick_family, within
from artiskill.errors import AssetError

_MAX_DRAWS = 500
_LEAST_COLUMN_M = 0.06  # between the hub and the mechanism
_LEAST_PISTON_M = 0.02
_RING_CLEAR_M = 0.03  # between the ring for the feet and what is above and below it
_TILT_SPREAD_RAD = 0.5  # preload over stiffness of a tilt's spring: nearly constant over its range
_CANTILEVER_SPREAD_RAD = 0.12
_CANTILEVER_TILT_DEG = (4.0, 7.0)
_CANTILEVER_MOMENT_N_M = (55.0, 90.0)  # bent steel tube gives way little under the seat's own weight
# Diameters sold: twin wheels 40-65 mm, single ones 50-75, balls 40-60; trail relative to the diameter.
_DIAMETERS_M = {"twin": (0.040, 0.065), "single": (0.050, 0.075), "ball": (0.040, 0.060)}
_TRAIL_SHARE = (0.42, 0.62)
_LIFT_PRELOAD_M = (0.06, 0.12)  # how far a lift's spring is compressed at its lower end
_RADIUS_PER_HEIGHT = 0.5  # least radius of a base, relative to the seat's height
_FOOTREST_FROM_M = 0.55  # height of a seat from which feet need a ring
_SOFT = ("fabric", "leather")
_MOST_FALL = 0.6  # of its thickness, that a seat's edge may sink
_SEAT_EXPONENT = {"square": (4.5, 8.0), "waterfall": (4.0, 7.0), "round": (2.0, 2.0), "saddle": (2.6, 4.0)}
_BACK_EXPONENT = {"low": (3.0, 6.0), "high": (4.0, 8.0), "mesh": (3.5, 6.0), "curved": (3.0, 5.5)}
_SHELL_THICK_M = 0.016  # added to a shell that is upholstered
_DARK_PLASTIC = ("black", "black", "grey")
_BRIGHT_METAL = ("chrome", "brushed_steel", "brushed_steel", "nickel", "nickel")
_WARM_WOOD = ("oak", "beech", "cherry", "walnut", "teak", "wenge")
_SLATS = ("black", "black", "grey", "light_grey", "white", "white", "beige", "sky", "red", "blue")
_TREADS = ("black", "grey", "light_grey")


def sample_chair(rng: np.random.Generator, config: ChairConfig, held_out: bool = False) -> ChairSpec:
    """Draw one chair; draws that break a rule (too high, too heavy, no space) are drawn again.

    Args:
        rng: draws.
        config: from what.
        held_out: whether only held-out families are drawn; otherwise none of them is.

    Raises:
        AssetError: the config leaves (nearly) no legal chair.
    """
    family = pick_family(rng, config.families, held_out)
    for _ in range(_MAX_DRAWS):
        spec = _draw_spec(rng, config, family)
        if _is_legal(spec, config):
            return spec
    raise AssetError(
        f"no legal chair of family {family.name!r} in {_MAX_DRAWS} draws: "
        "the ranges of the chair config contradict each other"
    )


def _is_legal(spec: ChairSpec, config: ChairConfig) -> bool:
    low, high = _height_limits(spec.back, config)
    if not (low <= spec.top_m <= high and config.mass_kg[0] <= spec.mass_kg <= config.mass_kg[1]):
        return False
    return _arms_fit(spec) and (spec.column is None or _column_fits(spec))


def _height_limits(back: Back, config: ChairConfig) -> Range:
    if back.kind == "none":
        return config.stool_height_m
    return config.height_m if back.headrest is None else config.headrest_height_m


def _column_fits(spec: ChairSpec) -> bool:
    assert spec.column is not None
    free = spec.mechanism_bottom_m - spec.hub_top_m
    if free < _LEAST_COLUMN_M or spec.mechanism_bottom_m - spec.tube_top_m < _LEAST_PISTON_M:
        return False
    if spec.column.footrest_m == 0:
        return True
    ring = spec.column.footrest_height_m
    return spec.hub_top_m + _RING_CLEAR_M <= ring <= spec.tube_top_m - _RING_CLEAR_M


def _arms_fit(spec: ChairSpec) -> bool:
    """Arms from the back need a back at their height."""
    if spec.arms.kind != "cantilever":
        return True
    low, high = spec.back.gap_m + 0.03, spec.back.gap_m + 0.9 * spec.back.height_m
    return low <= spec.arms.height_m <= high


def _draw_spec(rng: np.random.Generator, config: ChairConfig, family: ChairFamilyConfig) -> ChairSpec:
    structure, cover = pick(rng, family.structures), pick(rng, family.covers)
    seat = _draw_seat(rng, config, family, cover)
    base = _draw_base(rng, config, pick(rng, family.bases), structure, seat)
    casters = _draw_casters(rng, config, family, base.legs)
    column = _draw_column(rng, config, family, seat) if base.kind in ("star", "disc") else None
    tilt = pick(rng, family.tilts)
    back = _draw_back(rng, config, family, seat, cover)
    if back.kind in ("none", "slats") and tilt in ("back", "both"):
        tilt = "seat"
    arms = _draw_arms(rng, config, family, reclines=tilt in ("back", "both"))
    mechanism = _draw_mechanism(rng, config, base, tilt)
    base_kg = {"star": config.masses.base_kg[structure], "disc": config.masses.disc_kg}
    masses = _draw_masses(
        rng, config.masses, base, base_kg.get(base.kind, config.masses.frame_kg), column, seat, back, arms
    )
    appearance = _draw_appearance(rng, structure, cover, back.kind)  # type: ignore[arg-type]
    return ChairSpec(
        family=family.name,
        held_out=family.held_out,
        base=base,
        casters=casters,
        column=column,
        mechanism=mechanism,
        seat=seat,
        back=back,
        arms=arms,
        masses=masses,
        appearance=appearance,
    )


def _draw_seat(rng: np.random.Generator, config: ChairConfig, family: ChairFamilyConfig, cover: str) -> Seat:
    """Draw the seat; `cover` is what it is covered with or made of."""
    kind: SeatKind = pick(rng, family.seats)  # type: ignore[assignment]
    soft = cover in _SOFT
    sizes = config.seats[kind]
    thickness = within(rng, sizes.thickness_m if soft or kind == "saddle" else config.hard_seat_m)
    width, depth = within(rng, family.seat_width_m), within(rng, family.seat_depth_m)
    if kind == "round":
        depth = width = round((width + depth) / 2, 4)
    return Seat(
        kind=kind,
        width_m=width,
        depth_m=depth,
        height_m=within(rng, family.seat_height_m),
        thickness_m=thickness,
        exponent=within(rng, _SEAT_EXPONENT[kind], 2),
        edge_m=within(rng, (0.014, 0.030)) if soft else 0.006,
        shape_m=min(within(rng, sizes.shape_m), round(_MOST_FALL * thickness, 4)),
        soft=soft,
    )


def _draw_base(rng: np.random.Generator, config: ChairConfig, kind: Any, structure: str, seat: Seat) -> Base:
    """Draw the base; `structure` is what it is made of."""
    if kind in ("star4", "star5"):
        return _draw_star(rng, config, int(kind[-1]), structure, seat.height_m)
    if kind == "disc":
        radius, rise, tube = within(rng, (0.215, 0.265)), within(rng, (0.03, 0.08)), within(rng, (0.024, 0.032))
        return Base("disc", 0, radius, (0.0, 0.0), (0.0, 0.0), tube, rise, False, True, 0.0)
    tube = within(rng, (0.022, 0.028))
    narrower, length = ((0.02, 0.05), (0.24, 0.28)) if kind == "sled" else ((0.03, 0.06), (0.235, 0.265))
    spread = round(seat.width_m - within(rng, narrower), 4)
    return Base(kind, 0, within(rng, length), (spread,) * 2, (tube,) * 2, 0.0, 0.0, False, True, 0.0)


def _draw_star(
    rng: np.random.Generator, config: ChairConfig, legs: int, structure: str, seat_height_m: float
) -> Base:
    low, high = config.base_radius_m
    # a high seat needs a wide base, and four legs must reach farther than five for the same support
    least = max(low, _RADIUS_PER_HEIGHT * seat_height_m, (low + high) / 2 if legs == 4 else 0.0)
    radius = within(rng, (min(least, high), high))
    is_round = structure == "metal" and chance(rng, 0.25)
    thick = {"plastic": (0.046, 0.060), "metal": (0.034, 0.050), "wood": (0.044, 0.058)}[structure]
    wide = {"plastic": (0.052, 0.066), "metal": (0.040, 0.058), "wood": (0.046, 0.060)}[structure]
    tip_width, tip_height = within(rng, (0.032, 0.040)), within(rng, (0.024, 0.032))
    width, height = within(rng, wide), within(rng, thick)
    if is_round:
        width = height = within(rng, (0.028, 0.036))
        tip_width = tip_height = round(width * within(rng, (0.8, 1.0)), 4)
    low = max((height - tip_height) / 2, 0.0)  # the underside must not fall towards the hub
    return Base(
        kind="star",
        legs=legs,
        radius_m=radius,
        leg_width_m=(width, tip_width),
        leg_height_m=(height, tip_height),
        hub_radius_m=within(rng, (0.036, 0.050)),
        rise_m=round(low + within(rng, (0.004, 0.055)), 4),
        arched=chance(rng, 0.5),
        round=is_round,
        turn_rad=within(rng, (0.0, 2 * math.pi / legs)),
    )


def _draw_casters(
    rng: np.random.Generator, config: ChairConfig, family: ChairFamilyConfig, legs: int
) -> Casters | None:
    """Draw the casters of a star base; None where there are no legs."""
    if legs == 0:
        return None
    kind: CasterKind = pick(rng, family.casters)  # type: ignore[assignment]
    low, high = _DIAMETERS_M[kind]
    diameter = within(rng, (max(low, config.caster_diameter_m[0]), min(high, config.caster_diameter_m[1])), 3)
    width = {"twin": (0.80, 0.94), "single": (0.36, 0.46), "ball": (0.9, 0.9)}[kind]
    trail = diameter * within(rng, _TRAIL_SHARE)
    trail = round(min(max(trail, config.caster_trail_m[0]), config.caster_trail_m[1]), 4)
    # parked together after a push, or each its own way
    together, spread = within(rng, (-math.pi, math.pi)), 0.35 if chance(rng, 0.3) else math.pi
    yaws = tuple(round(together + float(rng.uniform(-spread, spread)), 4) for _ in range(legs))
    split = kind == "twin" and chance(rng, config.split_probability)
    return Casters(kind, diameter, round(diameter * within(rng, width), 4), trail, split, yaws)


def _draw_column(rng: np.random.Generator, config: ChairConfig, family: ChairFamilyConfig, seat: Seat) -> Column:
    """Draw the column; its ring for the feet is only drawn under high seats."""
    travel = within(rng, config.lift_travel_m) if chance(rng, config.lift_probability) else 0.0
    force, compressed = within(rng, config.lift_force_n, 0), within(rng, _LIFT_PRELOAD_M)
    ring = chance(rng, family.footrest_probability) and seat.height_m > _FOOTREST_FROM_M
    radius, height = within(rng, (0.17, 0.205)), within(rng, (0.20, 0.25))
    return Column(
        tube_m=within(rng, (0.024, 0.028)),
        piston_m=within(rng, (0.013, 0.016)),
        top_share=within(rng, (0.45, 0.75)),
        cover=chance(rng, 0.35),
        travel_m=travel,
        force_n=force,
        stiffness_n_m=round(force / compressed, 0),
        footrest_m=radius if ring else 0.0,
        footrest_height_m=height if ring else 0.0,
    )


def _draw_back(
    rng: np.random.Generator, config: ChairConfig, family: ChairFamilyConfig, seat: Seat, cover: str
) -> Back:
    """Draw the back; of kind `none` where there is none."""
    kind: BackKind = pick(rng, family.backs)  # type: ignore[assignment]
    sizes = config.backs[kind]
    soft = cover in _SOFT and kind in ("low", "high", "curved")
    thickness = within(rng, sizes.thickness_m)
    if kind == "curved" and soft:
        thickness = round(thickness + _SHELL_THICK_M, 4)
    if kind in ("low", "high") and not soft:
        thickness = round(0.4 * thickness, 4)
    narrow = min(within(rng, sizes.width_m), seat.width_m + 0.01)
    taper = within(rng, (0.0, 0.16))
    if kind == "slats":
        taper = within(rng, (-0.08, 0.04))
        if seat.kind in ("round", "saddle"):  # uprights stand on the seat, which ends sooner at its sides
            narrow, taper = round(0.54 * seat.width_m, 4), within(rng, (-0.65, -0.40))
    upright = kind == "slats" and (chance(rng, 0.45) or taper < -0.2)
    return Back(
        kind=kind,
        width_m=round(narrow, 4),
        height_m=within(rng, sizes.height_m),
        gap_m=within(rng, sizes.gap_m),
        thickness_m=thickness,
        lean_rad=round(math.radians(within(rng, sizes.lean_deg, 2)), 4),
        wrap_m=within(rng, sizes.wrap_m),
        lumbar_m=within(rng, (0.0, 0.008)) if kind in ("high", "mesh", "curved") else 0.0,
        exponent=within(rng, _BACK_EXPONENT.get(kind, (4.0, 4.0)), 2),
        taper=taper,
        slats=int(rng.integers(3, 7)) if kind == "slats" else 0,
        upright=upright,
        rolls=int(rng.integers(2, 5)) if kind == "high" and soft and chance(rng, 0.5) else 1,
        soft=soft,
        headrest=_draw_headrest(rng) if chance(rng, family.headrest_probability) else None,
    )


def _draw_headrest(rng: np.random.Generator) -> Headrest:
    width, height = within(rng, (0.22, 0.29)), within(rng, (0.10, 0.14))
    return Headrest(width, height, within(rng, (0.030, 0.050)), within(rng, (0.015, 0.035)))


def _draw_arms(rng: np.random.Generator, config: ChairConfig, family: ChairFamilyConfig, reclines: bool) -> Arms:
    """Draw the armrests; a back that leans back by itself carries none, and none may stand in its way."""
    weights = dict(family.arms)
    if reclines:
        weights = {name: weight for name, weight in weights.items() if name != "loop"}
    kind: ArmKind = pick(rng, weights)  # type: ignore[assignment]
    return Arms(
        kind=kind,
        height_m=within(rng, config.arm_height_m),
        clear_m=within(rng, config.arm_clear_m),
        length_m=within(rng, config.arm_length_m),
        width_m=within(rng, (0.050, 0.085)),
        thickness_m=within(rng, (0.022, 0.034)),
        padded=chance(rng, 0.6),
    )


def _draw_mechanism(rng: np.random.Generator, config: ChairConfig, base: Base, tilt: str) -> Mechanism:
    leans, reclines = tilt in ("seat", "both"), tilt in ("back", "both")
    tilt_deg, moment = within(rng, config.tilt_deg, 2), within(rng, config.tilt_moment_n_m, 1)
    spread = _TILT_SPREAD_RAD
    if base.kind == "cantilever":
        tilt_deg, moment = within(rng, _CANTILEVER_TILT_DEG, 2), within(rng, _CANTILEVER_MOMENT_N_M, 1)
        spread = _CANTILEVER_SPREAD_RAD
    recline_deg, recline_moment = within(rng, config.recline_deg, 2), within(rng, config.tilt_moment_n_m, 1)
    boxed = leans or reclines
    return Mechanism(
        length_m=within(rng, (0.17, 0.21)),
        width_m=within(rng, (0.11, 0.15)),
        height_m=within(rng, (0.040, 0.052) if boxed else (0.018, 0.028)),
        pivot_m=within(rng, (0.03, 0.06)),
        tilt_rad=round(math.radians(tilt_deg), 4) if leans else 0.0,
        tilt_moment_n_m=moment,
        tilt_stiffness_n_m=round(moment / spread, 1),
        recline_rad=round(math.radians(recline_deg), 4) if reclines else 0.0,
        recline_moment_n_m=recline_moment,
        recline_stiffness_n_m=round(recline_moment / _TILT_SPREAD_RAD, 1),
        lever=boxed and base.kind == "star" and chance(rng, 0.8),
    )


def _draw_masses(
    rng: np.random.Generator,
    config: MassConfig,
    base: Base,
    base_kg: Range,
    column: Column | None,
    seat: Seat,
    back: Back,
    arms: Arms,
) -> Masses:
    """Draw masses from what is made of what, and how large it is."""
    whole = within(rng, base_kg, 3) + (within(rng, config.tube_kg, 3) if column is not None else 0.0)
    rail = 0.0
    if base.kind == "cantilever":  # the seat's side rails are part of the frame
        whole, rail = 0.6 * whole, 0.4 * whole
    outline = 0.8 if seat.kind == "round" else 0.95
    cushion = within(rng, config.seat_kg_m2, 2) * outline * seat.width_m * seat.depth_m
    panel = within(rng, config.back_kg_m2, 2) * back.width_m * back.height_m + 0.6
    pads, headrest = within(rng, config.arms_kg, 3), within(rng, config.headrest_kg, 3)
    return Masses(
        base=round(whole, 3),
        caster=within(rng, config.caster_kg),
        wheel=within(rng, config.wheel_kg),
        piston=within(rng, config.piston_kg, 3) if column is not None else 0.0,
        mechanism=within(rng, config.mechanism_kg, 3) if base.kind != "cantilever" else 0.0,
        seat=round(cushion + rail + (pads if arms.kind in ("tee", "loop") else 0.0), 3),
        back=round(
            (panel if back.kind != "none" else 0.0)
            + (headrest if back.headrest is not None else 0.0)
            + (pads if arms.kind == "cantilever" else 0.0),
            3,
        ),
    )


def _draw_appearance(
    rng: np.random.Generator, structure: Finish, cover: Finish, back_kind: str
) -> ChairAppearance:
    """Draw surfaces that go together.

    `structure` is what base and frame are made of: plastic, metal or wood; `cover` what seat and back are covered
    with or made of. A net is woven whatever the seat is, slats are not.
    """
    base = _draw_structure(rng, structure)
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
        tube=_draw_tube(rng, structure),
        piston=sample_surface(rng, "metal", ("chrome", "brushed_steel", "black_iron")),
        seat=seat,
        back=back,
        shell=shell,
        frame=frame,
        pad=base if structure == "wood" else _draw_pad(rng, seat, dark),
    )


def _draw_structure(rng: np.random.Generator, structure: Finish) -> Surface:
    if structure == "wood":
        return sample_surface(rng, "wood", _WARM_WOOD)
    if structure == "plastic":
        return sample_surface(rng, "plastic", ("black", "black", "black", "grey", "light_grey", "white"))
    if rng.random() < 0.35:
        return sample_surface(rng, "paint", ("black", "black", "white", "anthracite", "light_grey"))
    return sample_surface(rng, "metal", _BRIGHT_METAL)


def _draw_tube(rng: np.random.Generator, structure: Finish) -> Surface:
    if structure == "metal" and rng.random() < 0.5:
        return sample_surface(rng, "metal", _BRIGHT_METAL)
    return sample_surface(rng, "plastic", ("black",))


def _draw_pad(rng: np.random.Generator, seat: Surface, dark: Surface) -> Surface:
    """Draw the armrests' tops: of leather chairs most are leather too, of others dark plastic."""
    if seat.finish == "leather" and rng.random() < 0.7:
        return seat
    return dark
