"""`CabinetSpec`: every resolved number of one cabinet, from which it is built without further choices of form.

Lengths are metres in the object frame: x points into the cabinet (the front faces -x), y to the left of whoever
stands before it, z up. The carcass is centred on x = y = 0.
"""

from dataclasses import dataclass
from typing import Literal

from artiskill.assets.cabinets.appearance import CabinetAppearance
from artiskill.assets.finishes import Surface

SupportKind = Literal["plinth", "sides", "legs", "casters", "floor", "wall"]
LegShape = Literal["round", "square", "splayed", "bun", "sled"]
CellKind = Literal["drawer", "door", "open", "blind"]
Side = Literal["left", "right", "top", "bottom"]
FaceKind = Literal["slab", "shaker", "raised", "glazed", "louvred", "planks"]
HandleKind = Literal["bar", "bow", "knob", "ring", "lip", "slot", "cup"]

# Overlay fronts rest on bumpers: this much air before the carcass.
BUMPER_M = 0.002


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
    """One model of handle; the fronts of a cabinet share it."""

    kind: HandleKind  # how it is built, see `pulls`
    shape: str  # a variant of the kind: its section (`round`, `square`, `flat`) or form, see the kind's builder
    diameter_m: float  # of what the fingers close on: a bar, a knob's head, a ring's wire, a lip's board
    projection_m: float  # from the front's face to the handle's outermost surface; how deep a slot is
    # its extent across the direction in which it is long: a ring's outer diameter, a lip's flange, a slot's
    # opening, a cup's height; of a bar, a bow and a knob their diameter
    size_m: float
    overhang_m: float  # how far a bar reaches beyond its posts
    post_m: float  # diameter of posts, of a knob's or a ring's neck


@dataclass(frozen=True)
class HandlePlace:
    """Where a handle sits on its front."""

    y: float  # of its centre
    z: float
    # distance of the posts of a bar, a bow or a cup; length of a lip or a slot; 0 for knobs and rings
    length_m: float
    vertical: bool  # whether it stands upright
    # a lip's flange lies above it or to its right, where otherwise it lies below or to the left
    mirrored: bool = False

    def reach(self, model: HandleModel) -> tuple[float, float]:
        """Return how far the handle reaches from its centre, along y and along z."""
        along = max(self.length_m / 2 + model.overhang_m, model.size_m / 2)
        across = model.size_m / 2
        return (across, along) if self.vertical else (along, across)


@dataclass(frozen=True)
class Cell:
    """One field of the front."""

    kind: CellKind  # what fills it
    clear: Rect  # the opening between the boards around it
    front: Rect | None = None  # the rectangle of its front panel; None for an open cell
    face: FaceKind = "slab"  # what the front looks like
    # the side of a door's hinge, as seen from the room, `top` and `bottom` for flaps; None otherwise
    hinge: Side | None = None
    limit: float = 0.0  # how far it opens: metres (drawer) or radians (door); 0 for what does not move
    box_height_m: float = 0.0  # height of a drawer's box, else 0
    box_length_m: float = 0.0  # depth of a drawer's box, else 0
    handle: HandlePlace | None = None  # None where there is none


@dataclass(frozen=True)
class Support:
    """What the carcass stands on, or hangs on."""

    # a closed `plinth`, `sides` that reach the ground with a kick board between them, `legs`, `casters`, the
    # `floor` itself, or a `wall`, with nothing below
    kind: SupportKind
    height_m: float  # of the carcass's lower edge above the ground
    setback_m: float  # of what stands below, from the carcass's edges
    leg_m: float  # thickness of legs, diameter of casters' wheels
    leg_shape: LegShape  # of legs


@dataclass(frozen=True)
class Wall:
    """The wall that a cabinet hangs on: upright, plain, from the floor up, the cabinet before its middle."""

    width_m: float
    height_m: float
    thickness_m: float
    surface: Surface  # what it is painted with


@dataclass(frozen=True)
class Top:
    """The top board."""

    thickness_m: float  # all of it, steps of a moulding included
    front_m: float  # how far it stands over the carcass in front
    side_m: float  # how far it stands over the carcass at the sides
    steps: int  # boards that it is made of, each standing out over the one below: more than one is a cornice
    upstand_m: float  # height of a board along its back edge; 0 for none


@dataclass(frozen=True)
class FrontStyle:
    """What the fronts of a cabinet share."""

    mount: Literal["overlay", "inset"]  # over the carcass's edges, or between them
    face: FaceKind  # what they look like; small ones may be plainer
    thickness_m: float  # of the panel, or of the frame
    gap_m: float  # width of the slits
    frame_m: float  # width of a frame's members; 0 for fronts without frames
    recess_m: float  # how far the field lies behind its frame
    muntins: tuple[int, int]  # panes side by side and one above the other, of glazed fronts
    plank_m: float  # width of the boards of a front of planks, distance of the slats of a louvred one
    bow_m: float  # how far the face bulges out in the cabinet's middle
    # hinge axes stand this far before the face, as the knuckles of a barrel hinge do: an open door then clears
    # its neighbour's face at every angle
    knuckle_m: float


@dataclass(frozen=True)
class CabinetSpec:
    """One cabinet; see the module's docstring for frames and units."""

    family: str  # kind of furniture
    held_out: bool  # whether it is of a family that training and test never see
    width_m: float  # of the carcass
    depth_m: float  # of the carcass
    height_m: float  # from the ground to the top
    panel_m: float  # thickness of the carcass's panels
    back_m: float  # thickness of the back
    side_m: float  # thickness of drawer boxes' sides
    bottom_m: float  # thickness of drawer boxes' bottoms
    support: Support
    top: Top
    front: FrontStyle
    drawer_handle: HandleModel
    door_handle: HandleModel
    cells: tuple[Cell, ...]  # fields of the front, from the top left to the bottom right
    boards: tuple[Board, ...]  # dividers, rails and shelves
    appearance: CabinetAppearance  # materials
    density_kg_m3: float  # of the board that it is made of
    wall: Wall | None = None  # what it hangs on; None where it stands on the floor

    @property
    def face_x(self) -> float:
        """Where the fronts' outer face lies, along x."""
        return face_x(self.depth_m, self.front)

    def count(self, kind: CellKind) -> int:
        """Return how many cells are of a kind."""
        return [cell.kind for cell in self.cells].count(kind)

    def handle_of(self, cell: Cell) -> HandleModel:
        """Return the model that a door or a drawer carries."""
        return self.drawer_handle if cell.kind == "drawer" else self.door_handle

    def bulge_m(self, y: float) -> float:
        """Return how far the fronts' face stands before `face_x` at a y: a parabola over the cabinet's width."""
        return self.front.bow_m * max(0.0, 1.0 - (2.0 * y / self.width_m) ** 2)


def face_x(depth_m: float, front: FrontStyle) -> float:
    """Return where the outer face of fronts lies, along x: flush with the carcass, or before it."""
    return -depth_m / 2 - (front.thickness_m + BUMPER_M if front.mount == "overlay" else 0.0)
