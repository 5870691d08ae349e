"""What a run writes while it trains: checkpoints, two tables, and the same numbers for TensorBoard.

A checkpoint is one file that appears whole. How an algorithm is made from a run stands here, too.
"""

import copy
import io
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
import torch
from torch import nn

from artiskill.config import from_mapping
from artiskill.errors import RunError, shown
from artiskill.files import read_bytes
from artiskill.learning.algorithm import Algorithm
from artiskill.learning.batch import Sizes, Statistics
from artiskill.learning.networks import make_network
from artiskill.learning.run import DEVELOPMENT, METRICS, TENSORBOARD, RunInfo, Table, write_whole
from artiskill.learning.train_config import TrainConfig, algorithm_class, algorithm_config
from artiskill.robots.config import RobotConfig

_FORMAT, _VERSION = "artiskill-checkpoint", 1


@dataclass
class TrainState:
    """Where a run stands, besides its weights."""

    step: int = 0  # that were taken
    seconds: float = 0.0  # that they took
    developed: int = 0  # step of the last measurement on development objects
    best_step: int = 0  # of the best checkpoint
    best_successes: int = -1
    measured: list[int] = field(default_factory=list)  # successes of each measurement, of reinforcement learning
    sums: dict[str, tuple[float, int]] = field(default_factory=dict)  # since the last row of metrics.csv


def make_algorithm(config: TrainConfig, info: RunInfo) -> Algorithm:
    """Make an algorithm with the fresh weights of the configuration's seed, on the CPU.

    Raises:
        ConfigError: an illegal value of the algorithm.
    """
    sizes = Sizes(**info.sizes)
    statistics = Statistics(**{name: np.array(one, np.float32) for name, one in info.statistics.items()})
    generator = torch.Generator().manual_seed(config.seed)
    frame, commands = info.sampling["frame"], info.commands
    robot = from_mapping(RobotConfig, commands["robot"], "commands.robot") if commands else None

    def make(outputs: int, extra: int) -> nn.Module:
        return make_network(config.network, sizes, statistics, outputs, extra, generator, frame, robot)

    action_std = torch.from_numpy(statistics.action_std)
    arguments = algorithm_config(config), make, sizes, action_std
    kind = algorithm_class(config.name)
    algorithm: Algorithm = kind(*arguments, commands) if commands else kind(*arguments)
    return algorithm


def acting_copy(algorithm: Algorithm) -> Algorithm:
    """Return a copy that only acts: no gradients."""
    copied = copy.deepcopy(algorithm)
    return copied.requires_grad_(False).eval()


def save_checkpoint(path: Path, state: TrainState, algorithm: Algorithm, average: Algorithm | None) -> None:
    """Write all that going on needs, whole or not at all.

    Raises:
        OSError: it cannot be written; an earlier one is as it was.
        RunError: a weight is not finite; likewise.
    """
    for name, value in algorithm.state_dict().items():
        if value.is_floating_point() and not value.isfinite().all():
            raise RunError(f"the weights {name} are not finite after step {state.step}")
    content = {
        "state": dict(vars(state)),
        "weights": algorithm.state_dict(),
        "average": None if average is None else average.state_dict(),
        "optimizers": {name: optimizer.state_dict() for name, optimizer in algorithm.optimizers.items()},
    }
    write_content(path, content)


def save_weights(path: Path, state: TrainState, algorithm: Algorithm) -> None:
    """Write what acting needs, whole or not at all.

    Raises:
        OSError: it cannot be written; an earlier one is as it was.
    """
    write_content(path, {"state": dict(vars(state)), "weights": algorithm.state_dict(), "average": None})


def load_checkpoint(path: Path, algorithm: Algorithm, average: Algorithm | None) -> TrainState:
    """Take weights and optimizers from a checkpoint, and return where the run stands.

    Raises:
        RunError: it is damaged, of another version or of other networks.
    """
    content = read_content(path)
    try:
        algorithm.load_state_dict(content["weights"])
        if average is not None:
            average.load_state_dict(content["average"])
        for name, optimizer in algorithm.optimizers.items():
            optimizer.load_state_dict(content["optimizers"][name])
        return TrainState(**content["state"])
    except (RuntimeError, LookupError, TypeError, ValueError) as error:
        raise RunError(f"{str(path)!r} does not fit the run: {' '.join(str(error).split())}") from error


