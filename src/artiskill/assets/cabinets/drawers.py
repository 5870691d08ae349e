"""The hollow box behind a drawer's front, with its runners."""

from artiskill.assets.cabinets.boards import Boards
from artiskill.assets.cabinets.materials import Materials
from artiskill.assets.cabinets.openings import BOX_FLOOR_M, RUNNER_SPACE_M
from artiskill.assets.cabinets.spec import CabinetSpec, Cell

BOX_SHAPES = 4  # that are touched
_RUNNER_M = (0.009, 0.036)  # thickness and height of what is seen of a runner
_BOTTOM_GROOVE_M = 0.008  # a drawer's bottom sits this far above its sides' lower edge


def add_box(parts: Boards, spec: CabinetSpec, cell: Cell, materials: Materials) -> None:
    """Add sides, back, bottom and runners; the box is open at the top."""
    x0 = spec.face_x + spec.front.thickness_m
    x1 = x0 + cell.box_length_m
    y0, y1 = cell.clear.y0 + RUNNER_SPACE_M, cell.clear.y1 - RUNNER_SPACE_M
    z0 = cell.clear.z0 + BOX_FLOOR_M
    z1 = z0 + cell.box_height_m
    t = spec.side_m
    inside = materials.interior
    parts.panel((x0, y0, z0), (x1, y0 + t, z1), inside, "drawer_side", grain=0)
    parts.panel((x0, y1 - t, z0), (x1, y1, z1), inside, "drawer_side", grain=0)
    parts.panel((x1 - t, y0 + t, z0), (x1, y1 - t, z1), inside, "drawer_back", grain=1)
    floor = z0 + _BOTTOM_GROOVE_M
    parts.panel((x0, y0 + t, floor), (x1 - t, y1 - t, floor + spec.bottom_m), inside, "drawer_bottom", grain=0)
    thick, high = _RUNNER_M[0], min(_RUNNER_M[1], cell.box_height_m - 0.006)
    middle = (z0 + z1) / 2
    for low in (y0 - thick, y1):
        corners = (x0, low, middle - high / 2), (x1, low + thick, middle + high / 2)
        parts.panel(*corners, materials.runner, "runner", collide=False)
