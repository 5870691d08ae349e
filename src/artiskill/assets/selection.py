"""Chooses the catalogue's cabinets: walks the seeds and keeps those that fill the counts of the benchmark.

Run `python -m artiskill.assets.selection` to print the catalogue's YAML file anew after the generator has changed.
"""

from collections import Counter
from dataclasses import dataclass
from itertools import count

import numpy as np
import yaml

from artiskill.assets.catalog import CatalogEntry, generate_cabinet
from artiskill.config import to_mapping

# Of the ManiSkill benchmark's tables: how many cabinets have so many target drawers. 25 with 49 and 10 with 21.
DRAWER_COUNTS = {"train": {1: 9, 2: 10, 3: 4, 4: 2}, "test": {1: 3, 2: 4, 3: 2, 4: 1}}
# Cabinets with target doors and the sum of these doors, for which cabinets without drawers fill up.
DOOR_TOTALS = {"train": (42, 66), "test": (10, 16)}
_MOST_DOORS = 2  # of a cabinet that also has drawers


@dataclass(frozen=True)
class _Candidate:
    seed: int
    drawers: int
    doors: int


def select_cabinets() -> list[CatalogEntry]:
    """The entries of the catalogue, in the order of their seeds."""
    seen: list[_Candidate] = []
    chosen: dict[int, str] = {}
    _fill_drawers(seen, chosen)
    _fill_doors(seen, chosen)
    entries = []
    for number, seed in enumerate(sorted(chosen), start=1):
        cabinet = generate_cabinet(seed, f"cabinet-{number:04d}")
        drawers, doors = cabinet.target_links("prismatic"), cabinet.target_links("revolute")
        entries.append(CatalogEntry(cabinet.id, seed, chosen[seed], drawers, doors, cabinet.content_hash))
    return entries


def _fill_drawers(seen: list[_Candidate], chosen: dict[int, str]) -> None:
    """Cabinets with drawers, until each number of drawers has been met as often as wanted."""
    wanted = {split: Counter(counts) for split, counts in DRAWER_COUNTS.items()}
    for seed in count():
        if not any(sum(counter.values()) for counter in wanted.values()):
            return
        candidate = _candidate(seed)
        seen.append(candidate)
        open_splits = [s for s in wanted if wanted[s][candidate.drawers] > 0]
        if candidate.drawers == 0 or candidate.doors > _MOST_DOORS or not open_splits:
            continue
        # the split is drawn by what is still missing, so that early and late seeds reach both
        missing = np.array([wanted[s][candidate.drawers] for s in open_splits], dtype=float)
        split = str(np.random.default_rng(seed).choice(open_splits, p=missing / missing.sum()))
        wanted[split][candidate.drawers] -= 1
        chosen[seed] = split


def _fill_doors(seen: list[_Candidate], chosen: dict[int, str]) -> None:
    """Cabinets with doors only, one or two each, until the totals of the door task hold."""
    wanted: dict[str, Counter[int]] = {}
    by_seed = {c.seed: c for c in seen}
    for split, (objects, doors) in DOOR_TOTALS.items():
        have = [by_seed[s].doors for s, name in chosen.items() if name == split and by_seed[s].doors > 0]
        objects, doors = objects - len(have), doors - sum(have)
        assert objects <= doors <= 2 * objects, f"{split}: {objects} cabinets cannot share {doors} doors"
        wanted[split] = Counter({1: 2 * objects - doors, 2: doors - objects})
    for seed in count():
        if not any(sum(counter.values()) for counter in wanted.values()):
            return
        candidate = by_seed.get(seed) or _candidate(seed)
        open_splits = [s for s in wanted if wanted[s][candidate.doors] > 0]
        if seed in chosen or candidate.drawers > 0 or not open_splits:
            continue
        missing = np.array([wanted[s][candidate.doors] for s in open_splits], dtype=float)
        split = str(np.random.default_rng(seed).choice(open_splits, p=missing / missing.sum()))
        wanted[split][candidate.doors] -= 1
        chosen[seed] = split


def _candidate(seed: int) -> _Candidate:
    cabinet = generate_cabinet(seed, f"seed-{seed}")
    return _Candidate(seed, len(cabinet.target_links("prismatic")), len(cabinet.target_links("revolute")))


def catalog_yaml(entries: list[CatalogEntry]) -> str:
    """The catalogue file's text."""
    head = "# Made by `python -m artiskill.assets.selection`; the keys are described in assets/catalog.py.\n"
    lines = [yaml.safe_dump(to_mapping(e), default_flow_style=True, sort_keys=False, width=1000) for e in entries]
    return head + "category: cabinet\nobjects:\n" + "".join(f"  - {line}" for line in lines)


if __name__ == "__main__":
    print(catalog_yaml(select_cabinets()), end="")