def load_weights(path: Path, algorithm: Algorithm) -> None:
    """Take the weights to act by from a checkpoint.

    Raises:
        RunError: it is damaged, of another version or of other networks.
    """
    content = read_content(path)
    try:
        algorithm.load_state_dict(content["average"] or content["weights"])
    except (RuntimeError, LookupError, TypeError) as error:
        raise RunError(f"{str(path)!r} does not fit the run: {' '.join(str(error).split())}") from error


def write_content(path: Path, content: dict[str, Any]) -> None:
    """Write tensors and plain values, whole or not at all.

    Raises:
        OSError: they cannot be written; an earlier file is as it was.
    """
    memory = io.BytesIO()  # torch hides the system's errors when it writes to a file
    torch.save({"format": _FORMAT, "version": _VERSION, **content}, memory)
    write_whole(path, memory.getvalue())


def read_content(path: Path) -> dict[str, Any]:
    """Return what `write_content` has written.

    Raises:
        RunError: it is damaged, foreign or of another version.
    """
    try:
        content = torch.load(io.BytesIO(read_bytes(path)), map_location="cpu", weights_only=True)
    except OSError as error:
        raise RunError(f"cannot read {str(path)!r}: {error.strerror}") from error
    except (RuntimeError, ValueError, EOFError, LookupError, pickle.UnpicklingError) as error:
        raise RunError(f"{str(path)!r} is damaged, or no checkpoint of artiskill") from error
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise RunError(f"{str(path)!r} is no checkpoint of artiskill")
    if content.get("version") != _VERSION:
        raise RunError(
            f"{str(path)!r} is of version {shown(content.get('version'))}; this version of artiskill reads "
            f"{_VERSION}: use the version of artiskill that wrote it, or train anew"
        )
    return content


class Records:
    """Tables and event files of a run, from where its latest checkpoint stands; a context manager.

    Args:
        folder: of the run.
        state: of its latest checkpoint: what was written down after it is dropped.
        is_written: whether this process is the one that writes.

    Raises:
        OSError: they cannot be written.
        RunError: a table is damaged.
    """

    def __init__(self, folder: Path, state: TrainState, is_written: bool) -> None:
        self._folder, self._is_written = folder, is_written
        self._start = state.step
        self._writer: Any = None
        if is_written:
            self._means = Table(folder / METRICS, state.step)
            self._development = Table(folder / DEVELOPMENT, state.developed)

    def __enter__(self) -> Self:
        """Open the event file, where TensorBoard is installed."""
        if self._is_written:
            try:
                from torch.utils.tensorboard import SummaryWriter
            except ImportError:
                return self
            self._writer = SummaryWriter(str(self._folder / TENSORBOARD), purge_step=self._start + 1)
        return self

    def __exit__(self, *error: object) -> None:
        """Close the event file."""
        if self._writer is not None:
            self._writer.close()

    def add_means(self, state: TrainState, means: Mapping[str, float], rate: float) -> None:
        """Add the means of some steps.

        Raises:
            OSError: they cannot be written.
        """
        if not self._is_written:
            return
        values = {**means, "learning_rate": rate}
        self._means.add({"step": state.step, "seconds": round(state.seconds, 1), **values})
        self._add_scalars("train", state.step, values)

    def add_development(self, state: TrainState, rows: Sequence[tuple[str, int, int]]) -> None:
        """Add the successes on development objects.

        Raises:
            OSError: they cannot be written.
        """
        for name, episodes, successes in rows:
            self._development.add(
                {"step": state.step, "object": name, "episodes": episodes, "successes": successes}
            )
        rate = sum(row[2] for row in rows) / max(sum(row[1] for row in rows), 1)
        self._add_scalars("development", state.step, {"success_rate": rate})

    def _add_scalars(self, group: str, step: int, values: Mapping[str, float]) -> None:
        if self._writer is not None:
            for name, value in values.items():
                self._writer.add_scalar(f"{group}/{name}", value, step)
            self._writer.flush()
