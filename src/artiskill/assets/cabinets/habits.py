"""What the doors and drawers of one cabinet have in common, so that they look and move like a set."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from artiskill.assets.cabinets.config import CabinetConfig
from artiskill.assets.cabinets.spec import FrontStyle, HandleModel, Support


@dataclass(frozen=True)
class Habits:
    """The habits of one cabinet.

    Attributes:
        depth_m: of the carcass.
        back_m: thickness of its back panel.
        front: of the front panels.
        drawer_handle, door_handle: models of the handles.
        centres_m: distance of a handle's posts where the front is large enough.
        drawer_drop_m: how far below a high drawer front's upper edge its handle sits; None: in the middle.
        door_vertical: whether doors' handles stand upright.
        door_level: where on the doors' height their handles sit.
        door_margin_m: from the handle's end to the door's upper or lower edge.
        door_edge_m: from an upright handle's axis to the door's free edge.
        door_limit_rad: how far doors open where nothing is in the way.
        flap_limit_rad: likewise, flaps.
        travel_fraction: how far drawers open, relative to their boxes' depth.
        box_fraction: how much of the room above a drawer's floor its sides take up.
        lip_fraction: length of lips, relative to their front.
        lips_low: whether lips run along the lower edges.
        slot_length_m: length of hollows.
    """

    depth_m: float
    back_m: float
    front: FrontStyle
    drawer_handle: HandleModel
    door_handle: HandleModel
    centres_m: float
    drawer_drop_m: float | None
    door_vertical: bool
    door_level: Literal["upper", "middle", "lower"]
    door_margin_m: float
    door_edge_m: float
    door_limit_rad: float
    flap_limit_rad: float
    travel_fraction: float
    box_fraction: float
    lip_fraction: float
    lips_low: bool
    slot_length_m: float


def draw_habits(
    rng: np.random.Generator,
    config: CabinetConfig,
    front: FrontStyle,
    handles: tuple[HandleModel, HandleModel],
    support: Support,
    depth_m: float,
    back_m: float,
) -> Habits:
    """Draw a cabinet's habits; `handles` of drawers and of doors, the other arguments are as in `Habits`."""
    edge = config.handle.edge_m
    door, flap = (math.radians(rng.uniform(*limit)) for limit in (config.door_limit_deg, config.flap_limit_deg))
    drop = float(rng.uniform(0.06, 0.085))
    hung = support.kind == "wall"
    level = rng.random()
    low_end: Literal["upper", "lower"] = "lower" if hung else "upper"
    return Habits(
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
