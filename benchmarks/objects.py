"""What the catalogue's objects cost: building them from their seeds, loading them again, and how they differ.

Times are the process's CPU time, on one core. Every object is built anew, training, test and held-out ones, the
first one with all imports; a cached load is `load_object` of one that this process has built. Distances are to
the most similar other object of the category, see docs/checks.md. `--help` lists the options.
"""

import argparse
import json
import os
import statistics
import time
from pathlib import Path

import artiskill
from artiskill.assets.articulated_object import CATEGORIES
from artiskill.assets.catalog import SPLITS, read_catalog
from artiskill.assets.similarity import describe, nearest_neighbours

GOALS = {"whole catalogue": 90.0, "one object": 1.0, "cached load": 0.030}  # seconds, at most
Figures = dict[str, float | str]


def build_seconds(names: list[str]) -> dict[str, float]:
    """Of each object, built from its seed."""
    spent = {}
    for name in names:
        start = time.process_time()
        artiskill.load_object(name)
        spent[name] = time.process_time() - start
    return spent


def measure_times(names: list[str]) -> Figures:
    """Building all objects, the longest of them, and the longest load of one that is known."""
    read_catalog()
    built = build_seconds(names)
    slowest = max(built, key=built.__getitem__)
    again = build_seconds(names[-32:])  # the cache holds a bounded number
    return {
        "objects": len(names),
        "whole catalogue": sum(built.values()),
        "median object": statistics.median(built.values()),
        "one object": built[slowest],
        "slowest object": slowest,
        "cached load": max(again.values()),
    }


def measure_distances(category: str) -> Figures:
    """Millimetres from each object to the most similar other one."""
    names = [name for split in SPLITS for name in artiskill.list_objects(category=category, split=split)]
    start = time.process_time()
    found = nearest_neighbours([describe(artiskill.load_object(name)) for name in names])
    distances = [1e3 * neighbour.distance_m for neighbour in found]
    return {
        "objects": len(names),
        "nearest_mm": min(distances),
        "median_mm": statistics.median(distances),
        "seconds": time.process_time() - start,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times-only", action="store_true", help="leave out the distances")
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    options = parser.parse_args()
    names = list(read_catalog())
    times = measure_times(names)
    print(f"{times['objects']} objects from their seeds; the slowest is {times['slowest object']}")
    for what in ("whole catalogue", "median object", "one object", "cached load"):
        goal = f", to reach {1e3 * GOALS[what]:.0f} ms" if what in GOALS else ""
        print(f"{1e3 * times[what]:9.2f} ms  {what}{goal}")
    distances = {} if options.times_only else {category: measure_distances(category) for category in CATEGORIES}
    for category, row in distances.items():
        print(
            f"{category}: nearest neighbours {row['nearest_mm']:.1f} mm at least, "
            f"{row['median_mm']:.1f} mm in the median ({row['objects']} objects, {row['seconds']:.1f} s)"
        )
    print(f"artiskill {artiskill.__version__}, {os.cpu_count()} cores, one used")
    if options.json:
        options.json.write_text(json.dumps({"times": times, "distances": distances}, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()
