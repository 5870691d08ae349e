"""What fills an opening: a drawer with its box and travel, a door with its hinge and angle."""

import math

import numpy as np

from artiskill.assets.cabinets.config import CabinetConfig
from artiskill.assets.cabinets.habits import Habits
from artiskill.assets.cabinets.placing import door_place, drawer_place
from artiskill.assets.cabinets.spec import Cell, FaceKind, FrontStyle, HandlePlace, Rect, Side, face_x
from artiskill.assets.cabinets.tree import Leaf, Placed, Region, front_rect

# Ball-bearing runners are 12.7 mm thick and want 13 mm on either side (makers' data sheets).
RUNNER_SPACE_M = 0.013
BOX_FLOOR_M = 0.012  # from the opening's lower edge to the box
BOX_HEADROOM_M = 0.018
BOX_STEP_M = 0.05  # runners come in lengths of 250, 300, ... mm
MIN_BOX_LENGTH_M = 0.25
MIN_BOX_HEIGHT_M = 0.05
_FRAMED_MIN_M = 0.16  # lower fronts stay slabs: no room for two rails and a field
_AIR_M = 0.0005  # left between a door's swept edge and its neighbour
_FULL_DOORS: tuple[FaceKind, ...] = ("glazed", "louvred")  # only doors have these faces, other fronts are plainer


def fill_cell(rng: np.random.Generator, config: CabinetConfig, place: Placed, habits: Habits) -> Cell | None:
    """Resolve one leaf.

    Args:
        rng: draws what is left open.
        config: ranges.
        place: the leaf and its region.
        habits: what the cells of this cabinet share.

    Returns:
        The cell; None where no legal one exists (the handle would be out of reach, say).
    """
    leaf, region = place.leaf, place.region
    assert leaf is not None
    if leaf.kind == "open":
        return Cell("open", region.rect, None, "slab", None, 0.0, 0.0, 0.0, None)
    panel = front_rect(region, habits.front)
    face = _face(leaf, habits, panel)
    if leaf.kind == "blind":
        return Cell("blind", region.rect, panel, face, None, 0.0, 0.0, 0.0, None)
    if leaf.kind == "drawer":
        return _drawer(config, habits, region.rect, panel, face)
    return _door(config, habits, region, panel, face, leaf.hinge or _hinge(rng, region))


def _face(leaf: Leaf, habits: Habits, panel: Rect) -> FaceKind:
    face = habits.front.face
    model = {"drawer": habits.drawer_handle, "door": habits.door_handle}.get(leaf.kind)
    if model is not None and model.kind == "slot":
        return "slab"
    if face in _FULL_DOORS and leaf.kind != "door":
        face = "shaker"
    small = min(panel.height, panel.width) < _FRAMED_MIN_M
    return "slab" if small and face != "planks" else face


def _drawer(config: CabinetConfig, habits: Habits, clear: Rect, panel: Rect, face: FaceKind) -> Cell | None:
    room = clear.height - BOX_FLOOR_M - BOX_HEADROOM_M
    behind = habits.depth_m / 2 - habits.back_m - (face_x(habits.depth_m, habits.front) + habits.front.thickness_m)
    length = round(math.floor((behind - 0.01) / BOX_STEP_M) * BOX_STEP_M, 4)
    place = drawer_place(config, habits, panel)
    if length < MIN_BOX_LENGTH_M or room < MIN_BOX_HEIGHT_M or place is None:
        return None
    height = round(max(MIN_BOX_HEIGHT_M, room * habits.box_fraction), 4)
    low = max(config.travel_fraction[0] * length, config.travel_m[0])
    high = min(config.travel_fraction[1] * length, config.travel_m[1])
    if low > high:
        return None
    travel = round(min(max(habits.travel_fraction * length, low), high), 4)
    return Cell("drawer", clear, panel, face, None, travel, height, length, place)


def _door(
    config: CabinetConfig, habits: Habits, region: Region, panel: Rect, face: FaceKind, hinge: Side
) -> Cell | None:
    edges = {"left": region.left, "right": region.right, "top": region.top, "bottom": region.bottom}
    free = edges[{"left": "right", "right": "left", "top": "bottom", "bottom": "top"}[hinge]]
    place = door_place(config, habits, panel, hinge, free.kind == "outer", face in _FULL_DOORS)
    doors = 2 if free.kind == "free" else 1  # both doors of a pair may stand ajar
    if place is None or not _swings_free(panel, hinge, habits.front, doors):
        return None
    flap = hinge in ("top", "bottom")
    limit = habits.flap_limit_rad if flap else habits.door_limit_rad
    if edges[hinge].kind != "outer" or flap:
        limit = min(limit, _neighbour_limit(habits, panel, hinge, place))
    least = (config.flap_limit_deg if flap else config.door_limit_deg)[0]
    if limit < math.radians(least):
        return None
    return Cell("door", region.rect, panel, face, hinge, math.floor(limit * 1e4) / 1e4, 0.0, 0.0, place)


def _hinge(rng: np.random.Generator, region: Region) -> Side:
    """At the cabinet's outer side where there is one, never where the next front follows at once."""
    left, right = region.left.kind, region.right.kind
    if (left == "outer") != (right == "outer"):
        return "left" if left == "outer" else "right"
    if (left == "free") != (right == "free"):
        return "right" if left == "free" else "left"
    return "left" if rng.random() < 0.5 else "right"


def _swings_free(panel: Rect, hinge: Side, front: FrontStyle, doors: int) -> bool:
    """Whether the free edge's inner corner, which swings out furthest, misses what is beside it."""
    reach = panel.width if hinge in ("left", "right") else panel.height
    swing = math.hypot(reach, front.thickness_m + front.knuckle_m) - reach
    return doors * swing + _AIR_M <= front.gap_m


def _neighbour_limit(habits: Habits, panel: Rect, hinge: Side, place: HandlePlace) -> float:
    """Largest angle at which the handle stays before its own door's field, where the neighbour may be open too."""
    model = habits.door_handle
    if model.kind == "slot":
        return math.pi
    dy, dz = place.reach(model)
    lever = {
        "left": panel.y1 - (place.y + dy),
        "right": (place.y - dy) - panel.y0,
        "top": panel.z1 - (place.z + dz),
        "bottom": (place.z - dz) - panel.z0,
    }[hinge]
    return math.atan2(lever, model.projection_m - habits.front.knuckle_m + _AIR_M)
