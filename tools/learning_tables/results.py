"""What finished cells say, and what the paper says."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.files import parse_json, read_bytes
from learning_tables.cells import METHODS, SPLITS_OF, TASKS, A, Cell, Method, Settings, place_of

RESAMPLES = 10_000
PAPER_STEPS = {"10": 2000, "30": 4000, "100": 10_000, "300": 20_000, "1000": 40_000}  # by demonstrations
# success by demonstrations, table a; (training, test objects) by task, table b: Mu et al., NeurIPS 2021
PAPER_A = {
    Method("pointnet", "bc"): (0.13, 0.23, 0.37, 0.68, 0.76),
    Method("pointnet_transformer", "bc"): (0.16, 0.35, 0.51, 0.85, 0.90),
    Method("pointnet_transformer", "bcq"): (0.02, 0.05, 0.23, 0.45, 0.55),
    Method("pointnet_transformer", "td3bc"): (0.03, 0.13, 0.22, 0.31, 0.57),
}
PAPER_B = {
    Method("pointnet", "bc"): ((0.18, 0.04), (0.24, 0.11), (0.11, 0.09), (0.03, 0.02)),
    Method("pointnet_transformer", "bc"): ((0.30, 0.11), (0.37, 0.12), (0.18, 0.08), (0.15, 0.08)),
    Method("pointnet_transformer", "bcq"): ((0.16, 0.04), (0.22, 0.11), (0.11, 0.08), (0.08, 0.06)),
    Method("pointnet_transformer", "td3bc"): ((0.13, 0.04), (0.18, 0.10), (0.12, 0.08), (0.05, 0.03)),
}
CSV_HEAD = ["table", "task", "network", "algorithm", "demonstrations", "seed", "steps", "samples", "machine"]
CSV_HEAD += ["training minutes", "measured on", "episodes", "successes", "rate", "wilson low", "wilson high"]
CSV_HEAD += ["objects", "objects low", "objects high", "measuring minutes"]


@dataclass(frozen=True)
class Measured:
    """Episodes on the objects of a split, of one policy or of several.

    Attributes:
        successes, episodes: by object.
        seconds: that they took.
    """

    successes: Counter[str]
    episodes: Counter[str]
    seconds: float

    @property
    def rate(self) -> float:
        """Over all episodes."""
        return self.successes.total() / self.episodes.total()

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's, 95 %: over episodes on these objects."""
        from artiskill.evaluation.statistics import wilson_interval  # it needs the engine, training does not

        return wilson_interval(self.successes.total(), self.episodes.total())

    @property
    def objects_interval(self) -> tuple[float, float]:
        """The bootstrap's over objects, 95 %: of unseen objects in general."""
        return bootstrap_interval([self.successes[name] / self.episodes[name] for name in sorted(self.episodes)])

    def __add__(self, other: "Measured") -> "Measured":
        counts = self.successes + other.successes, self.episodes + other.episodes
        return Measured(*counts, self.seconds + other.seconds)


@dataclass(frozen=True)
class Result:
    """A finished cell; `trained` is what the queue noted of its training."""

    cell: Cell
    trained: dict[str, Any]
    measured: dict[str, Measured]  # by split

    @property
    def minutes(self) -> float:
        """Of training."""
        return float(self.trained["seconds"]) / 60


def bootstrap_interval(rates: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % percentile interval of the mean of objects' rates, objects drawn with replacement."""
    values = np.asarray(rates)
    drawn = np.random.Generator(np.random.PCG64(0)).integers(len(values), size=(RESAMPLES, len(values)))
    low, high = np.percentile(values[drawn].mean(1), [2.5, 97.5])
    return float(low), float(high)


def read_results(work: Path, settings: Settings) -> list[Result]:
    """Return every finished cell of a work folder, of whatever seed."""
    rows = [(A, method, count) for method in METHODS for count in settings.schedule]
    rows += [("b", method, task) for method in METHODS for task in TASKS]
    found = []
    for table, method, column in rows:
        folders = (work / "cells" / table / method.name / column).glob("seed-*")
        for seed in sorted(int(path.name.removeprefix("seed-")) for path in folders):
            cell = Cell(table, method, column, seed)
            if place_of(cell, work).is_finished:
                found.append(read_result(cell, work))
    return found


def read_result(cell: Cell, work: Path) -> Result:
    """Read a finished cell."""
    place = place_of(cell, work)
    measured = {split: read_measured(place.reports[split]) for split in SPLITS_OF[cell.table]}
    return Result(cell, parse_json(read_bytes(place.trained)), measured)


def read_measured(folder: Path) -> Measured:
    """Read a report."""
    report = parse_json(read_bytes(folder / "report.json"))
    successes, episodes = Counter[str](), Counter[str]()
    for row in report["objects"]:
        successes[row["object"]] += row["successes"]
        episodes[row["object"]] += row["episodes"]
    return Measured(successes, episodes, report["timing"]["seconds"])


def csv_rows(results: Iterable[Result], settings: Settings) -> Iterator[list[str]]:
    """Yield a row per finished cell and split."""
    for result in results:
        cell, trained = result.cell, result.trained
        count = cell.column if cell.table == A else f"{settings.per_object} per object"
        head = [cell.table, cell.task, *cell.method, count, cell.seed, trained["steps"], trained["samples"]]
        head += [trained["machine"], f"{result.minutes:.2f}"]
        for split, one in result.measured.items():
            tail = [split, one.episodes.total(), one.successes.total()]
            tail += [f"{value:.4f}" for value in (one.rate, *one.interval)]
            tail += [len(one.episodes), *(f"{value:.4f}" for value in one.objects_interval)]
            yield [str(value) for value in (*head, *tail, f"{one.seconds / 60:.2f}")]
