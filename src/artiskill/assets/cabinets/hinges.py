"""Barrel hinges: what is seen of them, on the axis of a door."""

import numpy as np

from artiskill.assets.articulated_object import Material
from artiskill.assets.cabinets.boards import Boards
from artiskill.assets.cabinets.spec import CabinetSpec, Cell
from artiskill.geometry.meshes import cylinder
from artiskill.geometry.rotations import quat_from_axis_angle

_HALF_M = 0.024  # of a barrel's length
_END_M = 0.09  # from a door's end to the middle of its barrel, on small doors less
_TO_Y = quat_from_axis_angle((1, 0, 0), np.pi / 2)


def add_hinges(parts: Boards, spec: CabinetSpec, cell: Cell, material: Material) -> None:
    """Draw two barrels; doors over the carcass's edges have hidden hinges, inset ones show theirs."""
    if spec.front.mount == "overlay":
        return
    assert cell.front is not None
    upright = cell.hinge in ("left", "right")
    half = (cell.front.height if upright else cell.front.width) / 2
    offset = half - min(_END_M, 0.5 * half)
    # the barrel stands before the face, on the axis, and does not reach into the slit beside the door
    barrel = cylinder(min(spec.front.knuckle_m, spec.front.gap_m) * 0.95, _HALF_M, 8)
    for sign in (-1, 1):
        at = (0.0, 0.0, sign * offset) if upright else (0.0, sign * offset, 0.0)
        parts.draw(barrel.transformed(at, (1, 0, 0, 0) if upright else _TO_Y), material, "hinge")
