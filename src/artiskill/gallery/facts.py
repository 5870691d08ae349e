"""Facts about objects as plain values, their statistics split by split, and tables of both."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Joint
from artiskill.assets.catalog import read_catalog
from artiskill.assets.kinematics import shapes_volume_m3

OWN, GENERATED, IMPORTED = "own", "generated", "imported"  # splits of objects that the catalogue does not list
_SHOWN_ELSEWHERE = {"width_m", "depth_m", "height_m", "mass_kg", "handles", "tags", "family", "joints", "held_out"}
_DIGITS = 4


@dataclass(frozen=True)
class JointFacts:
    """One joint: what moves, how, and how far (degrees or metres; None where it turns without end)."""

    name: str
    link: str
    kind: str
    range: float | None
    spring: bool


@dataclass(frozen=True)
class ObjectFacts:
    """One object.

    Attributes:
        id: its name.
        category: `cabinet`, `chair` or `bucket`.
        split: of the catalogue, else `generated`, `imported` or `own`.
        family: what kind of cabinet, chair or bucket; its source where it has none.
        size_m: extent along x (depth), y (width) and z (height) at rest.
        mass_kg: of all links; a wall that it hangs on is none of its own, but counts below.
        joints: every one.
        handles: kinds, sorted, each as often as it occurs.
        tags: what filters may ask for.
        triangles: drawn.
        shapes: that touch.
        content_hash: `ArticulatedObject.content_hash`.
        more: the rest of its metadata, as text.
    """

    id: str
    category: str
    split: str
    family: str
    size_m: tuple[float, float, float]
    mass_kg: float
    joints: tuple[JointFacts, ...]
    handles: tuple[str, ...]
    tags: tuple[str, ...]
    triangles: int
    shapes: int
    content_hash: str
    more: tuple[tuple[str, str], ...]


def object_facts(obj: ArticulatedObject) -> ObjectFacts:
    """Return the facts of an object, its split from the catalogue."""
    meta = obj.metadata
    depth, width, height = (round(float(v), _DIGITS) for v in np.ptp(obj.bounds, axis=0))
    return ObjectFacts(
        id=obj.id,
        category=obj.category,
        split=split_of(obj),
        family=obj.family,
        size_m=(depth, width, height),
        mass_kg=round(object_mass_kg(obj), 3),
        joints=tuple(_joint_facts(link.joint, link.name) for link in obj.links if link.joint is not None),
        handles=tuple(sorted(handle.kind for handle in obj.handles)),
        tags=tuple(str(tag) for tag in meta.get("tags", ())),
        triangles=sum(len(visual.mesh.faces) for link in obj.links for visual in link.visuals),
        shapes=sum(len(link.collisions) for link in obj.links),
        content_hash=obj.content_hash,
        more=tuple((key, _text(value)) for key, value in meta.items() if key not in _SHOWN_ELSEWHERE),
    )


def object_mass_kg(obj: ArticulatedObject) -> float:
    """Return the mass of the object itself, from densities and collision shapes."""
    own = (obj.links[i] for i in obj.own_links)
    return sum(link.density_kg_m3 * shapes_volume_m3(link.collisions) for link in own)


def split_of(obj: ArticulatedObject) -> str:
    """Return the catalogue's split of a generated object that it lists, else where the object comes from."""
    source = {"generated": GENERATED, "PartNet-Mobility": IMPORTED}.get(str(obj.metadata.get("source")), OWN)
    entry = read_catalog().get(obj.id)
    return entry[1].split if entry is not None and source == GENERATED else source


def _joint_facts(joint: Joint, link: str) -> JointFacts:
    lower, upper = joint.limits
    extent: float | None = None
    if math.isfinite(upper - lower):
        extent = round(upper - lower if joint.kind == "prismatic" else math.degrees(upper - lower), _DIGITS)
    return JointFacts(joint.name, link, joint.kind, extent, bool(joint.stiffness > 0))


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Iterable):
        return ", ".join(map(_text, value)) or "none"
    return str(value)


SPLIT_ORDER = ("train", "test", "ood", "generated", "imported", "own")


