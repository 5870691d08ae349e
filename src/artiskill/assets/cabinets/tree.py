"""The front as a tree of splits, and how it becomes cells and the boards between them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

from artiskill.assets.cabinets.spec import CellKind, FrontStyle, Rect, Side


@dataclass(frozen=True)
class Leaf:
    """A field of the front that is not split any more.

    Attributes:
        kind: what fills it.
        shelves: number of shelves, in open cells and behind doors.
        hinge: of a flap, `top` or `bottom`; None for all else: where doors stand says where their hinges are.
    """

    kind: CellKind
    shelves: int = 0
    hinge: Side | None = None


@dataclass(frozen=True)
class Split:
    """A region cut into rows (top to bottom) or columns (left to right, as seen from the room).

    Attributes:
        axis: which way.
        sizes_m: clear height of each row, or width of each column; the last takes what is left.
        children: as many as sizes.
        divider: a whole board between neighbours, a rail at the front only, or nothing.
    """

    axis: Literal["rows", "columns"]
    sizes_m: tuple[float, ...]
    children: tuple["Node", ...]
    divider: Literal["board", "rail", "none"]


Node = Leaf | Split


@dataclass(frozen=True)
class Edge:
    """What bounds a region on one side.

    Attributes:
        kind: the carcass's `outer` panel, a `divider`, nothing (`free`: the next front follows), or the
            overhanging top (`under`), which fronts cannot cover.
        thickness_m: of that board.
    """

    kind: Literal["outer", "divider", "free", "under"]
    thickness_m: float


@dataclass(frozen=True)
class Region:
    """A clear opening with its four edges."""

    rect: Rect
    left: Edge
    right: Edge
    bottom: Edge
    top: Edge


@dataclass(frozen=True)
class Placed:
    """A leaf with its region, or (leaf None) a divider with its rectangle in `region` and its kind."""

    leaf: Leaf | None
    region: Region
    divider: Literal["board", "rail", "none"] = "none"


def resolve(node: Node, region: Region, panel_m: float) -> Iterator[Placed]:
    """Walk the tree; yield the leaves with their clear openings, and the dividers between them."""
    if isinstance(node, Leaf):
        yield Placed(node, region)
        return
    thickness = 0.0 if node.divider == "none" else panel_m
    inner = Edge("free" if node.divider == "none" else "divider", thickness)
    rows = node.axis == "rows"
    r = region.rect
    at = r.z1 if rows else r.y1  # rows go down, columns to the right, which is towards -y
    last = len(node.children) - 1
    for k, (size, child) in enumerate(zip(node.sizes_m, node.children, strict=True)):
        end = (r.z0 if rows else r.y0) if k == last else at - size
        if rows:
            rect = replace(r, z0=end, z1=at)
            part = replace(
                region,
                rect=rect,
                top=region.top if k == 0 else inner,
                bottom=region.bottom if k == last else inner,
            )
        else:
            rect = replace(r, y0=end, y1=at)
            part = replace(
                region,
                rect=rect,
                left=region.left if k == 0 else inner,
                right=region.right if k == last else inner,
            )
        yield from resolve(child, part, panel_m)
        if k < last and thickness > 0:
            slit = replace(r, z0=end - thickness, z1=end) if rows else replace(r, y0=end - thickness, y1=end)
            yield Placed(None, replace(region, rect=slit), node.divider)
        at = end - thickness


def front_rect(region: Region, front: FrontStyle) -> Rect:
    """The rectangle of the panel that closes a region, slits left free all around it."""
    left, right, bottom, top = (
        _reach(edge, front) for edge in (region.left, region.right, region.bottom, region.top)
    )
    r = region.rect
    return Rect(round(r.y0 - right, 5), round(r.y1 + left, 5), round(r.z0 - bottom, 5), round(r.z1 + top, 5))


def _reach(edge: Edge, front: FrontStyle) -> float:
    """How far a front reaches over the clear opening's edge; negative: how far it stays away."""
    half = front.gap_m / 2
    if edge.kind == "free":
        return -half
    if front.mount == "inset" or edge.kind == "under":
        return -front.gap_m
    return (edge.thickness_m if edge.kind == "outer" else edge.thickness_m / 2) - half
