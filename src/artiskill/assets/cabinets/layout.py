"""How a front is split: `LayoutSampler` draws a tree of rows and columns, `resolve` turns it into openings."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from artiskill.assets.cabinets.config import CabinetConfig, CabinetFamilyConfig
from artiskill.assets.cabinets.spec import CellKind, FrontStyle, Rect, Side
from artiskill.assets.generators import pick

MAX_DEPTH = 3


@dataclass(frozen=True)
class Leaf:
    """A field of the front that is not split any more."""

    kind: CellKind  # what fills it
    shelves: int = 0  # number of shelves, in open cells and behind doors
    # of a flap, `top` or `bottom`; None for all else: where doors stand says where their hinges are
    hinge: Side | None = None


@dataclass(frozen=True)
class Split:
    """A region cut into rows (top to bottom) or columns (left to right, as seen from the room)."""

    axis: Literal["rows", "columns"]  # which way
    sizes_m: tuple[float, ...]  # clear height of each row, or width of each column; the last takes what is left
    children: tuple["Node", ...]  # as many as sizes
    # a whole board between neighbours, a rail at the front only, or nothing
    divider: Literal["board", "rail", "none"]


Node = Leaf | Split


@dataclass(frozen=True)
class Edge:
    """What bounds a region on one side."""

    # the carcass's `outer` panel, a `divider`, nothing (`free`: the next front follows), or the overhanging
    # top (`under`), which fronts cannot cover
    kind: Literal["outer", "divider", "free", "under"]
    thickness_m: float  # of that board


@dataclass(frozen=True)
class Region:
    """A clear opening with its four edges."""

    rect: Rect
    left: Edge
    right: Edge
    bottom: Edge
    top: Edge


@dataclass(frozen=True)
class Placement:
    """A leaf with its region, or (leaf None) a divider with its rectangle in `region` and its kind."""

    leaf: Leaf | None
    region: Region
    divider: Literal["board", "rail", "none"] = "none"


class LayoutSampler:
    """Draws the tree of splits for one cabinet."""

    def __init__(
        self,
        rng: np.random.Generator,
        config: CabinetConfig,
        family: CabinetFamilyConfig,
        panel_m: float,
        inset: bool,
    ) -> None:
        """Keep what all regions share; `inset` tells whether fronts lie within the carcass."""
        self._rng = rng
        self._config = config
        self._family = family
        self._panel_m = panel_m
        self._inset = inset

    def compose(self, width: float, height: float, depth: int = 0) -> Node:
        """Draw what a clear region of this size becomes."""
        weights = {k: w for k, w in self._family.layouts.items() if self._fits(k, width, height, depth)}
        kind = pick(self._rng, weights) if any(weights.values()) else "open"
        if kind == "columns":
            return self._columns(width, height, depth)
        if kind == "rows":
            return self._rows(width, height, depth)
        if kind == "strip":
            return self._strip(width, height, depth)
        return self._fill(kind, width, height)

    def _fits(self, kind: str, width: float, height: float, depth: int) -> bool:
        c = self._config
        if kind == "columns":
            return depth < 2 and width >= 2.2 * c.door_width_m[0] and height >= c.door_height_m[0]
        if kind == "strip":
            return depth < MAX_DEPTH - 1 and height >= 2.6 * c.drawer_height_m[0]
        if kind == "rows":
            return depth < MAX_DEPTH - 1 and height >= 2.2 * c.door_height_m[0]
        if kind == "flap":
            return _within(height, c.flap_height_m) and _within(width, c.flap_width_m)
        if kind == "drawers":
            return self._drawer_counts(height) != [] and _within(width, c.drawer_width_m)
        if kind == "door":
            least, most = c.door_width_m
            return _within(height, c.door_height_m) and least <= width <= 2 * most
        return True

    def _columns(self, width: float, height: float, depth: int) -> Split:
        least = self._config.door_width_m[0]
        most = 3 if width >= 3.2 * least else 2
        count = int(self._rng.integers(2, most + 1))
        clear = width - (count - 1) * self._panel_m
        parts = np.ones(count)
        if self._rng.random() < 0.5:
            spare = clear / least / count  # how much a column may shrink
            parts = self._rng.uniform(1.0, min(1.8, spare), count)
        sizes = _rounded(clear * parts / parts.sum())
        children = tuple(self.compose(w, height, depth + 1) for w in sizes)
        return Split("columns", sizes, children, "board")

    def _rows(self, width: float, height: float, depth: int) -> Split:
        """Draw two regions one above the other, of any kind."""
        clear = height - self._panel_m
        least = self._config.door_height_m[0] / clear
        low, high = max(least, 0.35), min(1 - least, 0.65)
        top = round(clear * float(self._rng.uniform(low, max(low, high))), 4)
        rest = round(clear - top, 4)
        children = (self.compose(width, top, depth + 1), self.compose(width, rest, depth + 1))
        return Split("rows", (top, rest), children, "board")

    def _strip(self, width: float, height: float, depth: int) -> Split:
        """Draw a low row of drawers, a niche or a blind panel above or below the rest."""
        c = self._config
        kinds = dict(c.strips)
        if not _within(width, c.drawer_width_m):
            kinds["drawers"] = 0.0
        kind = pick(self._rng, kinds)
        low, high = c.drawer_height_m
        most = min(0.22 if kind != "open" else 0.32, height - 1.3 * low, high)
        size = round(float(self._rng.uniform(low, max(low, most))), 4)
        rest = round(height - size - self._panel_m, 4)
        strip = self._drawer_row(width) if kind == "drawers" else Leaf("open" if kind == "open" else "blind")
        main = self.compose(width, rest, depth + 1)
        if self._rng.random() < c.strip_below_probability:
            return Split("rows", (rest, size), (main, strip), "board")
        return Split("rows", (size, rest), (strip, main), "board")

    def _fill(self, kind: str, width: float, height: float) -> Node:
        if kind == "drawers":
            return self._drawers(width, height)
        if kind == "door":
            shelves = int(self._rng.integers(0, 2 + round(height / 0.45)))
            least, most = self._config.door_width_m
            pair = width >= 2 * least and (width > most or self._rng.random() < 0.4)
            if not pair:
                return Leaf("door", shelves)
            half = round(width / 2, 4)
            return Split("columns", (half, half), (Leaf("door", shelves), Leaf("door", shelves)), "none")
        if kind == "flap":
            return Leaf("door", int(self._rng.integers(0, 2)), "top" if self._rng.random() < 0.4 else "bottom")
        if kind == "open":
            return Leaf("open", int(height / 0.35))
        return Leaf("blind")

    def _drawer_row(self, width: float) -> Node:
        """Draw one drawer, or two or three side by side."""
        least = self._config.drawer_width_m[0] + self._panel_m
        most = min(3, int(width / least))
        count = int(self._rng.integers(2, most + 1)) if most >= 2 and self._rng.random() < 0.35 else 1
        if count == 1:
            return Leaf("drawer")
        size = round((width - (count - 1) * self._panel_m) / count, 4)
        return Split("columns", (size,) * count, (Leaf("drawer"),) * count, "board")

    def _drawer_counts(self, height: float) -> list[int]:
        low, high = self._config.drawer_height_m
        return [n for n in range(1, 6) if low <= (height - (n - 1) * self._panel_m) / n <= high]

    def _drawers(self, width: float, height: float) -> Node:
        """Draw a stack of drawers: of equal height, or growing downwards as in most chests."""
        counts = self._drawer_counts(height)
        count = int(self._rng.choice(counts))
        if count == 1:
            return Leaf("drawer")
        divider: Literal["rail", "none"] = "rail" if self._inset else "none"
        clear = height - (count - 1) * (self._panel_m if self._inset else 0.0)
        low, high = self._config.drawer_height_m
        parts = np.ones(count)
        if self._rng.random() < 0.6:
            grown = np.cumsum(np.concatenate(([1.0], self._rng.uniform(0.0, 0.5, count - 1))))
            grown_m = clear * grown / grown.sum()
            parts = grown if grown_m.min() >= low and grown_m.max() <= high else parts
        sizes = _rounded(clear * parts / parts.sum())
        children: list[Node] = [Leaf("drawer")] * count
        if width > 0.6:
            children[0] = self._drawer_row(width)
        return Split("rows", sizes, tuple(children), divider)


def resolve(node: Node, region: Region, panel_m: float) -> Iterator[Placement]:
    """Yield the leaves of a tree with their clear openings, and the dividers between them."""
    if isinstance(node, Leaf):
        yield Placement(node, region)
        return
    thickness = 0.0 if node.divider == "none" else panel_m
    inner = Edge("free" if node.divider == "none" else "divider", thickness)
    # rows go down; columns go to the right, which is towards -y
    low, high, first, second = (
        ("z0", "z1", "top", "bottom") if node.axis == "rows" else ("y0", "y1", "left", "right")
    )
    r, last = region.rect, len(node.children) - 1
    at = getattr(r, high)
    for k, (size, child) in enumerate(zip(node.sizes_m, node.children, strict=True)):
        end = getattr(r, low) if k == last else at - size
        edges = {first: getattr(region, first) if k == 0 else inner}
        edges[second] = getattr(region, second) if k == last else inner
        part = replace(region, rect=replace(r, **{low: end, high: at}), **edges)
        yield from resolve(child, part, panel_m)
        if k < last and thickness > 0:
            slit = replace(r, **{low: end - thickness, high: end})
            yield Placement(None, replace(region, rect=slit), node.divider)
        at = end - thickness


def front_rect(region: Region, front: FrontStyle) -> Rect:
    """Return the rectangle of the panel that closes a region, with slits all around it."""
    edges = (region.left, region.right, region.bottom, region.top)
    left, right, bottom, top = (_reach(edge, front) for edge in edges)
    r = region.rect
    return Rect(round(r.y0 - right, 5), round(r.y1 + left, 5), round(r.z0 - bottom, 5), round(r.z1 + top, 5))


def _reach(edge: Edge, front: FrontStyle) -> float:
    """Return how far a front reaches over the clear opening's edge; negative where it stays away from it."""
    half = front.gap_m / 2
    if edge.kind == "free":
        return -half
    if front.mount == "inset" or edge.kind == "under":
        return -front.gap_m
    return (edge.thickness_m if edge.kind == "outer" else edge.thickness_m / 2) - half


def _rounded(values: np.ndarray) -> tuple[float, ...]:
    return tuple(round(float(v), 4) for v in values)


def _within(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] <= value <= limits[1]
