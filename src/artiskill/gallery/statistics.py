"""How objects are spread over sizes, masses, joints, handles and families, split by split."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from artiskill.gallery.facts import ObjectFacts

SPLIT_ORDER = ("train", "test", "ood", "generated", "imported", "own")


@dataclass(frozen=True)
class Measure:
    """A number that every object has.

    Attributes:
        name: for people.
        unit: likewise, empty for counts.
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
    """Objects of each split, splits in their usual order, empty ones left out."""
    found: dict[str, list[ObjectFacts]] = {}
    for split in SPLIT_ORDER:
        members = [fact for fact in facts if fact.split == split]
        if members:
            found[split] = members
    return found


def shares(facts: Sequence[ObjectFacts], kinds_of: Callable[[ObjectFacts], tuple[str, ...]]) -> dict[str, int]:
    """How many objects have each kind, in alphabetical order."""
    counts = Counter(kind for fact in facts for kind in kinds_of(fact))
    return dict(sorted(counts.items()))


def told_kinds(facts: Sequence[ObjectFacts]) -> list[str]:
    """The keys of `KINDS` in which these objects have any kind at all."""
    return [title for title, kinds_of in KINDS.items() if any(kinds_of(fact) != (NONE,) for fact in facts)]


def histogram(values: Sequence[float], edges: np.ndarray) -> np.ndarray:
    """How many values lie in each bin; the last includes its upper edge. -> (bins,)."""
    return np.histogram(np.asarray(values, dtype=float), bins=edges)[0]


def bin_edges(values: Sequence[float], is_count: bool, most: int = 14) -> np.ndarray:
    """Edges of bins of one round width that hold all values; a bin for each whole number of a small count."""
    low, high = min(values), max(values)
    width = 1.0 if is_count and high - low < most else _round_width((high - low) / (most - 2))
    if is_count:
        width = max(1.0, width)
    start = low - 0.5 if is_count and width == 1 else np.floor(low / width + 1e-9) * width
    count = max(1, int(np.ceil((high - start) / width + 1e-9)))
    return np.round(start + width * np.arange(count + 1), 9)


def median(values: Sequence[float]) -> float:
    """The median."""
    return float(np.median(np.asarray(values, dtype=float)))


def _round_width(least: float) -> float:
    """The smallest of 1, 2, 2.5 and 5 times a power of ten that is no less."""
    if least <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(least))
    return float(next(f * power for f in (1, 2, 2.5, 5, 10) if f * power >= least * (1 - 1e-9)))
