"""Say how new the test objects are: `python tools/make_novelty_table.py`; two minutes.

For each object of `test` and `ood`, the nearest one that policies train on: of the catalogue's `train`, and of
those that *No Restrictions* adds, which are generated ones, cabinets on their side (doors) and larger chairs. Then
how success falls with that distance: docs/data/tracks.csv.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import spearmanr

from artiskill.assets.catalog import object_of, resolve_objects
from artiskill.assets.similarity import NEAR_DUPLICATE_M, Descriptor, describe, nearest_neighbour
from artiskill.config import check
from artiskill.errors import ArtiSkillError
from artiskill.gallery.facts import markdown
from artiskill.learning.train_config import ROLLOUT_SEEDS
from artiskill.tasks.registry import task_spec
from learning_tables.cells import TASKS
from learning_tables.markdown import sum_of, write_between
from learning_tables.results import Measured, read_rows, write_rows
from make_track_tables import MADE, NO_RESTRICTIONS, PAGE, SPLITS, TRACKS, read_csv
from make_track_tables import TABLE as RATES

TABLE = Path("data", "novelty.csv")  # beside the page
BEGIN, END = "<!-- made by tools/make_novelty_table.py -->", "<!-- end of the novelty -->"
CSV_HEAD = ["task", "split", "object", "nearest train", "mm", "nearest generated", "mm to generated"]


class Novelty(NamedTuple):
    """How far an object is from those that policies train on."""

    task: str
    split: str
    object: str
    train: str
    train_mm: float
    generated: str
    generated_mm: float

    def distance_mm(self, track: str) -> float:
        """Of the nearest object that policies of a track train on."""
        return min(self.train_mm, self.generated_mm) if track == NO_RESTRICTIONS else self.train_mm


def main(arguments: list[str]) -> int:
    """Measure and write; the exit status is 2 if a file does not fit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--page", type=Path, default=PAGE, help="with the marks (default: docs/generalization.md)")
    parser.add_argument("--again", action="store_true", help="measure anew, though the CSV file is there")
    options = parser.parse_args(arguments)
    table = options.page.parent / TABLE
    try:
        found = [] if options.again else read_novelty(table)
        if not found:
            found = [one for task in TASKS for one in measure(task)]
            write_rows(table, [CSV_HEAD, *(list(map(str, one)) for one in found)])
        rates = read_csv(options.page.parent / RATES)
        by_track = {
            (track, task): [splits for policy, splits in rates.items() if policy[:2] == (track, task)]
            for track in TRACKS
            for task in TASKS
        }
        write_between(options.page, BEGIN, END, f"{distances_text(found)}\n\n{rates_text(found, by_track)}")
    except ArtiSkillError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def read_novelty(path: Path) -> list[Novelty]:
    """Return what was measured before; nothing if there is no file."""
    found = []
    for row in read_rows(path, CSV_HEAD):
        task, split, name, train, train_mm, generated, generated_mm = row.values()
        found.append(Novelty(task, split, name, train, float(train_mm), generated, float(generated_mm)))
    return found


def measure(task: str) -> Iterator[Novelty]:
    """Yield the objects of a task that no policy trains on."""
    print(f"describing the objects of {task}", flush=True)
    category = task_spec(task).category
    train = _described(["train"], task)
    generated = _described([f"generated:{category}:{ROLLOUT_SEEDS[category]}"], task)
    if task in MADE:
        generated += map(describe, MADE[task].objects("train"))
    for split in SPLITS:
        for one in _described([split], task):
            yield Novelty(task, split, one.id, *_nearest(one, train), *_nearest(one, generated))


def _nearest(one: Descriptor, others: Sequence[Descriptor]) -> tuple[str, float]:
    """Return the id of the nearest of several objects, and its distance in millimetres."""
    found = nearest_neighbour(one, others)
    assert found is not None, "there are others"
    return found.nearest, round(1e3 * found.distance_m, 1)


def _described(names: Sequence[str], task: str) -> list[Descriptor]:
    """Describe the objects that a task can use."""
    found = resolve_objects(names, task=task)
    return [describe(object_of(one)) for one in found]


def distances_text(found: Sequence[Novelty]) -> str:
    """Return the table of distances: median, least and greatest."""
    rows = []
    for task, split in dict.fromkeys((one.task, one.split) for one in found):
        chosen = [one for one in found if (one.task, one.split) == (task, split)]
        limit = 1e3 * NEAR_DUPLICATE_M[task_spec(task).category]
        cells = []
        for distances in ([one.train_mm for one in chosen], [one.generated_mm for one in chosen]):
            cells += [_range(distances), f"{sum(one < limit for one in distances)} of {len(chosen)}"]
        rows.append([task, split, *cells])
    head = ["mm to `train`", "near duplicates in `train`", "mm to generated ones", "among generated ones"]
    return markdown(["task", "objects", *head], rows)


def _range(values: Sequence[float]) -> str:
    return f"{np.median(values):.0f} ({min(values):.0f} to {max(values):.0f})"


def rates_text(found: Sequence[Novelty], by_track: dict[tuple[str, str], list[dict[str, Measured]]]) -> str:
    """Return the table of success by distance: of the nearer and of the farther half of all unseen objects."""
    rows = []
    for (track, task), policies in by_track.items():
        if not policies:
            continue
        by_name = {one.object: one for one in found if one.task == task}
        all_of = sum_of([one for splits in policies for one in splits.values()])
        unknown = sorted(set(all_of.episodes) - set(by_name))
        check(not unknown, f"{TABLE} lacks {', '.join(unknown)} of {task}: measure anew, with --again")
        ordered = sorted(all_of.episodes, key=lambda name: (by_name[name].distance_mm(track), name))
        rates = [all_of.successes[name] / all_of.episodes[name] for name in ordered]
        half = (len(ordered) + 1) // 2
        distances = [by_name[name].distance_mm(track) for name in ordered]
        found_by = spearmanr(distances, rates) if len(set(rates)) > 1 else None
        cells = [
            f"{np.mean(rates[part]):.0%}, {distances[part][0]:.0f} to {distances[part][-1]:.0f} mm"
            for part in (slice(half), slice(half, None))
        ]
        correlation = "none" if found_by is None else f"{found_by.statistic:+.2f} ({found_by.pvalue:.2f})"
        rows.append([track, task, *cells, correlation])
    return markdown(["track", "task", "nearer half", "farther half", "rank correlation (p)"], rows)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
