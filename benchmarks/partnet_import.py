"""How long the first import of PartNet-Mobility folders takes, and how well collision shapes follow what is drawn.

Objects are those of `partnet_folders.py`, written to a temporary folder, and any folders that are named; the cache
is empty at first. `wall` is the clock's time, `cpu` that of all processes together, which another load stretches
little; `again` is the clock's time of a second import. Deviations are those of `artiskill assets check`: the 95th
percentile of the worst link, from visual surface to collision shapes and back; `cavity` is the largest share of a
drawer's cavity that is solid. `python benchmarks/partnet_import.py --help` lists the options.
"""

import argparse
import json
import resource
import tempfile
import time
from pathlib import Path

from partnet_folders import OBJECTS, write_object

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.partnet import import_partnet
from artiskill.checks.config import default_checks_config
from artiskill.checks.context import CheckContext
from artiskill.checks.surfaces import check_cavity, check_surfaces

GOAL_S = 60.0
Figures = dict[str, float | int | str]


def cpu_s() -> float:
    """Processor time of this process and of those that it has waited for."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def measure(folder: Path, workers: int | None) -> Figures:
    """Import a folder twice, with a cache of its own."""
    with tempfile.TemporaryDirectory() as cache:
        start, spent = time.perf_counter(), cpu_s()
        found = import_partnet(folder, cache_dir=Path(cache), workers=workers)
        figures: Figures = {"object": folder.name, "wall": time.perf_counter() - start, "cpu": cpu_s() - spent}
        start = time.perf_counter()
        again = import_partnet(folder, cache_dir=Path(cache), workers=workers)
        figures["again"] = time.perf_counter() - start
        assert again.content_hash == found.content_hash
    return {**figures, **quality(found)}


def quality(found: ArticulatedObject) -> Figures:
    """How many shapes there are, and how far they are from what is drawn."""
    context = CheckContext(found, default_checks_config())
    surfaces = check_surfaces(context)
    there = [r.value or 0.0 for r in surfaces if r.note.startswith("visual to")]
    back = [r.value or 0.0 for r in surfaces if r.note.startswith("collision to")]
    cavity = [r.value or 0.0 for r in check_cavity(context)]
    return {
        "shapes": sum(len(link.collisions) for link in found.links),
        "triangles": sum(len(visual.mesh.faces) for link in found.links for visual in link.visuals),
        "there_mm": max(there, default=0.0),
        "back_mm": max(back, default=0.0),
        "cavity_percent": max(cavity, default=0.0),
        "hash": found.content_hash,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", type=Path, help="PartNet-Mobility folders, besides our own")
    parser.add_argument("--own", nargs="*", default=list(OBJECTS), choices=OBJECTS, help="which of our own (all)")
    parser.add_argument("--workers", type=int, help="processes (default: one per core)")
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as made:
        own = [write_object(Path(made) / name, "StorageFurniture", OBJECTS[name]()) for name in options.own]
        for folder in [*own, *options.folders]:
            row = measure(folder, options.workers)
            print(
                "  ".join(f"{k} {v:.1f}" if isinstance(v, float) else f"{k} {v}" for k, v in row.items()),
                flush=True,
            )
            rows.append(row)
    slowest = max(rows, key=lambda row: row["wall"])
    print(f"slowest: {slowest['object']}, {slowest['wall']:.0f} s, to reach {GOAL_S:.0f} s on two quiet cores")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()
