"""What is seen of hinges: barrels on the axes of inset doors, arms and cups behind doors over the carcass."""

import numpy as np

from artiskill.assets.articulated_object import Material
from artiskill.assets.cabinets.boards import Boards
from artiskill.assets.cabinets.spec import CabinetSpec, Cell, Side
from artiskill.geometry.primitives import box, cylinder
from artiskill.geometry.rotations import quat_from_axis_angle

_HALF_M = 0.024  # of a barrel's length
_END_M = 0.09  # from a door's end to the middle of its barrel, on small doors less
_TO_X = quat_from_axis_angle((0, 1, 0), np.pi / 2)
_TO_Y = quat_from_axis_angle((1, 0, 0), np.pi / 2)
# Cup hinges after makers' data sheets: a cup of 35 mm, its middle 22.5 mm from the door's edge, an arm inside.
_CUP_M = (0.0175, 0.0225)  # radius, distance from the edge
_CUP_PROUD_M = 0.0012
_ARM_M = (0.006, 0.011)  # half of its thickness, which lies on the board, and of its width
_ARM_INSIDE_M = 0.055  # how far it reaches into the carcass
_ARM_CLEAR_M = 0.004  # its end stays so far behind the door's outer face


def add_hinges(parts: Boards, spec: CabinetSpec, cell: Cell, material: Material) -> None:
    """Draw what of both hinges moves with a door."""
    for at, upright in _places(cell):
        if spec.front.mount == "inset":
            # the barrel stands before the face, on the axis, and does not reach into the slit beside the door
            barrel = cylinder(min(spec.front.knuckle_m, spec.front.gap_m) * 0.95, _HALF_M, 8)
            parts.add_visual(barrel.transformed(at, (1, 0, 0, 0) if upright else _TO_Y), material, "hinge")
        elif _overlap(cell) > 0:
            cup = cylinder(_CUP_M[0], _CUP_PROUD_M, 14)
            back = spec.front.knuckle_m + spec.front.thickness_m
            inwards = _CUP_M[1] * _inwards(cell)
            parts.add_visual(cup.transformed(at + np.array((back, *inwards)), _TO_X), material, "hinge")


def add_hinge_arms(parts: Boards, spec: CabinetSpec, cell: Cell, material: Material) -> None:
    """Draw what stays on the carcass: arms that end within a closed door and reach out to an open one's edge."""
    if spec.front.mount == "inset" or _overlap(cell) <= 0:
        return
    assert cell.front is not None
    x0, x1 = spec.face_x + _ARM_CLEAR_M, spec.face_x + spec.front.thickness_m + _ARM_INSIDE_M
    y, z = cell.front.centre
    inwards = _inwards(cell)
    edge = {"left": (cell.clear.y1, z), "right": (cell.clear.y0, z), "top": (y, cell.clear.z1)}
    start = np.array(edge.get(_side(cell), (y, cell.clear.z0))) + inwards * _ARM_M[0]
    for at, upright in _places(cell):
        half = ((x1 - x0) / 2, *(_ARM_M if upright else _ARM_M[::-1]))
        parts.add_visual(box(half).transformed(parts.local(((x0 + x1) / 2, *start)) + at), material, "hinge")


def _places(cell: Cell) -> list[tuple[np.ndarray, bool]]:
    """Along the axis, from its middle, where the hinges are, and whether the axis is upright."""
    assert cell.front is not None
    upright = _side(cell) in ("left", "right")
    half = (cell.front.height if upright else cell.front.width) / 2
    offset = half - min(_END_M, 0.5 * half)
    along = np.array((0.0, 0.0, 1.0) if upright else (0.0, 1.0, 0.0))
    return [(sign * offset * along, upright) for sign in (-1, 1)]


def _overlap(cell: Cell) -> float:
    """How far the door covers the board beside its hinges; negative where there is none."""
    door, clear = cell.front, cell.clear
    assert door is not None
    reach = {"left": door.y1 - clear.y1, "right": clear.y0 - door.y0, "top": door.z1 - clear.z1}
    return reach.get(_side(cell), clear.z0 - door.z0)


def _inwards(cell: Cell) -> np.ndarray:
    """From the hinges towards the middle of the door, (y, z)."""
    ways = {"left": (-1.0, 0.0), "right": (1.0, 0.0), "top": (0.0, -1.0), "bottom": (0.0, 1.0)}
    return np.array(ways[_side(cell)])


def _side(cell: Cell) -> Side:
    assert cell.hinge is not None, "only doors have hinges"
    return cell.hinge
