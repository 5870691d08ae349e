"""Minutes that a cell takes: by finished cells of the same machine, else by rates measured elsewhere."""

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from artiskill.files import parse_json, read_bytes
from artiskill.jobs.parallel import available_cores
from artiskill.learning.training_set import is_training_set
from learning_tables.cells import Cell, Method, Resources, Settings, place_of

# samples per second of a core, as docs/training_runs.md has them
CORE_RATES = {
    "small": {"bc": 1301.0, "bcq": 257.0, "td3bc": 355.0},
    "small_transformer": {"bc": 1580.0, "bcq": 277.0, "td3bc": 384.0},
    "pointnet": {"bc": 204.0, "bcq": 33.0, "td3bc": 43.0},
    "pointnet_transformer": {"bc": 111.0, "bcq": 18.0, "td3bc": 25.0},
}
GPU_CORES = 37.0  # that an H100 was worth, with `bc` of pointnet_transformer in float32
READING_RATE = 20_000.0  # a guess: what reading allows at most
STEP_S = 0.003  # of an environment with point clouds
ACT_S = {"small": 0.0008, "small_transformer": 0.0014, "pointnet": 0.0035, "pointnet_transformer": 0.0095}
BCQ_ACT = 2.3  # times as long
LENGTH = 200  # steps of an episode that is not solved
DEMO_S = 0.6  # to collect a demonstration and replay it, on a core


class Estimate(NamedTuple):
    """Minutes of a cell that is not finished."""

    data: float
    training: float
    measuring: float
    is_measured: bool  # whether training's is of this machine

    @property
    def total(self) -> float:
        """All of them."""
        return self.data + self.training + self.measuring


def describe_machine(resources: Resources) -> str:
    """Return the machine on which `artiskill train` trains with these options: a GPU's name, or cores."""
    cores = resources.threads or available_cores()
    text = f"{cores} core{'s' * (cores > 1)}"
    if resources.device == "cpu":
        return text
    try:
        import torch
    except ImportError:
        return text
    return str(torch.cuda.get_device_name()) if torch.cuda.is_available() else text


class Estimator:
    """Estimates, with the rates of the finished cells of a work folder."""

    def __init__(self, cells: Iterable[Cell], settings: Settings, work: Path, resources: Resources) -> None:
        self._settings, self._work, self._resources = settings, work, resources
        self._machine = describe_machine(resources)
        self._seconds: dict[Method, list[tuple[float, float]]] = {}  # with the samples
        for cell in cells:
            self.learn(cell)

    def learn(self, cell: Cell) -> None:
        """Take the rate of a cell, if it is trained."""
        path = place_of(cell, self._work).trained
        if path.is_file():
            found = parse_json(read_bytes(path))
            if found["machine"] == self._machine and found["seconds"] > 0:
                self._seconds.setdefault(cell.method, []).append((found["seconds"], found["samples"]))

    def estimate(self, cell: Cell) -> Estimate:
        """Return the minutes of what is left of a cell, nothing of its training being done."""
        settings, place, workers = self._settings, place_of(cell, self._work), self._resources.workers
        samples = cell.steps(settings) * settings.batch_size
        known = self._seconds.get(cell.method)
        rate = sum(n for _, n in known) / sum(s for s, _ in known) if known else self._rate(cell.method)
        training = 0.0 if place.trained.is_file() else samples / rate
        left = [split for split, path in place.reports.items() if not (path / "report.json").is_file()]
        episodes = sum(cell.episodes(settings, split) for split in left)
        act_s = ACT_S[cell.method.network] * (BCQ_ACT if cell.method.algorithm == "bcq" else 1.0)
        measuring = episodes * LENGTH * (STEP_S + act_s) / workers
        data = (
            0.0 if is_training_set(place.data) or not training else self._demonstrations(cell) * DEMO_S / workers
        )
        return Estimate(data / 60, training / 60, measuring / 60, bool(known))

    def _rate(self, method: Method) -> float:
        """Return the samples per second, by the tables above."""
        rate = CORE_RATES[method.network][method.algorithm]
        if self._machine.endswith((" core", " cores")):
            return rate * (self._resources.threads or available_cores())
        return min(rate * GPU_CORES, READING_RATE)

    def _demonstrations(self, cell: Cell) -> int:
        if cell.column in self._settings.schedule:
            return int(cell.column)
        return self._settings.per_object * cell.episodes(self._settings, "train") // self._settings.train_levels
