"""`CabinetSpec`: every resolved number of one cabinet, from which it is built without further choices of form.

Lengths are metres in the object frame: x points into the cabinet (the front faces -x), y to the left of whoever
stands before it, z up. The carcass is centred on x = y = 0.
"""

from dataclasses import dataclass
from typing import Literal

from artiskill.assets.appearance import CabinetAppearance

CellKind = Literal["drawer", "door", "open", "blind"]
Side = Literal["left", "right"]

# Overlay fronts rest on bumpers: this much air before the carcass.
BUMPER_M = 0.002
# Hinge axes stand this far before the front's face, as the knuckles of a barrel hinge do: an open door then clears
# its neighbour's face at every angle.
KNUCKLE_M = 0.002


@dataclass(frozen=True)
class Rect:
    """A rectangle in the plane of the front; `y1` is its left edge as seen from the room."""

    y0: float
    y1: float
    z0: float
    z1: float

    @property
    def width(self) -> float:
        """Along y."""
        return self.y1 - self.y0

    @property
    def height(self) -> float:
        """Along z."""
        return self.z1 - self.z0

    @property
    def centre(self) -> tuple[float, float]:
        """(y, z)."""
        return (self.y0 + self.y1) / 2, (self.z0 + self.z1) / 2


@dataclass(frozen=True)
class Board:
    """A panel between two cells, or a shelf within one: its rectangle in the front's plane and its x range."""

    rect: Rect
    x0: float
    x1: float
    part: str


@dataclass(frozen=True)
class HandleModel:
    """The one model of handle that a cabinet's fronts carry.

    Attributes:
        kind: how it is built, a key of `pulls.BUILDERS`.
        section: `round` or `square` bar.
        diameter_m: of the bar, or its side.
        projection_m: from the front's face to the bar's outermost surface.
        overhang_m: how far the bar reaches beyond its posts.
        post_m: diameter of the posts.
    """

    kind: Literal["bar"]
    section: Literal["round", "square"]
    diameter_m: float
    projection_m: float
    overhang_m: float
    post_m: float


@dataclass(frozen=True)
class HandlePlace:
    """Where a handle sits on its front: centre (y, z), distance of its posts, and whether it stands upright."""

    y: float
    z: float
    centres_m: float
    vertical: bool


@dataclass(frozen=True)
class Cell:
    """One field of the front.

    Attributes:
        kind: what fills it.
        clear: the opening between the boards around it.
        front: the rectangle of its front panel; None for an open cell.
        framed: whether the front is a shaker frame.
        hinge: the side of a door's hinge, as seen from the room; None otherwise.
        limit: how far it opens: metres (drawer) or radians (door); 0 for what does not move.
        box_height_m: height of a drawer's box, else 0.
        box_length_m: depth of a drawer's box, else 0.
        handle: None where there is none.
    """

    kind: CellKind
    clear: Rect
    front: Rect | None
    framed: bool
    hinge: Side | None
    limit: float
    box_height_m: float
    box_length_m: float
    handle: HandlePlace | None


@dataclass(frozen=True)
class Support:
    """What the carcass stands on: a `plinth`, `legs` (round or square) or, with height 0, the `floor`."""

    kind: Literal["plinth", "legs", "floor"]
    height_m: float
    setback_m: float
    leg_m: float
    leg_shape: Literal["round", "square"]


@dataclass(frozen=True)
class Top:
    """The top board: thickness, and how far it stands over the carcass in front and at the sides."""

    thickness_m: float
    front_m: float
    side_m: float


@dataclass(frozen=True)
class FrontStyle:
    """What the fronts of a cabinet share.

    Attributes:
        mount: over the carcass's edges, or between them.
        thickness_m: of the panel, or of a shaker front's frame.
        gap_m: width of the slits.
        frame_m: width of a shaker frame's members; 0 for slab fronts.
        recess_m: how far a shaker front's field lies behind its frame.
    """

    mount: Literal["overlay", "inset"]
    thickness_m: float
    gap_m: float
    frame_m: float
    recess_m: float


@dataclass(frozen=True)
class CabinetSpec:
    """One cabinet; see the module's docstring for frames and units.

    Attributes:
        family: kind of furniture.
        width_m, depth_m, height_m: outer sizes of the carcass, the height from the ground.
        panel_m: thickness of the carcass's panels.
        back_m: thickness of the back.
        side_m: thickness of drawer boxes' sides.
        bottom_m: thickness of drawer boxes' bottoms.
        support, top, front, handle: see there.
        cells: fields of the front, from the top left to the bottom right.
        boards: dividers, rails and shelves.
        appearance: materials.
        density_kg_m3: of the board that it is made of.
    """

    family: str
    width_m: float
    depth_m: float
    height_m: float
    panel_m: float
    back_m: float
    side_m: float
    bottom_m: float
    support: Support
    top: Top
    front: FrontStyle
    handle: HandleModel
    cells: tuple[Cell, ...]
    boards: tuple[Board, ...]
    appearance: CabinetAppearance
    density_kg_m3: float

    @property
    def face_x(self) -> float:
        """Where the fronts' outer face lies, along x."""
        return face_x(self.depth_m, self.front)

    def count(self, kind: CellKind) -> int:
        """How many cells are of a kind."""
        return sum(cell.kind == kind for cell in self.cells)

    @property
    def collision_count(self) -> int:
        """How many collision shapes the built cabinet has: bars have three, drawers five, doors one."""
        support = {"plinth": 1, "legs": 4, "floor": 0}[self.support.kind]
        handles = sum(cell.handle is not None for cell in self.cells)
        carcass = 5 + support + len(self.boards) + self.count("blind")
        return carcass + 5 * self.count("drawer") + self.count("door") + 3 * handles


def face_x(depth_m: float, front: FrontStyle) -> float:
    """Where the outer face of fronts lies, along x: flush with the carcass, or before it."""
    return -depth_m / 2 - (front.thickness_m + BUMPER_M if front.mount == "overlay" else 0.0)
