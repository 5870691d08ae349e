"""Draws what a cabinet's parts share: fronts, top, support, handles, and how its doors and drawers are made."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from artiskill.assets.cabinets.config import CabinetConfig, CabinetFamilyConfig, HandleConfig
from artiskill.assets.cabinets.pulls import FLAT_BAR_M, HEADS, STRAP_M
from artiskill.assets.cabinets.spec import BUMPER_M, FrontStyle, HandleKind, HandleModel, Support, Top
from artiskill.assets.finishes import GRAIN_TILE_M
from artiskill.assets.generators import pick, within

_FRAMED = ("shaker", "raised", "glazed", "louvred")
# A top ends at most so far before the fronts' face: a hand on the uppermost handle must not meet it.
_OVER_FACE_M = (0.001, 0.008)
_CORNICE_STEP_M = (0.012, 0.02)
_DOOR_KINDS: tuple[HandleKind, ...] = ("bar", "bow", "knob")  # beside another kind on the drawers


@dataclass(frozen=True)
class CabinetStyle:
    """What the doors and drawers of one cabinet share, so that they look and move like a set."""

    depth_m: float  # of the carcass
    back_m: float  # thickness of its back panel
    front: FrontStyle  # look of the front panels
    drawer_handle: HandleModel
    door_handle: HandleModel
    centres_m: float  # distance of a handle's posts where the front is large enough
    # how far below a high drawer front's upper edge its handle sits; None: in the middle
    drawer_drop_m: float | None
    door_vertical: bool  # whether doors' handles stand upright
    door_level: Literal["upper", "middle", "lower"]  # where on the doors' height their handles sit
    door_margin_m: float  # from the handle's end to the door's upper or lower edge
    door_edge_m: float  # from an upright handle's axis to the door's free edge
    door_limit_rad: float  # how far doors open where nothing is in the way
    flap_limit_rad: float  # how far flaps open where nothing is in the way
    travel_fraction: float  # how far drawers open, relative to their boxes' depth
    box_fraction: float  # how much of the room above a drawer's floor its sides take up
    lip_fraction: float  # length of lips, relative to their front
    lips_low: bool  # whether lips run along the lower edges
    slot_length_m: float  # length of the cavities of flush bars


def draw_style(
    rng: np.random.Generator,
    config: CabinetConfig,
    front: FrontStyle,
    handles: tuple[HandleModel, HandleModel],
    support: Support,
    depth_m: float,
    back_m: float,
) -> CabinetStyle:
    """Draw a cabinet's style; `handles` are of drawers and of doors, the rest is as in `CabinetStyle`."""
    edge = config.handle.edge_m
    door, flap = (math.radians(rng.uniform(*limit)) for limit in (config.door_limit_deg, config.flap_limit_deg))
    drop = float(rng.uniform(0.06, 0.085))
    hung = support.kind == "wall"
    level = rng.random()
    low_end: Literal["upper", "lower"] = "lower" if hung else "upper"
    return CabinetStyle(
        depth_m=depth_m,
        back_m=back_m,
        front=front,
        drawer_handle=handles[0],
        door_handle=handles[1],
        centres_m=float(rng.choice(config.handle.centres_m)),
        drawer_drop_m=drop if rng.random() < 0.4 else None,
        door_vertical=bool(rng.random() < 0.85),
        door_level=low_end if level < 0.6 else "middle",
        door_margin_m=float(rng.uniform(0.05, 0.09)),
        # on a framed door in the middle of the frame's stile
        door_edge_m=max(edge, front.frame_m / 2) if front.frame_m > 0 else edge + float(rng.uniform(0.0, 0.015)),
        door_limit_rad=door,
        flap_limit_rad=flap,
        travel_fraction=float(rng.uniform(*config.travel_fraction)),
        box_fraction=float(rng.uniform(0.6, 1.0)),
        lip_fraction=float(rng.uniform(0.3, 0.8)),
        lips_low=hung and bool(rng.random() < 0.5),
        slot_length_m=float(rng.uniform(*config.handle.slot_length_m)),
    )


def draw_front(rng: np.random.Generator, config: CabinetConfig, family: CabinetFamilyConfig) -> FrontStyle:
    """Draw how the fronts are made."""
    inset = rng.random() < family.inset_probability
    face = pick(rng, family.faces)
    framed = face in _FRAMED
    return FrontStyle(
        mount="inset" if inset else "overlay",
        face=face,  # type: ignore[arg-type]
        thickness_m=within(rng, config.front_m),
        gap_m=within(rng, config.gap_m),
        frame_m=within(rng, config.frame_m) if framed else 0.0,
        recess_m=within(rng, (0.006, 0.009)) if framed else 0.0,
        muntins=(int(rng.integers(1, 3)), int(rng.integers(1, 5))),
        plank_m=within(rng, config.slat_m if face == "louvred" else config.plank_m),
        bow_m=0.0 if family.bow_m is None else within(rng, family.bow_m),
        knuckle_m=within(rng, config.knuckle_m),
    )


def draw_top(
    rng: np.random.Generator, family: CabinetFamilyConfig, width_m: float, panel_m: float, front: FrontStyle
) -> Top:
    """Draw the top board, flush or overhanging."""
    upstand = within(rng, (0.05, 0.12)) if rng.random() < family.upstand_probability else 0.0
    if rng.random() >= family.overhang_probability:
        return Top(panel_m, 0.0, 0.0, 1, upstand)
    face = front.thickness_m + BUMPER_M if front.mount == "overlay" else 0.0
    over = round(face + within(rng, _OVER_FACE_M), 4)
    steps = int(rng.integers(2, 4)) if rng.random() < family.cornice_probability else 1
    thick = within(rng, (0.018, 0.042)) if steps == 1 else round(steps * within(rng, _CORNICE_STEP_M), 4)
    side = within(rng, (0.002, 0.025) if steps == 1 else (0.012, 0.035))
    most = (GRAIN_TILE_M - width_m) / 2  # no board is longer than a texture
    return Top(thick, over, round(min(side, most), 4), steps, upstand)


