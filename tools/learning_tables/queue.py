"""A queue of cells that may be ended at any time: what is done is seen by its files, the commands do the rest."""

import csv
import ctypes
import fcntl
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from artiskill.files import atomic_write
from artiskill.learning.training_set import is_training_set
from learning_tables.cells import (
    COLLECT,
    EVALUATE,
    TRAIN,
    Cell,
    Place,
    Resources,
    Settings,
    collect_command,
    evaluate_command,
    place_of,
    set_command,
    train_command,
)
from learning_tables.estimates import describe_machine

SHORT = 1  # exit status of `demos collect` if an expert could not solve an object often enough
_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None)  # opened before a process forks


class CommandError(Exception):
    """A command of a cell failed."""


@contextmanager
def locked(work: Path) -> Iterator[int]:
    """Wait for others that work in the folder, commands that a killed queue left running included.

    The lock is inherited by the commands, so it lasts as long as any of them.

    Yields:
        What commands have to inherit.
    """
    work.mkdir(parents=True, exist_ok=True)
    handle = os.open(work / "queue.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print(f"waiting for another queue, or its last command, in {work}", flush=True)
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield handle
    finally:
        os.close(handle)


class Queue:
    """Runs what is missing of cells.

    Args:
        settings: of all cells.
        work: folder.
        resources: of this machine.
        stages: what is done of each cell: `collect` (and the training set), `train`, `evaluate`.
        lock: that commands inherit.
    """

    def __init__(
        self, settings: Settings, work: Path, resources: Resources, stages: Sequence[str], lock: int
    ) -> None:
        self._settings, self._work, self._resources = settings, work, resources
        self._stages, self._lock = stages, lock

    def run(self, cell: Cell) -> None:
        """Run what is missing of a cell.

        Raises:
            CommandError: a command failed.
        """
        place = place_of(cell, self._work)
        common = cell, self._settings, place, self._resources
        if COLLECT in self._stages and not is_training_set(place.data) and not place.trained.is_file():
            self._call(collect_command(*common), (0, SHORT))
            self._call(set_command(*common))
        if TRAIN in self._stages and not place.trained.is_file():
            start = time.perf_counter()
            self._call(train_command(*common))
            self._note_trained(cell, place, time.perf_counter() - start)
        if EVALUATE in self._stages and place.trained.is_file():
            for split, folder in place.reports.items():
                if not (folder / "report.json").is_file():
                    self._call(evaluate_command(cell, split, *common[1:]))

    def _call(self, command: list[str], legal: tuple[int, ...] = (0,)) -> None:
        """Run one of the package's commands; a signal reaches it, too, and it is waited for."""
        text = shlex.join(["artiskill", *command])
        print(f"$ {text}", flush=True)
        process = subprocess.Popen(
            [sys.executable, "-m", "artiskill", *command], pass_fds=(self._lock,), preexec_fn=_end_with_parent
        )
        try:
            status = process.wait()
        except BaseException:
            process.terminate()
            process.wait()
            raise
        if status not in legal:
            raise CommandError(f"exit status {status} of: {text}")

    def _note_trained(self, cell: Cell, place: Place, wall_s: float) -> None:
        """Write what the tables say about training."""
        steps = cell.steps(self._settings)
        noted = {
            "steps": steps,
            "samples": steps * self._settings.batch_size,
            "seconds": round(training_seconds(place.run / "metrics.csv", steps) or wall_s, 1),
            "machine": describe_machine(self._resources),
            "precision": self._resources.precision,
        }
        with atomic_write(place.trained) as path:
            path.write_text(json.dumps(noted, indent=1) + "\n", encoding="utf-8")


def training_seconds(metrics: Path, steps: int) -> float | None:
    """Return what a run's steps took in all, interruptions apart; None if its table does not say.

    Args:
        metrics: the run's `metrics.csv`, whose last row is about an earlier step perhaps.
        steps: of the run.
    """
    try:
        with metrics.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    except FileNotFoundError:
        return None
    return float(rows[-1]["seconds"]) * steps / int(rows[-1]["step"]) if rows else None


def _end_with_parent() -> None:
    """Have the kernel end a command whose queue was killed, so that nobody has to look for it (Linux)."""
    prctl = getattr(_LIBC, "prctl", None)
    if prctl is not None:
        prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
