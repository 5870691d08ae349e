"""What finished cells say, and what the paper says."""

import csv
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from artiskill.errors import ConfigError
from artiskill.files import atomic_write, parse_json, read_bytes, read_text
from learning_tables.cells import METHODS, SPLITS_OF, TASKS, A, B, Cell, Method, Settings, place_of

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
_TRAINED = {"steps": "steps", "samples": "samples", "machine": "machine", "seconds": "training seconds"}
CSV_HEAD += ["training seconds", "measured on", "object", "episodes", "successes", "measuring seconds"]


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
    def objects_interval(self) -> tuple[float, float] | None:
        """The bootstrap's over objects, 95 %, as in reports: of unseen objects in general."""
        from artiskill.evaluation.statistics import counts_interval

        return counts_interval(self.successes, dict(sorted(self.episodes.items())))

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


def read_results(work: Path, settings: Settings) -> list[Result]:
    """Return every finished cell of a work folder, of whatever seed."""
    rows = [(A, method, count) for method in METHODS for count in settings.schedule]
    rows += [(B, method, task) for method in METHODS for task in TASKS]
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


def read_cost(run: Path) -> tuple[str, str]:
    """Return the steps and the seconds that a run of reinforcement learning took."""
    *_, last = csv.DictReader(read_text(run / "metrics.csv").splitlines())
    return last["step"], last["seconds"]


def csv_rows(results: Iterable[Result], settings: Settings) -> Iterator[list[str]]:
    """Yield a row per finished cell, split and object."""
    for result in results:
        cell, trained = result.cell, result.trained
        head = [cell.table, cell.task, *cell.method, _demonstrations(cell, settings), cell.seed]
        head += [trained[name] for name in _TRAINED]
        for split, one in result.measured.items():
            for name in sorted(one.episodes):
                row = [*head, split, name, one.episodes[name], one.successes[name], one.seconds]
                yield [str(value) for value in row]


def read_csv_rows(path: Path, settings: Settings) -> list[Result]:
    """Return the cells whose rows are in a CSV file that `csv_rows` wrote, but for those of other settings.

    Raises:
        ConfigError: it has other columns.
    """
    found: dict[Cell, Result] = {}
    for row in read_rows(path, CSV_HEAD):
        _add_row(found, row, settings)
    return list(found.values())


def _add_row(found: dict[Cell, Result], row: dict[str, str], settings: Settings) -> None:
    """Add the episodes of a row to its cell."""
    method = Method(row["network"], row["algorithm"])
    column = row["demonstrations"] if row["table"] == A else row["task"]
    cell = Cell(row["table"], method, column, int(row["seed"]))
    is_known = method in METHODS and column in (settings.schedule if cell.table == A else TASKS)
    if not is_known or (row["demonstrations"], int(row["steps"])) != (
        str(_demonstrations(cell, settings)),
        cell.steps(settings),
    ):
        return
    trained = {name: row[column] for name, column in _TRAINED.items()}
    result = found.setdefault(cell, Result(cell, trained, {}))
    add_counts(result.measured, row["measured on"], row, float(row["measuring seconds"]))


def add_counts(measured: dict[str, Measured], split: str, row: dict[str, str], seconds: float = 0.0) -> None:
    """Add the counts of a row, of one object, to those of a split."""
    one = measured.setdefault(split, Measured(Counter(), Counter(), seconds))
    one.episodes[row["object"]] = int(row["episodes"])
    one.successes[row["object"]] = int(row["successes"])


def rows_of_counts(found: Mapping[tuple[Any, ...], Mapping[str, Measured]]) -> Iterator[list[str]]:
    """Yield a row per policy, split and object: what the policy is, the split, the object, its counts."""
    for policy, splits in found.items():
        for split, one in splits.items():
            for name in sorted(one.episodes):
                row = (*policy, split, name, one.episodes[name], one.successes[name])
                yield [str(value) for value in row]


def _demonstrations(cell: Cell, settings: Settings) -> str:
    return cell.column if cell.table == A else f"{settings.per_object} per object"


def write_rows(path: Path, rows: Iterable[Sequence[str]]) -> None:
    """Write a CSV file, and its folder if there is none."""
    path.parent.mkdir(exist_ok=True)
    with atomic_write(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def read_rows(path: Path, head: list[str]) -> list[dict[str, str]]:
    """Return the rows that `write_rows` wrote; none if there is no file.

    Raises:
        ConfigError: it has other columns.
    """
    if not path.is_file():
        return []
    reader = csv.DictReader(read_text(path).splitlines())
    if reader.fieldnames != head:
        raise ConfigError(f"{str(path)!r} is no table of this script: its columns are not {', '.join(head)}")
    return list(reader)
