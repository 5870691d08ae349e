"""From a random generator to a `CabinetSpec`: sizes, style, layout, joint ranges and where handles sit."""

from typing import TypeGuard

import numpy as np

from artiskill.assets.appearance import CabinetAppearance, sample_cabinet_appearance
from artiskill.assets.cabinets.config import CabinetConfig, FamilyConfig, Range
from artiskill.assets.cabinets.layout import (
    RAIL_DEPTH_M,
    Composer,
    Edge,
    Placed,
    Region,
    draw,
    resolve,
)
from artiskill.assets.cabinets.openings import draw_style, fill_cell
from artiskill.assets.cabinets.spec import Board, CabinetSpec, Cell, FrontStyle, HandleModel, Rect, Support, Top
from artiskill.errors import AssetError

MAX_DRAWS = 500
# Boards within a closed compartment end this far behind its front.
SHELF_SETBACK_M = 0.02
DRAWER_SIDE_M = (0.012, 0.016)
DRAWER_BOTTOM_M = (0.005, 0.008)
# Chipboard P2 600-680 kg/m3, medium density fibreboard 700-780, solid woods: EN 312, EN 622-5, wood handbooks.
DENSITY_KG_M3 = {"board": (620.0, 680.0), "fibreboard": (700.0, 780.0), "solid": (480.0, 720.0)}


def sample_cabinet(rng: np.random.Generator, config: CabinetConfig) -> CabinetSpec:
    """Draw one cabinet; draws that break a rule (no handle within reach, too many parts) are drawn again.

    Raises:
        AssetError: the config leaves (nearly) no legal cabinet.
    """
    for _ in range(MAX_DRAWS):
        spec = _draw_spec(rng, config)
        if spec is not None and _is_legal(spec, config):
            return spec
    raise AssetError(
        f"no legal cabinet in {MAX_DRAWS} draws: the ranges of the cabinet config contradict each other"
    )


def _is_legal(spec: CabinetSpec, config: CabinetConfig) -> bool:
    moving = spec.count("drawer") + spec.count("door")
    return 1 <= moving <= config.max_moving and spec.collision_count <= config.max_collisions


def _draw_spec(rng: np.random.Generator, config: CabinetConfig) -> CabinetSpec | None:
    """One draw, or None where a door or drawer came out illegal."""
    family = _draw_family(rng, config)
    width, depth, height = (_within(rng, r) for r in (family.width_m, family.depth_m, family.height_m))
    panel, back = _within(rng, config.panel_m), _within(rng, config.back_m)
    front = _draw_front(rng, config, family)
    top = _draw_top(rng, family, panel, front)
    support = _draw_support(rng, config, family, width)
    handle = _draw_handle(rng, config)
    region = _whole_front(width, height, panel, support, top)
    composer = Composer(rng, config, family, panel, front.mount == "inset")
    tree = composer.compose(region.rect.width, region.rect.height)
    style = draw_style(rng, config, front, handle, depth, back)
    places = list(resolve(tree, region, panel))
    boards = tuple(board for place in places for board in _boards(place, depth, back, panel, front))
    cells = tuple(fill_cell(rng, config, place, style) for place in places if place.leaf is not None)
    if not _all_legal(cells):
        return None
    appearance = sample_cabinet_appearance(rng)
    return CabinetSpec(
        family=family.name,
        width_m=width,
        depth_m=depth,
        height_m=height,
        panel_m=panel,
        back_m=back,
        side_m=_within(rng, DRAWER_SIDE_M),
        bottom_m=_within(rng, DRAWER_BOTTOM_M),
        support=support,
        top=top,
        front=front,
        handle=handle,
        cells=cells,
        boards=boards,
        appearance=appearance,
        density_kg_m3=_density(rng, appearance),
    )


def _all_legal(cells: tuple[Cell | None, ...]) -> TypeGuard[tuple[Cell, ...]]:
    return all(cell is not None for cell in cells)


def _whole_front(width: float, height: float, panel: float, support: Support, top: Top) -> Region:
    """The clear opening within the carcass."""
    bottom = round(support.height_m + panel, 5)
    rect = Rect(
        round(-width / 2 + panel, 5), round(width / 2 - panel, 5), bottom, round(height - top.thickness_m, 5)
    )
    side = Edge("outer", panel)
    return Region(rect, side, side, side, Edge("under" if top.front_m > 0 else "outer", top.thickness_m))


