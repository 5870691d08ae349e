"""Cells of the tables: what each one trains and measures, and the commands that make it."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from artiskill.assets.catalog import SPLITS, list_objects, read_catalog, resolve_objects
from artiskill.errors import check_name
from artiskill.learning.train_config import check_not_measured

ALGORITHMS = ("bc", "bcq", "td3bc")  # the paper's
TASKS = ("OpenCabinetDoor", "OpenCabinetDrawer", "PushChair", "MoveBucket")
DRAWER_TASK = "OpenCabinetDrawer"
A, B = "a", "b"  # one drawer; four tasks
SPLITS_OF = {A: ("new",), B: ("train", "test")}  # what is measured in a cell
POINTS = {"small": 128, "small_transformer": 128, "pointnet": 1200, "pointnet_transformer": 1200}
# The first levels of demonstrations and of episodes that count. A level starts all objects alike, so those of test
# objects are new, too: else a policy would begin where it was shown the way, with another object.
SHOWN_LEVEL, NEW_LEVEL = 0, 1_000_000
COLLECT, TRAIN, EVALUATE = STAGES = ("collect", "train", "evaluate")


class Method(NamedTuple):
    """A row of a table."""

    network: str
    algorithm: str

    @property
    def name(self) -> str:
        """As the name of a cell has it."""
        return f"{self.network}-{self.algorithm}"


METHODS = (
    *(Method("small", algorithm) for algorithm in ALGORITHMS),
    *(Method("small_transformer", algorithm) for algorithm in ALGORITHMS),
    Method("pointnet", "bc"),
    *(Method("pointnet_transformer", algorithm) for algorithm in ALGORITHMS),
)


_RATE = "algorithm.learning_rate=3.0e-4"
PAPER_VALUES = {  # of the paper's networks, where ours are others
    Method("pointnet", "bc"): (_RATE,),
    Method("pointnet_transformer", "bc"): (_RATE, "algorithm.weight_decay=5.0e-6"),
}


@dataclass(frozen=True)
class Settings:
    """What all cells of one work folder have in common.

    Attributes:
        drawer: object of table a, and its target.
        schedule: of table a: demonstrations -> gradient steps, before `scale`.
        scale: of the schedule.
        samples: of each policy of table b.
        batch_size: of all algorithms, so that equal samples are equal steps.
        episodes: of each policy of table a.
        per_object: demonstrations of each training object of table b.
        train_objects, test_objects: of table b: splits or ids; those of other tasks are left out.
        train_levels, test_levels: episodes on each of them.
        frame: of the points.
    """

    drawer: Sequence[str]
    schedule: dict[str, int]
    scale: float
    samples: int
    batch_size: int
    episodes: int
    per_object: int
    train_objects: list[str]
    test_objects: list[str]
    train_levels: int
    test_levels: int
    frame: str

    def objects(self, split: str, task: str) -> list[str]:
        """Return the objects of a split of table b, as commands take them."""
        given = self.train_objects if split == "train" else self.test_objects
        usable = {name for one in SPLITS for name in list_objects(task=task, split=one)}
        return [name for name in given if name in SPLITS or name in usable]


class Cell(NamedTuple):
    """One policy: table, row, column (demonstrations, or a task) and seed."""

    table: str
    method: Method
    column: str
    seed: int

    @property
    def name(self) -> str:
        """As `--cells` takes it; the path of its folder, too."""
        return f"{self.table}/{self.method.name}/{self.column}/seed-{self.seed}"

    @property
    def task(self) -> str:
        """Name of its task."""
        return DRAWER_TASK if self.table == A else self.column

    def steps(self, settings: Settings) -> int:
        """Return the number of gradient steps."""
        if self.table == A:
            return max(1, round(settings.schedule[self.column] * settings.scale))
        return max(1, round(settings.samples / settings.batch_size))

    def episodes(self, settings: Settings, split: str) -> int:
        """Return the number of episodes that measure it."""
        if split == "new":
            return settings.episodes
        names = settings.objects(split, self.task)
        levels = settings.train_levels if split == "train" else settings.test_levels
        return len(resolve_objects(names, task=self.task)) * levels


def check_cells(cells: Iterable[Cell], settings: Settings) -> None:
    """See that objects exist, and that none trains by which results are measured.

    Raises:
        UnknownNameError, AssetError, ConfigError: an object for which that does not hold.
    """
    for name in (*settings.train_objects, *settings.test_objects):
        check_name("object", name, (*SPLITS, *read_catalog()))
    for table, task in sorted({(cell.table, cell.task) for cell in cells}):
        names = [settings.drawer[0]] if table == A else settings.objects("train", task)
        check_not_measured(resolve_objects(names, task=task))
        if table == B:
            resolve_objects(settings.objects("test", task), task=task)


def all_cells(settings: Settings, seeds: Iterable[int]) -> Iterator[Cell]:
    """Yield every cell, those of the first seed first, those of small networks before those of large ones."""
    for seed in seeds:
        for method in METHODS:
            yield from (Cell(A, method, count, seed) for count in settings.schedule)
            yield from (Cell(B, method, task, seed) for task in TASKS)


class Place(NamedTuple):
    """Where the parts of a cell are.

    Attributes:
        demos: of its drawer or task, shared.
        data: its training set, shared by seeds and algorithms.
        run: of training.
        trained: what is noted of training, once it has ended.
        reports: split -> folder.
    """

    demos: Path
    data: Path
    run: Path
    trained: Path
    reports: dict[str, Path]

    @property
    def is_finished(self) -> bool:
        """Whether every report is there."""
        return self.trained.is_file() and all((path / "report.json").is_file() for path in self.reports.values())


def place_of(cell: Cell, work: Path) -> Place:
    """Return where the parts of a cell are."""
    folder = work / "cells" / cell.name
    kind = "one-drawer" if cell.table == A else cell.task
    part = f"-{cell.column}" if cell.table == A else ""
    data = work / "sets" / f"{kind}{part}-{POINTS[cell.method.network]}-points"
    reports = {split: folder / split for split in SPLITS_OF[cell.table]}
    return Place(work / "demos" / kind, data, folder / "run", folder / "trained.json", reports)


class Resources(NamedTuple):
    """What a machine gives: options of commands that change minutes, not results (but for bits on a GPU)."""

    device: str
    precision: str
    workers: int
    threads: int | None = None


def collect_command(cell: Cell, settings: Settings, place: Place, resources: Resources) -> list[str]:
    """Return the command that collects the demonstrations."""
    if cell.table == A:
        obj, target = settings.drawer
        most = max(map(int, settings.schedule))
        wanted = ["--objects", obj, "--targets", target, "--per-target", str(most)]
    else:
        wanted = ["--objects", *settings.objects("train", cell.task), "--per-object", str(settings.per_object)]
    command = ["demos", "collect", "--task", cell.task, *wanted, "--first-level", str(SHOWN_LEVEL)]
    return [*command, "--out", str(place.demos), "--workers", str(resources.workers)]


def set_command(cell: Cell, settings: Settings, place: Place, resources: Resources) -> list[str]:
    """Return the command that replays demonstrations into a training set."""
    count = ["--count", cell.column] if cell.table == A else []
    points = ["--points", str(POINTS[cell.method.network]), "--frame", settings.frame]
    command = ["training-set", str(place.demos), "--out", str(place.data), *points, *count]
    return [*command, "--workers", str(resources.workers)]


def train_command(cell: Cell, settings: Settings, place: Place, resources: Resources) -> list[str]:
    """Return the command that trains; its last checkpoint counts, as nothing else is asked."""
    network, algorithm = cell.method
    command = ["train", algorithm, "--task", cell.task, "--data", str(place.data), "--out", str(place.run)]
    command += ["--network", network, "--steps", str(cell.steps(settings)), "--seed", str(cell.seed)]
    command += ["--batch-size", str(settings.batch_size), "--dev-objects", "none"]
    command += ["--device", resources.device, "--precision", resources.precision]
    if resources.threads is not None:
        command += ["--threads", str(resources.threads)]
    if network.startswith("pointnet"):
        command += ["--set", "schedule=constant", *PAPER_VALUES.get(cell.method, ())]
    return command


def evaluate_command(cell: Cell, split: str, settings: Settings, place: Place, resources: Resources) -> list[str]:
    """Return the command that measures on a split."""
    command = ["evaluate", "--task", cell.task, "--policy", str(place.run)]
    if split == "new":
        obj, target = settings.drawer
        command += ["--objects", obj, "--target", target, "--episodes", str(settings.episodes)]
    else:
        levels = settings.train_levels if split == "train" else settings.test_levels
        command += ["--objects", *settings.objects(split, cell.task), "--episodes", str(levels)]
    command += ["--first-level", str(NEW_LEVEL)]
    return [*command, "--out", str(place.reports[split]), "--workers", str(resources.workers)]
