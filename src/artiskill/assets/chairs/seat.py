"""The seat: a cushion on a pan, or a board."""

import dataclasses

import numpy as np

from artiskill.assets.chairs.appearance import Skins
from artiskill.assets.chairs.pads import Bend, Pad, placed, unbent
from artiskill.assets.chairs.pen import Pen
from artiskill.assets.chairs.spec import ChairSpec, Seat

_PAN_M = 0.008
_CROWN_M = 0.006
_NOSE_SHARE = 0.45  # of the depth over which a waterfall's front falls
_SADDLE_RISE = 0.35  # how far a saddle's front and rear rise, relative to how far its sides hang


def add_seat(pen: Pen, spec: ChairSpec, skins: Skins) -> None:
    """Draw and touch the seat."""
    seat = spec.seat
    crown = _CROWN_M if seat.soft and seat.kind != "saddle" else 0.0
    whole = Pad(
        seat.depth_m / 2,
        seat.width_m / 2,
        seat.exponent,
        seat.thickness_m - crown,
        seat.edge_m,
        crown,
        _form(seat),
    )
    origin, axes = (0.0, 0.0, spec.seat_bottom_m), np.eye(3)
    pieces = 3 if seat.kind == "saddle" else 1
    pen.touch_pad(placed(whole, origin, axes), "seat", pieces, along=0)
    if not seat.soft:
        pen.cushion(placed(whole, origin, axes), skins.seat, "seat")
        return
    pan = dataclasses.replace(
        whole,
        half_u=0.96 * whole.half_u,
        half_v=0.96 * whole.half_v,
        thickness_m=_PAN_M,
        edge_m=0.004,
        crown_m=0.0,
    )
    pen.cushion(placed(pan, origin, axes), skins.shell, "seat", 24, "rear")
    lift = 0.7 * _PAN_M
    cushion = dataclasses.replace(whole, thickness_m=whole.thickness_m - lift, bend=_lifted(whole.bend, lift))
    pen.cushion(placed(cushion, origin, axes), skins.seat, "seat", seen="front")


def _lifted(bend: Bend, lift_m: float) -> Bend:
    def raised(points: np.ndarray) -> np.ndarray:
        return bend(points + np.array((0.0, 0.0, lift_m)))

    return raised


def _form(seat: Seat) -> Bend:
    """The upper side's form; the underside stays flat."""
    half_u, half_v = seat.depth_m / 2, seat.width_m / 2

    def waterfall(points: np.ndarray) -> np.ndarray:
        share = np.clip((-points[:, 0] / half_u - 1 + 2 * _NOSE_SHARE) / (2 * _NOSE_SHARE), 0.0, 1.0)
        return _sunk(points, -seat.shape_m * share**2, seat.thickness_m)

    def saddle(points: np.ndarray) -> np.ndarray:
        rise = _SADDLE_RISE * seat.shape_m * ((points[:, 0] / half_u) ** 2 - 0.5)
        return _sunk(points, rise - seat.shape_m * (points[:, 1] / half_v) ** 2, seat.thickness_m)

    return {"waterfall": waterfall, "saddle": saddle}.get(seat.kind, unbent)


def _sunk(points: np.ndarray, change: np.ndarray, thickness_m: float) -> np.ndarray:
    """Points moved along w, those of the upper side by the whole change, those of the underside not at all."""
    moved = points.copy()
    moved[:, 2] += change * points[:, 2] / thickness_m
    return moved
