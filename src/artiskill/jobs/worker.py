"""A worker process, seen from both of its ends: it is given jobs one by one, and sends back what came of them."""

import math
import os
import pickle
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import parent_process
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for_any
from typing import Any

_GRACE_S = 3.0  # for a worker to come to its next message, an evaluation's next episode say
_TERMINATE_S = 1.0  # for what it does on SIGTERM

MESSAGE, DONE, FAILED = "message", "done", "failed"
Outcome = tuple[str, Any]
Send = Callable[[Any], None]
SendSignal = Callable[[int, int], None]


@dataclass(frozen=True)
class Deadline:
    """Message of a job: what comes next must end within a time; `NO_DEADLINE` says that it has.

    Attributes:
        error: what to say if it does not.
        limit_s: from when the message arrives.
    """

    error: str
    limit_s: float


NO_DEADLINE = Deadline("", math.inf)


class _CancelledError(Exception):
    """The jobs are no longer wanted."""


class Worker:
    """The parent's end of a process that does jobs.

    Args:
        pid: its number.
        status: from the `ForkServer`, which sends its exit status when it ends.
        connection: to the process.
        send_signal: sends a process a signal.

    Attributes:
        job: number of the job that it is working on; None if on none.
        is_gone: it can send nothing any more.
        is_retired: it gets no more jobs, and is about to end.
        exit_status: minus the signal's number if one has ended it; None before, or where the server ended first.
    """

    def __init__(self, pid: int, status: Connection, connection: Connection, send_signal: SendSignal) -> None:
        self.job: int | None = None
        self.is_gone = self.is_retired = False
        self.exit_status: int | None = None
        self._pid, self._status, self._connection, self._send_signal = pid, status, connection, send_signal
        self._deadline, self._end_s = NO_DEADLINE, math.inf
        self._has_ended = False

    @property
    def waitables(self) -> tuple[Connection, Connection]:
        """What becomes ready when it has sent something, or ends."""
        return self._connection, self._status

    @property
    def overdue(self) -> str | None:
        """The error of the deadline that it has missed, else None."""
        is_late = time.monotonic() > self._end_s and not self._connection.poll()
        return self._deadline.error if is_late else None

    def give(self, number: int, packed: bytes) -> None:
        """Have it do a job, as `pack` packs it."""
        self.job = number
        with suppress(OSError):  # it has just ended, which `receive` will find
            self._connection.send_bytes(packed)

    def receive(self) -> Iterator[Outcome]:
        """Yield what it has sent since: `MESSAGE`, `DONE` or `FAILED`, each with a value."""
        while True:
            is_alive = self.is_alive()  # asked first: all that a dead one has sent can then be read
            try:
                if not self._connection.poll():
                    self.is_gone |= not is_alive
                    return
                kind, value = self._connection.recv()
            except (EOFError, OSError):
                self.is_gone = True
                return
            if isinstance(value, Deadline):
                self._deadline, self._end_s = value, time.monotonic() + value.limit_s
            else:
                yield kind, value

    def retire(self) -> None:
        """Let it end, which it must do within seconds: all that it had to send has been received."""
        self.is_retired, self._end_s = True, time.monotonic() + _GRACE_S
        self._connection.close()

    @property
    def has_left(self) -> bool:
        """Whether one that is retired has ended. One that is late is killed."""
        if time.monotonic() > self._end_s:
            self._send_signal(self._pid, signal.SIGKILL)
        return not self.is_alive()

    def is_alive(self) -> bool:
        """Whether it has not ended."""
        self.join(0.0)
        return not self._has_ended

    def join(self, timeout_s: float | None = None) -> None:
        """Wait until it has ended."""
        if not self._has_ended and self._status.poll(timeout_s):
            self._has_ended = True
            with suppress(EOFError, OSError):  # the server has ended
                self.exit_status = self._status.recv()

    def how_it_ended(self) -> str:
        """Return signal or exit status of one that is gone."""
        self.join(_TERMINATE_S)
        code = self.exit_status
        if code is None:
            return "closed connection"
        return f"exit status {code}" if code >= 0 else f"killed by signal {-code}, {signal.strsignal(-code)}"


def stop_workers(workers: Sequence[Worker]) -> list[Worker]:
    """Cancel their jobs, and end those that do not stop by themselves within seconds.

    Returns:
        Those that had to be ended.
    """
    for worker in workers:
        worker._connection.close()  # its next message fails, and so does waiting for a job
    stubborn: list[Worker] = []
    try:
        _join(workers, _GRACE_S)
    finally:  # a second Ctrl-C ends the grace
        stubborn += [worker for worker in workers if worker.is_alive()]
        for number in (signal.SIGTERM, signal.SIGKILL):
            for worker in stubborn:
                worker._send_signal(worker._pid, number)
            _join(stubborn, _TERMINATE_S if number == signal.SIGTERM else None)
    return stubborn


def _join(workers: Sequence[Worker], limit_s: float | None) -> None:
    end_s = math.inf if limit_s is None else time.monotonic() + limit_s
    for worker in workers:
        worker.join(None if limit_s is None else max(0.0, end_s - time.monotonic()))


# -- the worker's end ---------------------------------------------------------------------------------------------

_is_worker = False


def in_worker() -> bool:
    """Return whether this process is a worker, one of several that share the cores."""
    return _is_worker or parent_process() is not None


def serve_jobs(connection: Connection, parent: int) -> None:
    """Do what a worker process does.

    Args:
        connection: to who gives it jobs.
        parent: becomes ready when that process has ended.
    """
    global _is_worker
    _is_worker = True
    threading.Thread(target=_end_with_parent, args=(parent,), daemon=True).start()

    def send(outcome: Outcome) -> None:
        try:
            connection.send(outcome)
        except OSError as error:
            raise _CancelledError from error

    with suppress(_CancelledError):
        while True:
            try:
                packed = connection.recv_bytes()
            except (EOFError, OSError):
                return
            send(do_job(packed, lambda item: send((MESSAGE, item))))


def pack(function: Callable[[Any, Send], Any], job: Any) -> bytes:
    """Pack a job as it travels to another process."""
    return pickle.dumps((function, job))


def do_job(packed: bytes, send: Send) -> Outcome:
    """Do a job: `DONE` with its result, or `FAILED` with an error that can be pickled and its traceback."""
    try:
        function, job = pickle.loads(packed)
        return DONE, function(job, send)
    except _CancelledError:
        raise
    except Exception as error:  # of any kind: the parent raises it
        return FAILED, _portable(error)


def _portable(error: Exception) -> tuple[Exception, str]:
    """Return the error, or one like it that can be pickled, and the traceback, which never can."""
    text = "".join(traceback.format_exception(error))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # whatever a foreign class does instead of being pickled
        error = RuntimeError(f"{type(error).__name__}: {error}")
    return error, f"in a worker process:\n{text}"


def _end_with_parent(sentinel: int) -> None:
    """End this process with its parent: one that is killed cannot cancel jobs, and a policy may hang."""
    wait_for_any([sentinel])
    os._exit(1)
