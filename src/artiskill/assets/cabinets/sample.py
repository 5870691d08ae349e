"""From a random generator to a `CabinetSpec`: sizes, style, layout, joint ranges and where handles sit."""

from dataclasses import replace
from typing import TypeGuard

import numpy as np

from artiskill.assets.cabinets.appearance import CabinetAppearance, sample_cabinet_appearance
from artiskill.assets.cabinets.carcass import BOX_SHAPES, carcass_shapes
from artiskill.assets.cabinets.cells import fill_cell, hands_have_room
from artiskill.assets.cabinets.config import CabinetConfig, CabinetFamilyConfig, WallConfig
from artiskill.assets.cabinets.fronts import handle_cavity
from artiskill.assets.cabinets.layout import Edge, LayoutSampler, Placement, Region, resolve
from artiskill.assets.cabinets.pulls import pull_shapes
from artiskill.assets.cabinets.spec import (
    Board,
    CabinetSpec,
    Cell,
    FrontStyle,
    HandleKind,
    Rect,
    Support,
    Top,
    Wall,
)
from artiskill.assets.cabinets.style import draw_front, draw_handles, draw_style, draw_support, draw_top
from artiskill.assets.finishes import sample_surface
from artiskill.assets.generators import pick, pick_family, within
from artiskill.errors import AssetError

_BOARDED = ("plinth", "sides")
_PLINTH_METALS = ("brushed_steel", "black_iron")  # what plinths are faced with, if not as the carcass
_MAX_DRAWS = 500
_DRAWS_PER_FAMILY = 50  # and kind of handle
# Between the fronts of a stack of inset drawers lie rails, as in joiners' chests.
_RAIL_DEPTH_M = 0.07
# Boards within a closed compartment end this far behind its front.
_SHELF_SETBACK_M = 0.02
_DRAWER_SIDE_M = (0.012, 0.016)
_DRAWER_BOTTOM_M = (0.005, 0.008)
# Chipboard P2 600-680 kg/m3, medium density fibreboard 700-780, solid woods: EN 312, EN 622-5, wood handbooks.
_DENSITY_KG_M3 = {"board": (620.0, 680.0), "fibreboard": (700.0, 780.0), "solid": (480.0, 720.0)}


