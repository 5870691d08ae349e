"""What fills an opening: drawers with box and travel, doors with hinge and angle, and where handles sit."""

import math
from itertools import combinations

import numpy as np

from artiskill.assets.cabinets.config import CabinetConfig
from artiskill.assets.cabinets.layout import Leaf, Placement, Region, front_rect
from artiskill.assets.cabinets.spec import Cell, FaceKind, FrontStyle, HandleModel, HandlePlace, Rect, Side, face_x
from artiskill.assets.cabinets.style import CabinetStyle

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
_HIGH_FRONT_M = 0.19  # higher drawer fronts may carry their handle near the upper edge
_MARGIN_M = 0.012  # from a handle to the edge of its front
_CAVITY_MARGIN_M = 0.028  # from the cavity of a flush bar to the edge of its front
_PAIR_MARGIN_M = 0.03  # from a lip to the door's free edge, where another door follows
_APART_M = 0.04  # between two handles: a finger beside one does not meet the other
_BULGE_M = 0.008


def fill_cell(
    rng: np.random.Generator, config: CabinetConfig, place: Placement, style: CabinetStyle
) -> Cell | None:
    """Resolve one leaf.

    Args:
        rng: draws what is left open.
        config: ranges.
        place: the leaf and its region.
        style: what the cells of this cabinet share.

    Returns:
        The cell; None where no legal one exists (the handle would be out of reach, say).
    """
    leaf, region = place.leaf, place.region
    assert leaf is not None
    if leaf.kind == "open":
        return Cell("open", region.rect)
    panel = front_rect(region, style.front)
    face = _face(leaf, style, panel)
    if leaf.kind == "blind":
        return Cell("blind", region.rect, panel, face)
    if leaf.kind == "drawer":
        return _drawer(config, style, region.rect, panel, face)
    return _door(config, style, region, panel, face, leaf.hinge or _hinge(rng, region))


def _face(leaf: Leaf, style: CabinetStyle, panel: Rect) -> FaceKind:
    face = style.front.face
    model = {"drawer": style.drawer_handle, "door": style.door_handle}.get(leaf.kind)
    if model is not None and model.kind == "slot":
        return "slab"
    if face in _FULL_DOORS and leaf.kind != "door":
        face = "shaker"
    small = min(panel.height, panel.width) < _FRAMED_MIN_M
    return "slab" if small and face != "planks" else face


def _drawer(config: CabinetConfig, style: CabinetStyle, clear: Rect, panel: Rect, face: FaceKind) -> Cell | None:
    room = clear.height - BOX_FLOOR_M - BOX_HEADROOM_M
    behind = style.depth_m / 2 - style.back_m - (face_x(style.depth_m, style.front) + style.front.thickness_m)
    length = round(math.floor((behind - 0.01) / BOX_STEP_M) * BOX_STEP_M, 4)
    place = _drawer_place(config, style, panel)
    if length < MIN_BOX_LENGTH_M or room < MIN_BOX_HEIGHT_M or place is None:
        return None
    height = round(max(MIN_BOX_HEIGHT_M, room * style.box_fraction), 4)
    low = max(config.travel_fraction[0] * length, config.travel_m[0])
    high = min(config.travel_fraction[1] * length, config.travel_m[1])
    if low > high:
        return None
    travel = round(min(max(style.travel_fraction * length, low), high), 4)
    return Cell("drawer", clear, panel, face, None, travel, height, length, place)


def _door(
    config: CabinetConfig, style: CabinetStyle, region: Region, panel: Rect, face: FaceKind, hinge: Side
) -> Cell | None:
    edges = {"left": region.left, "right": region.right, "top": region.top, "bottom": region.bottom}
    free = edges[{"left": "right", "right": "left", "top": "bottom", "bottom": "top"}[hinge]]
    place = _door_place(config, style, panel, hinge, free.kind == "outer", face in _FULL_DOORS)
    doors = 2 if free.kind == "free" else 1  # both doors of a pair may stand ajar
    if place is None or not _swings_free(panel, hinge, style.front, doors):
        return None
    flap = hinge in ("top", "bottom")
    limit = style.flap_limit_rad if flap else style.door_limit_rad
    if edges[hinge].kind != "outer" or flap:
        limit = min(limit, _neighbour_limit(style, panel, hinge, place))
    least = (config.flap_limit_deg if flap else config.door_limit_deg)[0]
    if limit < math.radians(least):
        return None
    return Cell("door", region.rect, panel, face, hinge, math.floor(limit * 1e4) / 1e4, handle=place)


