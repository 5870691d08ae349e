"""Draws what one sits on and leans against: seat, back, armrests."""

import math

import numpy as np

from artiskill.assets.chairs.config import ChairConfig, ChairFamilyConfig
from artiskill.assets.chairs.spec import ArmKind, Arms, Back, BackKind, Headrest, Seat, SeatKind
from artiskill.assets.generators import chance, pick, within

_SOFT = ("fabric", "leather")
_MOST_FALL = 0.6  # of its thickness, that a seat's edge may sink
_SEAT_EXPONENT = {"square": (4.5, 8.0), "waterfall": (4.0, 7.0), "round": (2.0, 2.0), "saddle": (2.6, 4.0)}
_BACK_EXPONENT = {"low": (3.0, 6.0), "high": (4.0, 8.0), "mesh": (3.5, 6.0), "curved": (3.0, 5.5)}
_SHELL_THICK_M = 0.016  # added to a shell that is upholstered


def draw_seat(rng: np.random.Generator, config: ChairConfig, family: ChairFamilyConfig, cover: str) -> Seat:
    """The seat; `cover` is what it is covered with or made of."""
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


def draw_back(
    rng: np.random.Generator, config: ChairConfig, family: ChairFamilyConfig, seat: Seat, cover: str
) -> Back:
    """The back; of kind `none` where there is none."""
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


def draw_arms(rng: np.random.Generator, config: ChairConfig, family: ChairFamilyConfig, reclines: bool) -> Arms:
    """The armrests; a back that leans back by itself carries none, and none may stand in its way."""
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
