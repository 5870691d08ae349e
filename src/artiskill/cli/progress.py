"""Progress of long work: a bar on a terminal, a few plain lines anywhere else."""

import sys
import time
from types import TracebackType
from typing import Self

_LINES = 10  # on the way, if not on a terminal
_SILENCE_S = 60.0  # there, another line after so long


class ProgressBar:
    """Show on standard error how much is done.

    Args:
        title: what is being done.
        total: how many units there are.
        unit: what they are called.
    """

    def __init__(self, title: str, total: int, unit: str) -> None:
        from rich import progress as rich_progress
        from rich.console import Console

        self._title, self._total, self._unit = title, total, unit
        self._text = ""
        self._done = self._skipped = self._successes = self._counted = 0
        self._start = self._line_at = time.perf_counter()
        self._bar: rich_progress.Progress | None = None
        if sys.stderr.isatty():
            self._bar = rich_progress.Progress(
                rich_progress.TextColumn("{task.description}"),
                rich_progress.BarColumn(),
                rich_progress.MofNCompleteColumn(),
                rich_progress.TextColumn("{task.fields[note]}"),
                rich_progress.TimeRemainingColumn(),
                console=Console(stderr=True),
                transient=True,
            )
            self._task = self._bar.add_task(title, total=total, note="")

    def __enter__(self) -> Self:
        """Show the bar."""
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()

    def advance(self, success: bool | None = None) -> None:
        """Count one more unit, as solved or not where that is known."""
        if success is not None:
            self._counted += 1
            self._successes += success
        self._show_done(self._done + 1)

    def attempt(self, success: bool) -> None:
        """Count one more attempt at a unit, and one more unit if it is solved."""
        if success:
            self.advance(success)
        else:
            self._counted += 1
            self._show_done(self._done)

    def show(self, done: int, text: str = "") -> None:
        """Show how many units are done, and the latest of what there is to say about them."""
        self._text = text
        self._show_done(done)

    def print(self, line: str) -> None:
        """Print a line, above the bar where there is one."""
        if self._bar is not None:
            self._bar.console.print(line, highlight=False, markup=False)
        else:
            print(line, file=sys.stderr, flush=True)

    def skip(self, count: int) -> None:
        """Count units that were there before; they say nothing about the rate."""
        self._skipped += count
        self._done += count
        if self._bar is not None:
            self._bar.reset(self._task, completed=self._done)

    def _show_done(self, done: int) -> None:
        before, self._done = self._done, done
        self._update()
        if self._bar is not None:
            return
        now = time.perf_counter()
        if done * _LINES // self._total > before * _LINES // self._total or now - self._line_at > _SILENCE_S:
            rate = self._rate()
            left = f", {(self._total - done) / rate:.0f} s left" if rate else ""
            self.print(f"{self._title}: {done}/{self._total} {self._unit}, {self._note()}{left}")
            self._line_at = now

    def _update(self) -> None:
        if self._bar is not None:
            self._bar.update(self._task, completed=self._done, note=self._note())

    def _note(self) -> str:
        solved = f"{self._successes / self._counted:.0%} solved, " if self._counted else ""
        text = f"{self._text}, " if self._text else ""
        return f"{solved}{text}{self._rate():.1f}/s"

    def _rate(self) -> float:
        return (self._done - self._skipped) / max(time.perf_counter() - self._start, 1e-9)


class PhaseBars:
    """A bar for each phase of long work, one after the other; a context manager that takes the last one away."""

    def __init__(self) -> None:
        self._phase = ""
        self._bar: ProgressBar | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def open(self, phase: str, total: int, unit: str) -> ProgressBar:
        """Show the bar of another phase, and return it."""
        self.close()
        self._phase, self._bar = phase, ProgressBar(phase, max(total, 1), unit)
        return self._bar.__enter__()

    def show(self, phase: str, done: int, total: int) -> None:
        """Show how many trajectories are done in a phase."""
        bar = self._bar if self._bar is not None and phase == self._phase else None
        (bar or self.open(phase, total, "trajectories")).show(done)

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.__exit__(None, None, None)
            self._bar = None
