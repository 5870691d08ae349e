"""How far a long import has come, told in plain lines on standard error."""

import sys
import time

_SILENCE_S, _INTERVAL_S = 1.0, 10.0  # what takes less needs no line; from one line to the next


class ProgressLines:
    """Called with the parts done and those in all; prints a line now and then.

    Args:
        name: of the object.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._start = time.perf_counter()
        self._next_s = _SILENCE_S
        self._before: int | None = None  # parts that an earlier import had done

    def __call__(self, done: int, total: int) -> None:
        """Say how far it is, if it is time to."""
        now = time.perf_counter() - self._start
        if self._before is None:
            self._before = done
        if now < self._next_s and not (done == total and self._next_s > _SILENCE_S):
            return
        line = f"{self._name}: finding collision shapes, once: {done} of {total} parts, {now:.0f} s"
        if self._before < done < total:
            line += f", about {now / (done - self._before) * (total - done):.0f} s left"
        print(line, file=sys.stderr, flush=True)
        self._next_s = now + _INTERVAL_S
