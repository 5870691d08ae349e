"""Select the catalogue's objects anew: `python tools/select_objects.py [CATEGORY ...]`.

Run it after a generator or a family has changed. It walks the seeds, keeps the objects that fill the counts of the
benchmark, and writes `configs/catalog`. A near duplicate of an object already chosen is skipped, whatever split
that object is in.
"""

import sys
from collections import Counter
from collections.abc import Callable, Hashable, Mapping, Sequence
from itertools import count
from typing import Any

import numpy as np
import yaml

from artiskill.assets.articulated_object import CATEGORIES, ArticulatedObject, Category
from artiskill.assets.catalog import BENCHMARK_SPLITS, CATALOG_DIR, HELD_OUT_SPLIT, CatalogEntry
from artiskill.assets.generators import generate
from artiskill.assets.similarity import NEAR_DUPLICATE_M, Descriptor, describe, nearest_neighbour
from artiskill.config import to_mapping

# Of the ManiSkill benchmark's tables: how many cabinets have so many target drawers. 25 with 49 and 10 with 21.
DRAWER_COUNTS = {"train": {1: 9, 2: 10, 3: 4, 4: 2}, "test": {1: 3, 2: 4, 3: 2, 4: 1}}
# Cabinets with target doors and the sum of these doors, for which cabinets without drawers fill up.
DOOR_TOTALS = {"train": (42, 66), "test": (10, 16)}
OBJECT_COUNTS: dict[Category, dict[str, int]] = {
    "chair": {"train": 26, "test": 10},
    "bucket": {"train": 29, "test": 10},
}
HELD_OUT_COUNT = 12  # of each category
_MARGIN = 1.05  # the nearest neighbour's distance is found by sampling
_MOST_DOORS = 2  # of a cabinet that also has drawers
_SEEDS_TO_MEET_ALL = 60  # of held-out objects, among which every family occurs
_Key = tuple[int, bool]  # a seed, and whether it is of a held-out family
_Kind = Callable[[ArticulatedObject], Hashable]  # which of several counters an object belongs to


class Selection:
    """The objects of one category chosen so far, without near duplicates."""

    def __init__(self, category: Category) -> None:
        """Start with none."""
        self.category = category
        self.splits: dict[_Key, str] = {}
        self._described: list[Descriptor] = []

    def object(self, key: _Key) -> ArticulatedObject:
        """Return the object of a seed."""
        seed, held_out = key
        return generate(self.category, seed, f"candidate-{self.category}-{seed}", held_out)

    def find(self, counts: Mapping[Any, int], kind: _Kind, held_out: bool = False) -> list[_Key]:
        """Walk the seeds until every kind of object has been met as often as wanted.

        Args:
            counts: how many of each kind are wanted.
            kind: tells an object's kind.
            held_out: whether held-out families are drawn.
        """
        wanted = Counter(counts)
        found: list[_Key] = []
        for seed in count():
            if not wanted.total():
                return found
            key = (seed, held_out)
            candidate = self.object(key)
            if key not in self.splits and wanted[kind(candidate)] > 0 and self._is_new(candidate):
                wanted[kind(candidate)] -= 1
                found.append(key)
        raise AssertionError("there is no last seed")

    def assign(self, keys: Sequence[_Key], counts: Mapping[str, Mapping[Hashable, int]], kind: _Kind) -> None:
        """Divide objects into training and test ones, so that the test ones show every look there is.

        The next test object of a kind is one whose look (see `_look`) is the rarest in the test split so far,
        relative to how many objects have it; a fixed draw breaks ties.

        Args:
            keys: the objects.
            counts: of each kind, by split.
            kind: tells an object's kind.
        """
        order = [keys[i] for i in np.random.default_rng(0).permutation(len(keys))]
        looks = {key: _look(self.object(key)) for key in order}
        common, tested = Counter(looks.values()), Counter[Hashable]()
        missing = Counter(counts["test"])
        self.splits.update(dict.fromkeys(keys, "train"))
        while missing.total():
            legal = [k for k in order if self.splits[k] == "train" and missing[kind(self.object(k))] > 0]
            chosen = min(legal, key=lambda k: (tested[looks[k]] / common[looks[k]], order.index(k)))
            self.splits[chosen] = "test"
            tested[looks[chosen]] += 1
            missing[kind(self.object(chosen))] -= 1

    def entries(self) -> list[CatalogEntry]:
        """Return the entries in the order of their seeds, held-out families last."""
        chosen = sorted(self.splits, key=lambda key: (key[1], key[0]))
        return [self._entry(number, *key) for number, key in enumerate(chosen, start=1)]

    def _entry(self, number: int, seed: int, held_out: bool) -> CatalogEntry:
        obj = generate(self.category, seed, f"{self.category}-{number:04d}", held_out)
        is_cabinet = self.category == "cabinet"
        return CatalogEntry(
            id=obj.id,
            seed=seed,
            split=self.splits[seed, held_out],
            family=str(obj.metadata["family"]),
            content_hash=obj.content_hash,
            drawers=obj.target_links("prismatic") if is_cabinet else (),
            doors=obj.target_links("revolute") if is_cabinet else (),
        )

    def _is_new(self, candidate: ArticulatedObject) -> bool:
        described = describe(candidate)
        nearest = nearest_neighbour(described, self._described)
        if nearest is not None and nearest.distance_m < _MARGIN * NEAR_DUPLICATE_M[self.category]:
            return False
        self._described.append(described)
        return True