def sample_cabinet(rng: np.random.Generator, config: CabinetConfig, held_out: bool = False) -> CabinetSpec:
    """Draw one cabinet; draws that break a rule (no handle within reach, too many parts) are drawn again.

    Args:
        rng: draws everything.
        config: ranges and weights.
        held_out: whether to draw one of the families that are kept from training and test, or one of the others.

    Raises:
        AssetError: the config leaves (nearly) no legal cabinet.
    """
    for _ in range(_MAX_DRAWS // _DRAWS_PER_FAMILY):
        # drawn once for many tries: what fits less often is not made less often
        family = pick_family(rng, config.families, held_out)
        kind = pick(rng, family.handles)
        for _ in range(_DRAWS_PER_FAMILY):
            spec = _draw_spec(rng, config, family, kind)  # type: ignore[arg-type]
            if spec is not None and _is_legal(spec, config):
                return spec if spec.support.kind != "wall" else replace(spec, wall=_wall(rng, config.wall))
    raise AssetError(
        f"no legal cabinet in {_MAX_DRAWS} draws: the ranges of the cabinet config contradict each other"
    )


def collision_count(spec: CabinetSpec) -> int:
    """Return how many collision shapes the built cabinet has."""
    count = carcass_shapes(spec)
    for cell in spec.cells:
        if cell.kind in ("drawer", "door"):
            count += (1 if handle_cavity(spec, cell) is None else 4) + (BOX_SHAPES if cell.kind == "drawer" else 0)
        if cell.handle is not None:
            count += pull_shapes(spec.handle_of(cell))
    return count


def _is_legal(spec: CabinetSpec, config: CabinetConfig) -> bool:
    moving = spec.count("drawer") + spec.count("door")
    if not 1 <= moving <= config.max_moving or collision_count(spec) > config.max_collisions:
        return False
    return hands_have_room(spec.cells, spec.drawer_handle, spec.door_handle)


def _draw_spec(
    rng: np.random.Generator, config: CabinetConfig, family: CabinetFamilyConfig, kind: HandleKind
) -> CabinetSpec | None:
    """Draw once; return None where a door or drawer came out illegal."""
    width, depth, height = (within(rng, r) for r in (family.width_m, family.depth_m, family.height_m))
    panel, back = within(rng, config.panel_m), within(rng, config.back_m)
    front = draw_front(rng, config, family)
    top = draw_top(rng, family, width, panel, front)
    support = draw_support(rng, config, family, width)
    handles = draw_handles(rng, config.handle, kind)
    region = _whole_front(width, height, panel, support, top)
    layout = LayoutSampler(rng, config, family, panel, inset=front.mount == "inset")
    tree = layout.compose(region.rect.width, region.rect.height)
    style = draw_style(rng, config, front, handles, support, depth, back)
    places = list(resolve(tree, region, panel))
    boards = join_shelves([board for place in places for board in _boards(place, depth, back, panel, front)])
    cells = tuple(fill_cell(rng, config, place, style) for place in places if place.leaf is not None)
    if not _all_legal(cells):
        return None
    appearance = _appearance(rng, family, support)
    return CabinetSpec(
        family=family.name,
        held_out=family.held_out,
        width_m=width,
        depth_m=depth,
        height_m=height,
        panel_m=panel,
        back_m=back,
        side_m=within(rng, _DRAWER_SIDE_M),
        bottom_m=within(rng, _DRAWER_BOTTOM_M),
        support=support,
        top=top,
        front=front,
        drawer_handle=handles[0],
        door_handle=handles[1],
        cells=cells,
        boards=boards,
        appearance=appearance,
        density_kg_m3=_density(rng, appearance),
    )


def _appearance(rng: np.random.Generator, family: CabinetFamilyConfig, support: Support) -> CabinetAppearance:
    appearance = sample_cabinet_appearance(rng, family.finishes)
    if support.kind in _BOARDED and appearance.support.name not in _PLINTH_METALS:
        return replace(appearance, support=appearance.carcass)
    return appearance


def _wall(rng: np.random.Generator, config: WallConfig) -> Wall:
    """Draw the wall, last of all, so that cabinets are the same whatever their walls are."""
    return Wall(
        config.width_m, config.height_m, config.thickness_m, sample_surface(rng, "paint", tuple(config.paints))
    )


def _all_legal(cells: tuple[Cell | None, ...]) -> TypeGuard[tuple[Cell, ...]]:
    return all(cell is not None for cell in cells)


def _whole_front(width: float, height: float, panel: float, support: Support, top: Top) -> Region:
    """Return the clear opening within the carcass."""
    bottom = round(support.height_m + panel, 5)
    rect = Rect(
        round(-width / 2 + panel, 5), round(width / 2 - panel, 5), bottom, round(height - top.thickness_m, 5)
    )
    side = Edge("outer", panel)
    return Region(rect, side, side, side, Edge("under" if top.front_m > 0 else "outer", top.thickness_m))


def _boards(place: Placement, depth: float, back: float, panel: float, front: FrontStyle) -> list[Board]:
    """Return the divider of a place, or the shelves within its cell."""
    first, last = round(-depth / 2, 5), round(depth / 2 - back, 5)
    rect = place.region.rect
    if place.leaf is None:
        rail = place.divider == "rail"
        return [Board(rect, first, first + _RAIL_DEPTH_M if rail else last, "rail" if rail else "divider")]
    if place.leaf.kind == "door":
        first += _SHELF_SETBACK_M + (front.thickness_m if front.mount == "inset" else 0.0)
    count = place.leaf.shelves
    boards = []
    for k in range(1, count + 1):
        # the two halves behind a pair of doors are one compartment; their halves of a shelf are joined later
        z = rect.z0 + k * rect.height / (count + 1)
        half = Rect(rect.y0, rect.y1, round(z - panel / 2, 4), round(z + panel / 2, 4))
        boards.append(Board(half, first, last, "shelf"))
    return boards


def join_shelves(boards: list[Board]) -> tuple[Board, ...]:
    """Replace halves of shelves that meet, as behind a pair of doors, by one shelf."""
    joined: list[Board] = []
    for board in boards:
        r = board.rect
        halves = [
            k
            for k, other in enumerate(joined)
            if board.part == other.part == "shelf"
            and other.rect.y0 == r.y1
            and (other.rect.z0, other.rect.z1, other.x0, other.x1) == (r.z0, r.z1, board.x0, board.x1)
        ]
        if halves:
            other = joined[halves[0]]
            joined[halves[0]] = replace(other, rect=replace(other.rect, y0=r.y0))
        else:
            joined.append(board)
    return tuple(joined)


def _density(rng: np.random.Generator, appearance: CabinetAppearance) -> float:
    wooden = "solid" if rng.random() < 0.4 else "board"
    kind = "fibreboard" if appearance.front.finish == "paint" else wooden
    return round(float(rng.uniform(*_DENSITY_KG_M3[kind])), 1)
