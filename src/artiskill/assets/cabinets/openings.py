"""What fills an opening: a drawer with its box and travel, a door with its hinge and angle, and their handles."""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.assets.cabinets.config import CabinetConfig
from artiskill.assets.cabinets.layout import Placed, Region, front_rect
from artiskill.assets.cabinets.spec import (
    KNUCKLE_M,
    Cell,
    FrontStyle,
    HandleModel,
    HandlePlace,
    Rect,
    Side,
    face_x,
)

# Ball-bearing runners are 12.7 mm thick and want 13 mm on either side (makers' data sheets).
RUNNER_SPACE_M = 0.013
BOX_FLOOR_M = 0.012  # from the opening's lower edge to the box
BOX_HEADROOM_M = 0.018
BOX_STEP_M = 0.05  # runners come in lengths of 250, 300, ... mm
MIN_BOX_LENGTH_M = 0.25
MIN_BOX_HEIGHT_M = 0.05
_FRAMED_MIN_M = 0.16  # lower fronts stay slabs: no room for two rails and a field
_HIGH_FRONT_M = 0.19  # higher drawer fronts may carry their handle near the upper edge
_AIR_M = 0.0005  # left between a door's swept edge and its neighbour


@dataclass(frozen=True)
class Style:
    """What the doors and drawers of one cabinet have in common, so that they look and move like a set.

    Attributes:
        depth_m: of the carcass.
        back_m: thickness of its back panel.
        front: of the front panels.
        handle: model of the handles.
        centres_m: distance of a handle's posts where the front is large enough.
        drawer_drop_m: how far below a high drawer front's upper edge its handle sits; None: in the middle.
        door_vertical: whether doors' handles stand upright.
        door_upper: whether doors' handles sit at their upper end (base units) instead of the middle.
        door_margin_m: from the handle's end to the door's upper edge.
        door_edge_m: from an upright handle's axis to the door's free edge.
        door_limit_rad: how far doors open where nothing is in the way.
        travel_fraction: how far drawers open, relative to their boxes' depth.
        box_fraction: how much of the room above a drawer's floor its sides take up.
    """

    depth_m: float
    back_m: float
    front: FrontStyle
    handle: HandleModel
    centres_m: float
    drawer_drop_m: float | None
    door_vertical: bool
    door_upper: bool
    door_margin_m: float
    door_edge_m: float
    door_limit_rad: float
    travel_fraction: float
    box_fraction: float


def draw_style(
    rng: np.random.Generator,
    config: CabinetConfig,
    front: FrontStyle,
    handle: HandleModel,
    depth_m: float,
    back_m: float,
) -> Style:
    """Draw a cabinet's habits; the other arguments are as in `Style`."""
    edge = config.handle.edge_m
    low, high = (math.radians(a) for a in config.door_limit_deg)
    drop = float(rng.uniform(0.06, 0.085))
    return Style(
        depth_m=depth_m,
        back_m=back_m,
        front=front,
        handle=handle,
        centres_m=float(rng.choice(config.handle.centres_m)),
        drawer_drop_m=drop if rng.random() < 0.4 else None,
        door_vertical=bool(rng.random() < 0.85),
        door_upper=bool(rng.random() < 0.6),
        door_margin_m=float(rng.uniform(0.05, 0.09)),
        # on a shaker door in the middle of the frame's stile
        door_edge_m=max(edge, front.frame_m / 2) if front.frame_m > 0 else edge + float(rng.uniform(0.0, 0.015)),
        door_limit_rad=float(rng.uniform(low, high)),
        travel_fraction=float(rng.uniform(*config.travel_fraction)),
        box_fraction=float(rng.uniform(0.6, 1.0)),
    )


def fill_cell(rng: np.random.Generator, config: CabinetConfig, place: Placed, style: Style) -> Cell | None:
    """Resolve one leaf.

    Args:
        rng: draws what is left open.
        config: ranges.
        place: the leaf and its region.
        style: what the cells of this cabinet share.

    Returns:
        The cell; None where no legal one exists (the handle would be out of reach, say).
    """
    assert place.leaf is not None
    kind, region = place.leaf.kind, place.region
    if kind == "open":
        return Cell("open", region.rect, None, False, None, 0.0, 0.0, 0.0, None)
    panel = front_rect(region, style.front)
    framed = style.front.frame_m > 0 and min(panel.height, panel.width) >= _FRAMED_MIN_M
    if kind == "blind":
        return Cell("blind", region.rect, panel, framed, None, 0.0, 0.0, 0.0, None)
    if kind == "drawer":
        return _drawer(config, style, region.rect, panel, framed)
    return _door(rng, config, style, region, panel, framed)