def _hinge(rng: np.random.Generator, region: Region) -> Side:
    """Put the hinge at the cabinet's outer side if there is one, never where the next front follows at once."""
    left, right = region.left.kind, region.right.kind
    if (left == "outer") != (right == "outer"):
        return "left" if left == "outer" else "right"
    if (left == "free") != (right == "free"):
        return "right" if left == "free" else "left"
    return "left" if rng.random() < 0.5 else "right"


def _swings_free(panel: Rect, hinge: Side, front: FrontStyle, doors: int) -> bool:
    """Return whether the free edge's inner corner, which swings out furthest, misses what is beside it."""
    reach = panel.width if hinge in ("left", "right") else panel.height
    swing = math.hypot(reach, front.thickness_m + front.knuckle_m) - reach
    return doors * swing + _AIR_M <= front.gap_m


def _neighbour_limit(style: CabinetStyle, panel: Rect, hinge: Side, place: HandlePlace) -> float:
    """Return the angle up to which the handle stays before its own door, as the neighbour may be open too."""
    model = style.door_handle
    if model.kind == "slot":
        return math.pi
    dy, dz = place.reach(model)
    lever = {
        "left": panel.y1 - (place.y + dy),
        "right": (place.y - dy) - panel.y0,
        "top": panel.z1 - (place.z + dz),
        "bottom": (place.z - dz) - panel.z0,
    }[hinge]
    return math.atan2(lever, model.projection_m - style.front.knuckle_m + _AIR_M)


def _drawer_place(config: CabinetConfig, style: CabinetStyle, panel: Rect) -> HandlePlace | None:
    """Place a drawer's handle: centred, or below the upper edge of a high front."""
    model = style.drawer_handle
    y, z = panel.centre
    if model.kind == "lip":
        return _on_edge(config, style, model, panel, y, style.lip_fraction * panel.width)
    if style.drawer_drop_m is not None and panel.height > _HIGH_FRONT_M and model.kind != "slot":
        z = panel.z1 - style.drawer_drop_m
    most = min(0.65 * panel.width, panel.width - 0.08 - 2 * model.overhang_m)
    if style.front.bow_m > 0:  # its feet lie at most so far behind its middle
        most = min(most, panel.width * math.sqrt(_BULGE_M / style.front.bow_m))
    length = _length(config, style, model, most)
    if length is None:
        return None
    return _legal(config, model, panel, HandlePlace(round(y, 5), round(z, 4), length, vertical=False))


def _door_place(
    config: CabinetConfig, style: CabinetStyle, panel: Rect, hinge: Side, outer: bool, framed: bool
) -> HandlePlace | None:
    """Place a door's handle near the edge across from the hinge.

    Args:
        config: ranges.
        style: what the cells of this cabinet share.
        panel: the door.
        hinge: its side.
        outer: whether the door's free edge is the cabinet's.
        framed: whether the handle must stay on the frame's member.
    """
    if hinge in ("top", "bottom"):
        return _flap_place(config, style, panel, hinge)
    model = style.door_handle
    if model.kind == "lip":
        return _door_lip(config, style, panel, hinge, outer)
    vertical = style.door_vertical or framed or model.kind == "slot"
    room = (0.5 * panel.height, panel.height - 0.10) if vertical else (0.4 * panel.width, panel.width - 0.14)
    length = _length(config, style, model, min(room[0], room[1] - 2 * model.overhang_m))
    if length is None:
        return None
    half = max(length / 2 + model.overhang_m, model.size_m / 2)
    inset = config.handle.edge_m + half
    if vertical or length == 0:
        inset = max(style.door_edge_m, model.size_m / 2 + 0.025)
    margin = style.door_margin_m + (half if vertical or length == 0 else 0.0)
    low, high = panel.z0 + margin, panel.z1 - margin
    low, high = max(low, config.handle.height_m[0]), min(high, config.handle.height_m[1])
    if low > high:
        return None
    y = panel.y0 + inset if hinge == "left" else panel.y1 - inset
    z = {"upper": high, "middle": (low + high) / 2, "lower": low}[style.door_level]
    return _legal(config, model, panel, HandlePlace(round(y, 5), round(z, 4), length, vertical))


