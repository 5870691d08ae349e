"""From a random generator to a `ChairSpec`: family, kinds of parts, sizes, springs and masses."""

import math

import numpy as np

from artiskill.assets.chairs.appearance import sample_chair_appearance
from artiskill.assets.chairs.base import hub_top_m
from artiskill.assets.chairs.column import tube_top_m
from artiskill.assets.chairs.config import ChairConfig, ChairFamilyConfig, MassConfig
from artiskill.assets.chairs.sample_lower import draw_base, draw_casters, draw_column
from artiskill.assets.chairs.sample_upper import draw_arms, draw_back, draw_seat
from artiskill.assets.chairs.spec import Arms, Back, Base, Casters, ChairSpec, Column, Masses, Mechanism, Seat
from artiskill.assets.generators import Range, chance, pick, within
from artiskill.errors import AssetError

MAX_DRAWS = 500
_LEAST_COLUMN_M = 0.06  # between the hub and the mechanism
_LEAST_PISTON_M = 0.02
_RING_CLEAR_M = 0.03  # between the ring for the feet and what is above and below it
_TILT_SPREAD_RAD = 0.5  # preload over stiffness of a tilt's spring: nearly constant over its range
_CANTILEVER_SPREAD_RAD = 0.12
_CANTILEVER_TILT_DEG = (4.0, 7.0)
_CANTILEVER_MOMENT_N_M = (55.0, 90.0)  # bent steel tube gives way little under the seat's own weight


def sample_chair(rng: np.random.Generator, config: ChairConfig, held_out: bool = False) -> ChairSpec:
    """Draw one chair; draws that break a rule (too high, too heavy, no room) are drawn again.

    Args:
        rng: draws.
        config: from what.
        held_out: whether only held-out families are drawn; otherwise none of them is.

    Raises:
        AssetError: the config leaves (nearly) no legal chair.
    """
    families = {f.name: f for f in config.families if f.held_out == held_out}
    family = families[pick(rng, {name: f.weight for name, f in families.items()})]
    for _ in range(MAX_DRAWS):
        spec = _draw_spec(rng, config, family)
        if _is_legal(spec, config):
            return spec
    raise AssetError(
        f"no legal chair of family {family.name!r} in {MAX_DRAWS} draws: "
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
    free = spec.mechanism_bottom_m - hub_top_m(spec)
    if free < _LEAST_COLUMN_M or spec.mechanism_bottom_m - tube_top_m(spec) < _LEAST_PISTON_M:
        return False
    if spec.column.footrest_m == 0:
        return True
    ring = spec.column.footrest_height_m
    return hub_top_m(spec) + _RING_CLEAR_M <= ring <= tube_top_m(spec) - _RING_CLEAR_M


def _arms_fit(spec: ChairSpec) -> bool:
    """Arms from the back need a back at their height."""
    if spec.arms.kind != "cantilever":
        return True
    low, high = spec.back.gap_m + 0.03, spec.back.gap_m + 0.9 * spec.back.height_m
    return low <= spec.arms.height_m <= high


def _draw_spec(rng: np.random.Generator, config: ChairConfig, family: ChairFamilyConfig) -> ChairSpec:
    structure, cover = pick(rng, family.structures), pick(rng, family.covers)
    seat = draw_seat(rng, config, family, cover)
    base = draw_base(rng, config, pick(rng, family.bases), structure, seat)
    casters = draw_casters(rng, config, family, base.legs)
    column = draw_column(rng, config, family, seat) if base.kind in ("star", "disc") else None
    tilt = pick(rng, family.tilts)
    back = draw_back(rng, config, family, seat, cover)
    if back.kind in ("none", "slats") and tilt in ("back", "both"):
        tilt = "seat"
    arms = draw_arms(rng, config, family, reclines=tilt in ("back", "both"))
    mechanism = _draw_mechanism(rng, config, base, tilt)
    masses = _draw_masses(rng, config.masses, structure, (base, casters, column, mechanism, seat, back, arms))
    appearance = sample_chair_appearance(rng, structure, cover, back.kind)  # type: ignore[arg-type]
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


_Parts = tuple[Base, Casters | None, Column | None, Mechanism, Seat, Back, Arms]


def _draw_masses(rng: np.random.Generator, config: MassConfig, structure: str, parts: _Parts) -> Masses:
    """Masses from what is made of what, and how large it is."""
    base, _, column, _, seat, back, arms = parts
    standing = {"star": config.base_kg[structure], "disc": config.disc_kg}.get(base.kind, config.frame_kg)
    whole = within(rng, standing, 3) + (within(rng, config.tube_kg, 3) if column is not None else 0.0)
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