def _drawer(config: CabinetConfig, style: Style, clear: Rect, panel: Rect, framed: bool) -> Cell | None:
    room = clear.height - BOX_FLOOR_M - BOX_HEADROOM_M
    behind = style.depth_m / 2 - style.back_m - (face_x(style.depth_m, style.front) + style.front.thickness_m)
    length = round(math.floor((behind - 0.01) / BOX_STEP_M) * BOX_STEP_M, 4)
    place = _drawer_handle(config, style, panel)
    if length < MIN_BOX_LENGTH_M or room < MIN_BOX_HEIGHT_M or place is None:
        return None
    height = round(max(MIN_BOX_HEIGHT_M, room * style.box_fraction), 4)
    low = max(config.travel_fraction[0] * length, config.travel_m[0])
    high = min(config.travel_fraction[1] * length, config.travel_m[1])
    if low > high:
        return None
    travel = round(min(max(style.travel_fraction * length, low), high), 4)
    return Cell("drawer", clear, panel, framed, None, travel, height, length, place)


def _drawer_handle(config: CabinetConfig, style: Style, panel: Rect) -> HandlePlace | None:
    """Along the width, in the middle or, on high fronts, below the upper edge."""
    most = min(0.65 * panel.width, panel.width - 0.08 - 2 * style.handle.overhang_m)
    centres = _centres(config, style, most)
    y, z = panel.centre
    if style.drawer_drop_m is not None and panel.height > _HIGH_FRONT_M:
        z = panel.z1 - style.drawer_drop_m
    low, high = config.handle.height_m
    if centres is None or not low <= z <= high:
        return None
    return HandlePlace(round(y, 5), round(z, 4), centres, vertical=False)


def _door(
    rng: np.random.Generator, config: CabinetConfig, style: Style, region: Region, panel: Rect, framed: bool
) -> Cell | None:
    hinge = _hinge(rng, region)
    place = _door_handle(config, style, panel, hinge)
    if place is None or not _swings_free(region, panel, hinge, style.front):
        return None
    limit = style.door_limit_rad
    if (region.left if hinge == "left" else region.right).kind != "outer":
        limit = min(limit, _neighbour_limit(panel, hinge, place, style.handle))
    if limit < math.radians(config.door_limit_deg[0]):
        return None
    return Cell("door", region.rect, panel, framed, hinge, math.floor(limit * 1e4) / 1e4, 0.0, 0.0, place)


def _hinge(rng: np.random.Generator, region: Region) -> Side:
    """At the cabinet's outer side where there is one, never where the next front follows at once."""
    left, right = region.left.kind, region.right.kind
    if (left == "outer") != (right == "outer"):
        return "left" if left == "outer" else "right"
    if (left == "free") != (right == "free"):
        return "right" if left == "free" else "left"
    return "left" if rng.random() < 0.5 else "right"


def _swings_free(region: Region, panel: Rect, hinge: Side, front: FrontStyle) -> bool:
    """Whether the free edge's inner corner, which swings out furthest, misses what is beside it."""
    edge = region.right if hinge == "left" else region.left
    swing = math.hypot(panel.width, front.thickness_m + KNUCKLE_M) - panel.width
    doors = 2 if edge.kind == "free" else 1  # both doors of a pair may stand ajar
    return doors * swing + _AIR_M <= front.gap_m


def _neighbour_limit(panel: Rect, hinge: Side, place: HandlePlace, handle: HandleModel) -> float:
    """Largest angle at which the handle stays before its own door's field, where the neighbour may be open too."""
    along = handle.diameter_m / 2 if place.vertical else place.centres_m / 2 + handle.overhang_m
    lever = panel.y1 - (place.y + along) if hinge == "left" else (place.y - along) - panel.y0
    return math.atan2(lever, handle.projection_m - KNUCKLE_M + _AIR_M)


def _door_handle(config: CabinetConfig, style: Style, panel: Rect, hinge: Side) -> HandlePlace | None:
    """Near the free edge, upright, or lying near a corner."""
    overhang = style.handle.overhang_m
    if style.door_vertical:
        centres = _centres(config, style, min(0.5 * panel.height, panel.height - 0.10 - 2 * overhang))
    else:
        centres = _centres(config, style, min(0.4 * panel.width, panel.width - 0.14 - 2 * overhang))
    if centres is None:
        return None
    half = centres / 2 + overhang
    inset = style.door_edge_m if style.door_vertical else config.handle.edge_m + half
    margin = style.door_margin_m + (half if style.door_vertical else 0.0)
    low = max(panel.z0 + margin, config.handle.height_m[0])
    high = min(panel.z1 - margin, config.handle.height_m[1])
    if low > high:
        return None
    y = panel.y0 + inset if hinge == "left" else panel.y1 - inset
    return HandlePlace(
        round(y, 5), round(high if style.door_upper else (low + high) / 2, 4), centres, style.door_vertical
    )


def _centres(config: CabinetConfig, style: Style, most: float) -> float | None:
    """The cabinet's distance of posts, or the largest that fits a smaller front."""
    legal = [c for c in config.handle.centres_m if c <= min(most, style.centres_m)]
    return max(legal) if legal else None
