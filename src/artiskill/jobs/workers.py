"""One worker process, seen from both of its ends: it is given jobs one by one and tells what becomes of them."""

import math
import os
import pickle
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import parent_process, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for_any
from multiprocessing.context import SpawnContext
from typing import Any

_GRACE_S = 3.0  # for a worker to come to its next news, an evaluation's next episode say
_TERMINATE_S = 1.0  # for what it does on SIGTERM

Message = tuple[str, Any]
Send = Callable[[Message], None]


@dataclass(frozen=True)
class Busy:
    """News of a job that what comes next must end within a time; `IDLE` says that it has.

    Attributes:
        complaint: what to say if it does not.
        limit_s: from when the news arrives.
    """

    complaint: str
    limit_s: float


IDLE = Busy("", math.inf)


class _CalledOffError(Exception):
    """The jobs are no longer wanted."""


class Worker:
    """The parent's end of a process that runs a function on jobs.

    Attributes:
        job: number of the job that it is working on; None if on none.
        is_ready: it has started up.
        is_gone: it can say nothing any more.
    """

    def __init__(self, context: SpawnContext, function: Callable[[Any, Any], Any]) -> None:
        self.job: int | None = None
        self.is_ready = self.is_gone = False
        self._busy, self._deadline_s = IDLE, math.inf
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, function))
        self._process.start()
        theirs.close()

    @property
    def signs(self) -> tuple[Any, Any]:
        """What becomes ready when it has said something, or ends."""
        return self._connection, self._process.sentinel

    @property
    def is_wanted(self) -> bool:
        """Whether something is still expected from it."""
        return self.job is not None or not self.is_ready

    @property
    def complaint(self) -> str | None:
        """What to say if it is busy for longer than it may be, else None."""
        is_late = time.monotonic() > self._deadline_s and not self._connection.poll()
        return self._busy.complaint if is_late else None

    def give(self, number: int, job: Any) -> None:
        """Have it do a job."""
        self.job = number
        with suppress(OSError):  # it has just ended, which `messages` will find
            self._connection.send(job)

    def messages(self) -> Iterator[Message]:
        """What it has said since: `ready`, `news`, `done` or `failed`, each with a value."""
        while True:
            is_alive = (
                self._process.is_alive()
            )  # asked first: what a dead one has said can then be heard to its end
            try:
                if not self._connection.poll():
                    self.is_gone |= not is_alive
                    return
                kind, value = self._connection.recv()
            except (EOFError, OSError):
                self.is_gone = True
                return
            if isinstance(value, Busy):
                self._busy, self._deadline_s = value, time.monotonic() + value.limit_s
            else:
                yield kind, value

    @property
    def was_killed(self) -> bool:
        """Of one that is gone: whether a signal ended it."""
        self._process.join(_TERMINATE_S)
        return (self._process.exitcode or 0) < 0

    def how_it_ended(self) -> str:
        """Of one that is gone: signal or exit status."""
        self._process.join(_TERMINATE_S)
        code = self._process.exitcode
        if code is None:
            return "closed connection"
        return f"exit status {code}" if code >= 0 else f"killed by signal {-code}, {signal.strsignal(-code)}"


def start_workers(
    workers: list[Worker], count: int, context: SpawnContext, function: Callable[[Any, Any], Any]
) -> None:
    """Add so many to the list; they never see a Ctrl-C, which is the parent's business."""
    with _without_ctrl_c():
        for _ in range(count):
            workers.append(Worker(context, function))  # noqa: PERF401 - those that exist must be known at any time


def stop_workers(workers: Sequence[Worker]) -> list[Worker]:
    """Call off their jobs, and end those that do not stop by themselves within seconds.

    Returns:
        Those that had to be ended.
    """
    for worker in workers:
        worker._connection.close()  # its next news fail, and so does waiting for a job
        if not worker.is_ready:  # still importing
            worker._process.terminate()
    stubborn: list[Worker] = []
    try:
        _join(workers, _GRACE_S)
    finally:  # a second Ctrl-C ends the grace
        stubborn += [worker for worker in workers if worker._process.is_alive()]
        for worker in stubborn:
            worker._process.terminate()
        _join(stubborn, _TERMINATE_S)
        for worker in stubborn:
            worker._process.kill()
            worker._process.join()
    return stubborn


def _join(workers: Sequence[Worker], most_s: float) -> None:
    end_s = time.monotonic() + most_s
    for worker in workers:
        worker._process.join(max(0.0, end_s - time.monotonic()))


@contextmanager
def _without_ctrl_c() -> Iterator[None]:
    """SIGINT waits meanwhile, and processes started meanwhile begin with it blocked.

    Otherwise a Ctrl-C while they import shows their tracebacks.
    """
    resource_tracker.ensure_running()  # started along with the first process, it would unblock the signal again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(connection: Connection, function: Callable[[Any, Any], Any]) -> None:
    """What a worker process does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_end_with_parent, daemon=True).start()

    def send(message: Message) -> None:
        try:
            connection.send(message)
        except OSError as error:
            raise _CalledOffError from error

    with suppress(_CalledOffError):
        send(("ready", None))
        while True:
            try:
                job = connection.recv()
            except (EOFError, OSError):
                return
            send(outcome_of(function, job, send))


def outcome_of(function: Callable[[Any, Any], Any], job: Any, send: Send) -> Message:
    """Do a job: `done` with its result, or `failed` with an error that can be pickled and its traceback."""
    try:
        return "done", function(job, lambda item: send(("news", item)))
    except _CalledOffError:
        raise
    except Exception as error:  # of any kind: the parent raises it
        return "failed", _portable(error)


def _portable(error: Exception) -> tuple[Exception, str]:
    """The error, or one like it that can be pickled, and the traceback, which never can."""
    text = "".join(traceback.format_exception(error))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # whatever a foreign class does instead of being pickled
        error = RuntimeError(f"{type(error).__name__}: {error}")
    return error, f"in a worker process:\n{text}"


def _end_with_parent() -> None:
    """A parent that is killed cannot call jobs off; nothing else would end a worker whose policy hangs."""
    parent = parent_process()
    assert parent is not None
    wait_for_any([parent.sentinel])
    os._exit(1)