def select(category: Category) -> list[CatalogEntry]:
    """Select the objects of a category."""
    selection = Selection(category)
    if category == "cabinet":
        _fill(selection, DRAWER_COUNTS, _drawers)
        _fill(selection, _wanted_doors(selection), _doors)
    else:
        _fill(selection, {split: {True: n} for split, n in OBJECT_COUNTS[category].items()}, lambda _: True)
    families = sorted({_family(selection.object((seed, True))) for seed in range(_SEEDS_TO_MEET_ALL)})
    per_family = dict.fromkeys(families, -(-HELD_OUT_COUNT // len(families)))
    for key in selection.find(per_family, _family, held_out=True)[:HELD_OUT_COUNT]:
        selection.splits[key] = HELD_OUT_SPLIT
    return selection.entries()


def _fill(selection: Selection, counts: Mapping[str, Mapping[Any, int]], kind: _Kind) -> None:
    both: Counter[Hashable] = Counter()
    for split in BENCHMARK_SPLITS:
        both.update(counts[split])
    selection.assign(selection.find(both, kind), counts, kind)


def _family(obj: ArticulatedObject) -> str:
    return str(obj.metadata["family"])


def _look(obj: ArticulatedObject) -> Hashable:
    """Return what a test split should show all of: kinds of handle of cabinets, families of others."""
    return obj.handles[0].kind if obj.category == "cabinet" else _family(obj)


def _drawers(obj: ArticulatedObject) -> int:
    return 0 if len(obj.target_links("revolute")) > _MOST_DOORS else len(obj.target_links("prismatic"))


def _doors(obj: ArticulatedObject) -> int:
    return 0 if obj.target_links("prismatic") else len(obj.target_links("revolute"))


def _wanted_doors(selection: Selection) -> dict[str, dict[Hashable, int]]:
    """Return how many cabinets with doors only, of one or two each, make up the totals of the door task."""
    wanted: dict[str, dict[Hashable, int]] = {}
    for split in BENCHMARK_SPLITS:
        chosen = [selection.object(key) for key, name in selection.splits.items() if name == split]
        have = [links for obj in chosen if (links := obj.target_links("revolute"))]
        objects, doors = DOOR_TOTALS[split][0] - len(have), DOOR_TOTALS[split][1] - sum(map(len, have))
        assert 0 <= objects <= doors <= 2 * objects, f"{split}: {objects} cabinets cannot share {doors} doors"
        wanted[split] = {1: 2 * objects - doors, 2: doors - objects}
    return wanted


def catalog_yaml(category: Category, entries: list[CatalogEntry]) -> str:
    """Return the text of a catalogue file."""
    head = "# Made by `python tools/select_objects.py`; the keys are described in assets/catalog.py.\n"
    rows = [
        {k: v for k, v in to_mapping(entry).items() if v or k not in ("drawers", "doors")} for entry in entries
    ]
    lines = [yaml.safe_dump(row, default_flow_style=True, sort_keys=False, width=1000) for row in rows]
    return f"{head}category: {category}\nobjects:\n" + "".join(f"  - {line}" for line in lines)


def main(categories: list[str]) -> None:
    """Write the files of these categories, or of all."""
    for category in CATEGORIES:
        if not categories or category in categories:
            text = catalog_yaml(category, select(category))
            (CATALOG_DIR / f"{category}.yaml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