@dataclass(frozen=True)
class Measure:
    """A number that every object has.

    Attributes:
        name: for people.
        unit: for people; empty for counts.
        of: the number.
    """

    name: str
    unit: str
    of: Callable[[ObjectFacts], float]

    @property
    def is_count(self) -> bool:
        """Whether it counts things."""
        return not self.unit


MEASURES = (
    Measure("width", "m", lambda fact: fact.size_m[1]),
    Measure("depth", "m", lambda fact: fact.size_m[0]),
    Measure("height", "m", lambda fact: fact.size_m[2]),
    Measure("mass", "kg", lambda fact: fact.mass_kg),
    Measure("joints", "", lambda fact: len(fact.joints)),
    Measure("handles", "", lambda fact: len(fact.handles)),
)
NONE = "none"
KINDS: dict[str, Callable[[ObjectFacts], tuple[str, ...]]] = {
    "kinds of handle": lambda fact: tuple(dict.fromkeys(fact.handles)) or (NONE,),
    "family": lambda fact: (fact.family,),
}


def by_split(facts: Sequence[ObjectFacts]) -> dict[str, list[ObjectFacts]]:
    """Return the objects of each split, splits in their usual order, empty ones left out."""
    found: dict[str, list[ObjectFacts]] = {}
    for split in SPLIT_ORDER:
        members = [fact for fact in facts if fact.split == split]
        if members:
            found[split] = members
    return found


def shares(facts: Sequence[ObjectFacts], kinds_of: Callable[[ObjectFacts], tuple[str, ...]]) -> dict[str, int]:
    """Count how many objects have each kind, in alphabetical order."""
    counts = Counter(kind for fact in facts for kind in kinds_of(fact))
    return dict(sorted(counts.items()))


def present_kinds(facts: Sequence[ObjectFacts]) -> list[str]:
    """Return the keys of `KINDS` in which these objects have any kind at all."""
    return [title for title, kinds_of in KINDS.items() if any(kinds_of(fact) != (NONE,) for fact in facts)]


def bin_edges(values: Sequence[float], is_count: bool, most: int = 14) -> np.ndarray:
    """Return edges of bins of one round width that hold all values; small counts get a bin for each number."""
    low, high = min(values), max(values)
    width = 1.0 if is_count and high - low < most else _round_width((high - low) / (most - 2))
    if is_count:
        width = max(1.0, width)
    start = low - 0.5 if is_count and width == 1 else np.floor(low / width + 1e-9) * width
    count = max(1, int(np.ceil((high - start) / width + 1e-9)))
    return np.round(start + width * np.arange(count + 1), 9)


def _round_width(least: float) -> float:
    """Return the smallest of 1, 2, 2.5 and 5 times a power of ten that is no less."""
    if least <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(least))
    return float(next(f * power for f in (1, 2, 2.5, 5, 10) if f * power >= least * (1 - 1e-9)))


def split_table(facts: Sequence[ObjectFacts]) -> str:
    """Return a table with a row per split: number of objects, and each measure's minimum, median and maximum."""
    head = ["split", "objects", *(f"{m.name}, {m.unit}" if m.unit else m.name for m in MEASURES)]
    rows = [
        [split, str(len(members)), *(_spread([m.of(fact) for fact in members], m) for m in MEASURES)]
        for split, members in by_split(facts).items()
    ]
    return markdown(head, rows)


def kinds_table(facts: Sequence[ObjectFacts], title: str) -> str:
    """Return a table with a row per kind: how many objects of each split have it."""
    splits = by_split(facts)
    counts = {split: shares(members, KINDS[title]) for split, members in splits.items()}
    kinds = sorted({kind for row in counts.values() for kind in row})
    rows = [[kind.replace("_", " "), *(str(counts[split].get(kind, 0)) for split in splits)] for kind in kinds]
    return markdown([title, *splits], rows)


def _spread(values: list[float], measure: Measure) -> str:
    low, middle, high = min(values), float(np.median(values)), max(values)
    if measure.is_count:
        return f"{low:g} .. {middle:g} .. {high:g}"
    return f"{low:.2f} .. {middle:.2f} .. {high:.2f}" if high < 10 else f"{low:.1f} .. {middle:.1f} .. {high:.1f}"


def markdown(head: list[str], rows: list[list[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