def _draw_family(rng: np.random.Generator, config: CabinetConfig) -> FamilyConfig:
    name = draw(rng, {f.name: f.weight for f in config.families})
    return next(f for f in config.families if f.name == name)


def _draw_front(rng: np.random.Generator, config: CabinetConfig, family: FamilyConfig) -> FrontStyle:
    inset = rng.random() < family.inset_probability
    framed = rng.random() < family.shaker_probability
    return FrontStyle(
        "inset" if inset else "overlay",
        _within(rng, config.front_m),
        _within(rng, config.gap_m),
        _within(rng, (0.058, 0.085)) if framed else 0.0,
        _within(rng, (0.006, 0.009)) if framed else 0.0,
    )


def _draw_top(rng: np.random.Generator, family: FamilyConfig, panel: float, front: FrontStyle) -> Top:
    if rng.random() >= family.overhang_probability:
        return Top(panel, 0.0, 0.0)
    # it ends at most 8 mm before the fronts: a hand on the uppermost handle must not meet it
    face = front.thickness_m + 0.002 if front.mount == "overlay" else 0.0
    return Top(
        _within(rng, (0.02, 0.038)), round(face + _within(rng, (0.001, 0.008)), 4), _within(rng, (0.002, 0.02))
    )


def _draw_support(rng: np.random.Generator, config: CabinetConfig, family: FamilyConfig, width: float) -> Support:
    kind = draw(rng, family.supports)
    round_legs = rng.random() < 0.6
    leg = _within(rng, (0.026, 0.05))
    setback = _within(rng, (0.02, 0.06))
    if kind == "plinth":
        return Support("plinth", _within(rng, config.plinth_height_m), setback, 0.0, "square")
    if kind == "legs":
        height = _within(rng, config.leg_height_m)
        return Support("legs", height, min(setback, width / 8), leg, "round" if round_legs else "square")
    return Support("floor", 0.0, 0.0, 0.0, "square")


def _draw_handle(rng: np.random.Generator, config: CabinetConfig) -> HandleModel:
    c = config.handle
    square = rng.random() < c.square_probability
    diameter = _within(rng, c.diameter_m)
    least = max(c.projection_m[0], diameter + c.clearance_m)
    projection = _within(rng, (least, max(least, c.projection_m[1])))
    overhang = diameter / 2 if rng.random() < 0.4 else _within(rng, (0.015, 0.04))
    post = min(diameter - 0.001, _within(rng, (0.007, 0.012)))
    return HandleModel(
        "bar", "square" if square else "round", diameter, projection, round(overhang, 4), round(post, 4)
    )


def _boards(place: Placed, depth: float, back: float, panel: float, front: FrontStyle) -> list[Board]:
    """The divider of a place, or the shelves within its cell."""
    first, last = round(-depth / 2, 5), round(depth / 2 - back, 5)
    rect = place.region.rect
    if place.leaf is None:
        rail = place.divider == "rail"
        return [Board(rect, first, first + RAIL_DEPTH_M if rail else last, "rail" if rail else "divider")]
    closed = place.leaf.kind == "door"
    if closed:
        first += SHELF_SETBACK_M + (front.thickness_m if front.mount == "inset" else 0.0)
    count = place.leaf.shelves
    boards = []
    for k in range(1, count + 1):
        # the two halves behind a pair of doors are one compartment: each half bears its half of the shelf
        z = rect.z0 + k * rect.height / (count + 1)
        half = Rect(rect.y0, rect.y1, round(z - panel / 2, 4), round(z + panel / 2, 4))
        boards.append(Board(half, first, last, "shelf"))
    return boards


def _density(rng: np.random.Generator, appearance: CabinetAppearance) -> float:
    wooden = "solid" if rng.random() < 0.4 else "board"
    kind = "fibreboard" if appearance.front.finish == "paint" else wooden
    return round(float(rng.uniform(*DENSITY_KG_M3[kind])), 1)


def _within(rng: np.random.Generator, limits: Range) -> float:
    """Uniform, to a tenth of a millimetre."""
    return round(float(rng.uniform(*limits)), 4)