def draw_support(
    rng: np.random.Generator, config: CabinetConfig, family: CabinetFamilyConfig, width_m: float
) -> Support:
    """Draw what the cabinet stands or hangs on."""
    kind = pick(rng, family.supports)
    shape = pick(rng, config.leg_shapes)
    leg = within(rng, (0.026, 0.05))
    setback = within(rng, (0.02, 0.06))
    height = within(rng, config.leg_height_m)
    if kind in ("plinth", "sides"):
        return Support(kind, within(rng, config.plinth_height_m), setback, 0.0, "square")  # type: ignore[arg-type]
    if kind == "legs":
        return _legs(shape, height, min(setback, width_m / 8), leg)
    if kind == "casters":
        wheel = within(rng, config.caster_m)
        return Support("casters", round(1.3 * wheel, 4), 0.012, wheel, "round")
    if kind == "wall":
        return Support("wall", within(rng, config.wall_height_m), 0.0, 0.0, "square")
    return Support("floor", 0.0, 0.0, 0.0, "square")


def _legs(shape: str, height: float, setback: float, leg: float) -> Support:
    if shape == "bun":
        return Support("legs", round(0.5 * height, 4), min(setback, 0.03), round(1.5 * leg, 4), "bun")
    if shape == "sled":
        return Support("legs", height, min(setback, 0.035), round(0.6 * leg, 4), "sled")
    if shape == "splayed":
        return Support("legs", height, max(setback, 0.04), round(0.85 * leg, 4), "splayed")
    return Support("legs", height, setback, leg, "round" if shape == "round" else "square")


def draw_handles(
    rng: np.random.Generator, config: HandleConfig, kind: HandleKind
) -> tuple[HandleModel, HandleModel]:
    """Draw the handles of drawers, of this kind, and of doors, which are mostly the same."""
    drawers = _MODELS[kind](rng, config)
    other = rng.random() < config.mixed_probability
    if kind != "cup" and not other:
        return drawers, drawers
    return drawers, _MODELS[_DOOR_KINDS[int(rng.integers(len(_DOOR_KINDS)))]](rng, config)


def _bar(rng: np.random.Generator, c: HandleConfig) -> HandleModel:
    shape, d = pick(rng, c.bar_shapes), within(rng, c.diameter_m)
    projection = _projection(rng, c, FLAT_BAR_M if shape == "flat" else d)
    overhang = d / 2 if rng.random() < 0.4 else within(rng, (0.015, 0.04))
    post = min(d - 0.001, within(rng, (0.007, 0.012)))
    return HandleModel("bar", shape, d, projection, d, round(overhang, 4), round(post, 4))


def _bow(rng: np.random.Generator, c: HandleConfig) -> HandleModel:
    shape, d = pick(rng, c.bow_shapes), within(rng, c.diameter_m)
    if shape != "strap":
        d = round(min(d, 0.014), 4)
    return HandleModel("bow", shape, d, _projection(rng, c, STRAP_M if shape == "strap" else d), d, d / 2, d)


def _projection(rng: np.random.Generator, c: HandleConfig, thickness: float) -> float:
    least = max(c.projection_m[0], thickness + c.clearance_m)
    return within(rng, (least, max(least, c.projection_m[1])))


def _knob(rng: np.random.Generator, c: HandleConfig) -> HandleModel:
    shape, d = pick(rng, c.knob_shapes), within(rng, c.knob_m)
    if shape == "ball":
        d = round(min(d, 0.034), 4)
    head = 0.0 if shape == "cone" else HEADS[shape] * d
    least = max(c.knob_projection_m[0], head + 0.008)
    projection = within(rng, (least, max(least, c.knob_projection_m[1])))
    return HandleModel("knob", shape, d, projection, d, 0.0, round(min(0.45 * d, within(rng, (0.008, 0.016))), 4))


def _ring(rng: np.random.Generator, c: HandleConfig) -> HandleModel:
    wire, outer = within(rng, c.ring_wire_m), within(rng, c.ring_m)
    projection = within(rng, (c.projection_m[0] + 0.003, 0.044))
    return HandleModel("ring", "round", wire, projection, outer, 0.0, within(rng, (0.007, 0.010)))


def _lip(rng: np.random.Generator, c: HandleConfig) -> HandleModel:
    shape = "hooked" if rng.random() < 0.55 else "flat"
    thick = within(rng, c.lip_m)
    if shape == "hooked":
        thick = round(min(thick, 0.005), 4)
    return HandleModel("lip", shape, thick, within(rng, c.lip_projection_m), within(rng, (0.012, 0.024)), 0.0, 0.0)


def _slot(rng: np.random.Generator, c: HandleConfig) -> HandleModel:
    d = within(rng, (c.diameter_m[0], 0.014))
    shape = "square" if rng.random() < 0.5 else "round"
    opening = round(d + 2 * c.slot_room_m, 4)
    return HandleModel("slot", shape, d, within(rng, c.slot_depth_m), opening, 0.0, 0.0)


def _cup(rng: np.random.Generator, c: HandleConfig) -> HandleModel:
    shape = "box" if rng.random() < 0.35 else "shell"
    height = within(rng, c.cup_height_m)
    return HandleModel("cup", shape, height, within(rng, (c.projection_m[0], 0.036)), height, 0.009, 0.0)


_MODELS = {"bar": _bar, "bow": _bow, "knob": _knob, "ring": _ring, "lip": _lip, "slot": _slot, "cup": _cup}