def _flap_place(config: CabinetConfig, style: CabinetStyle, panel: Rect, hinge: Side) -> HandlePlace | None:
    """Place a flap's handle in the middle of the width, near the edge that swings out."""
    model = style.door_handle
    length = _length(config, style, model, min(0.5 * panel.width, panel.width - 0.08 - 2 * model.overhang_m))
    if length is None or model.kind in ("lip", "slot"):
        return None
    inset = max(config.handle.edge_m, model.size_m / 2 + 0.015)
    z = panel.z1 - inset if hinge == "bottom" else panel.z0 + inset
    return _legal(
        config, model, panel, HandlePlace(round(panel.centre[0], 5), round(z, 4), length, vertical=False)
    )


def _door_lip(
    config: CabinetConfig, style: CabinetStyle, panel: Rect, hinge: Side, outer: bool
) -> HandlePlace | None:
    """Place a lip upright along the free edge if no front follows there, else along the upper or lower edge."""
    model = style.door_handle
    thick = model.diameter_m
    free_left = hinge == "right"
    if outer and style.door_vertical:
        y = panel.y1 - thick / 2 if free_left else panel.y0 + thick / 2
        length = round(min(style.lip_fraction, 0.6) * panel.height, 4)
        low, high = config.handle.height_m
        z = min(max(panel.centre[1], low), high)
        return _legal(config, model, panel, HandlePlace(round(y, 5), round(z, 4), length, True, free_left))
    length = round(min(0.45 * panel.width, 0.16), 4)
    away = length / 2 + _PAIR_MARGIN_M
    return _on_edge(config, style, model, panel, panel.y1 - away if free_left else panel.y0 + away, length)


def _on_edge(
    config: CabinetConfig, style: CabinetStyle, model: HandleModel, panel: Rect, y: float, length_m: float
) -> HandlePlace | None:
    """Place a lying lip along the upper or the lower edge."""
    low = style.lips_low
    z = panel.z0 + model.diameter_m / 2 if low else panel.z1 - model.diameter_m / 2
    if not config.handle.height_m[0] <= z <= config.handle.height_m[1]:
        return None
    return HandlePlace(round(y, 5), round(z, 5), round(length_m, 4), False, low)


def _length(config: CabinetConfig, style: CabinetStyle, model: HandleModel, most: float) -> float | None:
    """Return the cabinet's distance of posts or length of slots, or the largest that fits a smaller front."""
    if model.kind in ("knob", "ring"):
        return 0.0
    if model.kind == "slot":
        length = round(min(style.slot_length_m, most - 0.02), 4)
        return length if length >= config.handle.slot_length_m[0] else None
    centres = config.handle.cup_centres_m if model.kind == "cup" else config.handle.centres_m
    longest = style.centres_m if model.kind == "bar" else min(style.centres_m, config.handle.bow_length_m)
    legal = [c for c in centres if c <= min(most, longest)]
    return max(legal) if legal else None


def _legal(config: CabinetConfig, model: HandleModel, panel: Rect, place: HandlePlace) -> HandlePlace | None:
    """Return the place, or None where the handle would be out of reach or reach over its front's edge."""
    low, high = config.handle.height_m
    if model.kind == "slot":
        low = config.handle.slot_lowest_m
    if not low <= place.z <= high:
        return None
    dy, dz = place.reach(model)
    if model.kind == "lip":  # it lies on an edge: only its length must fit
        return place if panel.z0 <= place.z - dz and place.z + dz <= panel.z1 else None
    margin = _CAVITY_MARGIN_M if model.kind == "slot" else _MARGIN_M
    fits_y = panel.y0 + margin <= place.y - dy and place.y + dy <= panel.y1 - margin
    fits_z = panel.z0 + margin <= place.z - dz and place.z + dz <= panel.z1 - margin
    return place if fits_y and fits_z else None


def hands_have_room(cells: tuple[Cell, ...], drawers: HandleModel, doors: HandleModel) -> bool:
    """Return whether all handles are far enough apart that a hand at one does not meet the next."""
    boxes = []
    for cell in cells:
        if cell.handle is not None:
            dy, dz = cell.handle.reach(drawers if cell.kind == "drawer" else doors)
            boxes.append((cell.handle.y, cell.handle.z, dy, dz))
    for (y, z, dy, dz), (other_y, other_z, other_dy, other_dz) in combinations(boxes, 2):
        apart = max(abs(y - other_y) - dy - other_dy, abs(z - other_z) - dz - other_dz)
        if apart < _APART_M:
            return False
    return True
