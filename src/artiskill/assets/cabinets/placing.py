"""Where handles sit on their fronts, and whether a hand has room around them."""

import math
from itertools import combinations

from artiskill.assets.cabinets.config import CabinetConfig
from artiskill.assets.cabinets.habits import Habits
from artiskill.assets.cabinets.spec import Cell, HandleModel, HandlePlace, Rect, Side

_HIGH_FRONT_M = 0.19  # higher drawer fronts may carry their handle near the upper edge
_MARGIN_M = 0.012  # from a handle to the edge of its front
_HOLLOW_MARGIN_M = 0.028  # likewise, from a hollow
_PAIR_MARGIN_M = 0.03  # from a lip to the door's free edge, where another door follows
_APART_M = 0.04  # between two handles: a finger beside one does not meet the other
_BULGE_M = 0.008


def drawer_place(config: CabinetConfig, habits: Habits, panel: Rect) -> HandlePlace | None:
    """In the middle of the width: in the middle of the height, or below the upper edge of high fronts."""
    model = habits.drawer_handle
    y, z = panel.centre
    if model.kind == "lip":
        return _on_edge(config, habits, model, panel, y, habits.lip_fraction * panel.width)
    if habits.drawer_drop_m is not None and panel.height > _HIGH_FRONT_M and model.kind != "slot":
        z = panel.z1 - habits.drawer_drop_m
    most = min(0.65 * panel.width, panel.width - 0.08 - 2 * model.overhang_m)
    if habits.front.bow_m > 0:  # its feet lie at most so far behind its middle
        most = min(most, panel.width * math.sqrt(_BULGE_M / habits.front.bow_m))
    length = _length(config, habits, model, most)
    if length is None:
        return None
    return _legal(config, model, panel, HandlePlace(round(y, 5), round(z, 4), length, vertical=False))


def door_place(
    config: CabinetConfig, habits: Habits, panel: Rect, hinge: Side, outer: bool, framed: bool
) -> HandlePlace | None:
    """Near the edge across from the hinge.

    Args:
        config: ranges.
        habits: of the cabinet.
        panel: the door.
        hinge: its hinge.
        outer: whether the door's free edge is the cabinet's.
        framed: whether the handle must stay on the frame's member.
    """
    if hinge in ("top", "bottom"):
        return _flap_place(config, habits, panel, hinge)
    model = habits.door_handle
    if model.kind == "lip":
        return _door_lip(config, habits, panel, hinge, outer)
    vertical = habits.door_vertical or framed or model.kind == "slot"
    room = (0.5 * panel.height, panel.height - 0.10) if vertical else (0.4 * panel.width, panel.width - 0.14)
    length = _length(config, habits, model, min(room[0], room[1] - 2 * model.overhang_m))
    if length is None:
        return None
    half = max(length / 2 + model.overhang_m, model.size_m / 2)
    inset = config.handle.edge_m + half
    if vertical or length == 0:
        inset = max(habits.door_edge_m, model.size_m / 2 + 0.025)
    margin = habits.door_margin_m + (half if vertical or length == 0 else 0.0)
    low, high = panel.z0 + margin, panel.z1 - margin
    low, high = max(low, config.handle.height_m[0]), min(high, config.handle.height_m[1])
    if low > high:
        return None
    y = panel.y0 + inset if hinge == "left" else panel.y1 - inset
    z = {"upper": high, "middle": (low + high) / 2, "lower": low}[habits.door_level]
    return _legal(config, model, panel, HandlePlace(round(y, 5), round(z, 4), length, vertical))


def _flap_place(config: CabinetConfig, habits: Habits, panel: Rect, hinge: Side) -> HandlePlace | None:
    """In the middle of the width, near the edge that swings out."""
    model = habits.door_handle
    length = _length(config, habits, model, min(0.5 * panel.width, panel.width - 0.08 - 2 * model.overhang_m))
    if length is None or model.kind in ("lip", "slot"):
        return None
    inset = max(config.handle.edge_m, model.size_m / 2 + 0.015)
    z = panel.z1 - inset if hinge == "bottom" else panel.z0 + inset
    return _legal(
        config, model, panel, HandlePlace(round(panel.centre[0], 5), round(z, 4), length, vertical=False)
    )


def _door_lip(config: CabinetConfig, habits: Habits, panel: Rect, hinge: Side, outer: bool) -> HandlePlace | None:
    """Upright along the free edge if nothing follows there, else along the upper or lower edge, near that one."""
    model = habits.door_handle
    thick = model.diameter_m
    free_left = hinge == "right"
    if outer and habits.door_vertical:
        y = panel.y1 - thick / 2 if free_left else panel.y0 + thick / 2
        length = round(min(habits.lip_fraction, 0.6) * panel.height, 4)
        low, high = config.handle.height_m
        z = min(max(panel.centre[1], low), high)
        return _legal(config, model, panel, HandlePlace(round(y, 5), round(z, 4), length, True, free_left))
    length = round(min(0.45 * panel.width, 0.16), 4)
    away = length / 2 + _PAIR_MARGIN_M
    return _on_edge(config, habits, model, panel, panel.y1 - away if free_left else panel.y0 + away, length)


def _on_edge(
    config: CabinetConfig, habits: Habits, model: HandleModel, panel: Rect, y: float, length_m: float
) -> HandlePlace | None:
    """A lying lip, along the upper or the lower edge."""
    low = habits.lips_low
    z = panel.z0 + model.diameter_m / 2 if low else panel.z1 - model.diameter_m / 2
    if not config.handle.height_m[0] <= z <= config.handle.height_m[1]:
        return None
    return HandlePlace(round(y, 5), round(z, 5), round(length_m, 4), False, low)


def _length(config: CabinetConfig, habits: Habits, model: HandleModel, most: float) -> float | None:
    """The cabinet's distance of posts or length of slots, or the largest that fits a smaller front."""
    if model.kind in ("knob", "ring"):
        return 0.0
    if model.kind == "slot":
        length = round(min(habits.slot_length_m, most - 0.02), 4)
        return length if length >= config.handle.slot_length_m[0] else None
    centres = config.handle.cup_centres_m if model.kind == "cup" else config.handle.centres_m
    longest = habits.centres_m if model.kind == "bar" else min(habits.centres_m, config.handle.bow_length_m)
    legal = [c for c in centres if c <= min(most, longest)]
    return max(legal) if legal else None


def _legal(config: CabinetConfig, model: HandleModel, panel: Rect, place: HandlePlace) -> HandlePlace | None:
    """The place, or None where the handle would be out of reach or reach over its front's edge."""
    low, high = config.handle.height_m
    if model.kind == "slot":
        low = config.handle.slot_lowest_m
    if not low <= place.z <= high:
        return None
    dy, dz = place.reach(model)
    if model.kind == "lip":  # it lies on an edge: only its length must fit
        return place if panel.z0 <= place.z - dz and place.z + dz <= panel.z1 else None
    margin = _HOLLOW_MARGIN_M if model.kind == "slot" else _MARGIN_M
    fits_y = panel.y0 + margin <= place.y - dy and place.y + dy <= panel.y1 - margin
    fits_z = panel.z0 + margin <= place.z - dz and place.z + dz <= panel.z1 - margin
    return place if fits_y and fits_z else None


def hands_have_room(cells: tuple[Cell, ...], drawers: HandleModel, doors: HandleModel) -> bool:
    """Whether all handles are so far from one another that a hand at one does not meet the next."""
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
