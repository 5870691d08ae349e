"""Draws what a chair stands on: base, casters, column."""

import math

import numpy as np

from artiskill.assets.chairs.config import ChairConfig, ChairFamilyConfig
from artiskill.assets.chairs.spec import Base, CasterKind, Casters, Column, Seat
from artiskill.assets.generators import chance, pick, within

# Diameters sold: twin wheels 40-65 mm, single ones 50-75, balls 40-60; trail relative to the diameter.
_DIAMETERS_M = {"twin": (0.040, 0.065), "single": (0.050, 0.075), "ball": (0.040, 0.060)}
_TRAIL_SHARE = (0.42, 0.62)
_LIFT_PRELOAD_M = (0.06, 0.12)  # how far a lift's spring is compressed at its lower end
_RADIUS_PER_HEIGHT = 0.5  # least radius of a base, relative to the seat's height
_FOOTREST_FROM_M = 0.55  # height of a seat from which feet need a ring


def draw_base(rng: np.random.Generator, config: ChairConfig, kind: str, structure: str, seat: Seat) -> Base:
    """The base; `structure` is what it is made of."""
    if kind in ("star4", "star5"):
        return _draw_star(rng, config, int(kind[-1]), structure, seat.height_m)
    if kind == "disc":
        radius, rise, tube = within(rng, (0.215, 0.265)), within(rng, (0.03, 0.08)), within(rng, (0.024, 0.032))
        return Base("disc", 0, radius, (0.0, 0.0), (0.0, 0.0), tube, rise, False, True, 0.0)
    tube = within(rng, (0.022, 0.028))
    if kind == "sled":
        spread = round(seat.width_m - within(rng, (0.02, 0.05)), 4)
        return Base("sled", 0, within(rng, (0.24, 0.28)), (spread,) * 2, (tube,) * 2, 0.0, 0.0, False, True, 0.0)
    spread = round(seat.width_m - within(rng, (0.03, 0.06)), 4)
    return Base(
        "cantilever", 0, within(rng, (0.235, 0.265)), (spread,) * 2, (tube,) * 2, 0.0, 0.0, False, True, 0.0
    )


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


def draw_casters(
    rng: np.random.Generator, config: ChairConfig, family: ChairFamilyConfig, legs: int
) -> Casters | None:
    """The casters of a star base; None where there are no legs."""
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


def draw_column(rng: np.random.Generator, config: ChairConfig, family: ChairFamilyConfig, seat: Seat) -> Column:
    """The column; its ring for the feet is only drawn under high seats."""
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
