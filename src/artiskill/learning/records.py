"""What a run writes down while it trains: two tables, and the same numbers for TensorBoard."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from artiskill.learning.checkpoints import TrainState
from artiskill.learning.run import DEVELOPMENT, METRICS, TENSORBOARD, Table


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
