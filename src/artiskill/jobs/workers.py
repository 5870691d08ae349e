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
from typing import Any, Protocol

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


class Process(Protocol):
    """What is needed of `multiprocessing.Process`."""

    @property
    def sentinel(self) -> Any:
        """Becomes ready when it ends."""

    @property
    def exitcode(self) -> int | None:
        """Its exit status; minus the signal's number if one has ended it; None while it is alive."""

    def is_alive(self) -> bool:
        """Whether it has not ended."""

    def join(self, timeout: float | None = None) -> None:
        """Wait until it has ended."""

    def terminate(self) -> None:
        """Send it SIGTERM."""

    def kill(self) -> None:
        """Send it SIGKILL."""


class Worker:
    """The parent's end of a process that runs a function on jobs.

    Args:
        process: that has started.
        connection: to it.

    Attributes:
        job: number of the job that it is working on; None if on none.
        is_ready: it has started up.
        is_gone: it can say nothing any more.
        is_retired: it gets no more jobs, and is about to end.
    """

    def __init__(self, process: Process, connection: Connection) -> None:
        self.job: int | None = None
        self.is_ready = self.is_gone = self.is_retired = False
        self._busy, self._deadline_s = IDLE, math.inf
        self._process, self._connection = process, connection

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

    def retire(self) -> None:
        """Let it end, which it must do within seconds: whatever it has to tell has been heard."""
        self.is_retired, self._deadline_s = True, time.monotonic() + _GRACE_S
        self._connection.close()

    @property
    def has_left(self) -> bool:
        """Of one that is retired: whether it has ended. One that is late is killed."""
        if time.monotonic() > self._deadline_s:
            self._process.kill()
        return not self._process.is_alive()

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


def spawn_workers(
    workers: list[Worker], count: int, context: SpawnContext, function: Callable[[Any, Any], Any]
) -> None:
    """Add so many to the list; they never see a Ctrl-C, which is the parent's business."""
    with _without_ctrl_c():
        for _ in range(count):  # those that exist must be known at any time
            connection, theirs = context.Pipe()
            process = context.Process(target=serve_jobs, args=(theirs, function))
            process.start()
            theirs.close()
            workers.append(Worker(process, connection))


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


def serve_jobs(connection: Connection, function: Callable[[Any, Any], Any], parent: int | None = None) -> None:
    """What a worker process does.

    Args:
        connection: to who gives it jobs.
        function: of jobs.
        parent: becomes ready when that process ends; None for one of `multiprocessing`'s.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_end_with_parent, args=(parent,), daemon=True).start()

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


def _end_with_parent(sentinel: int | None) -> None:
    """A parent that is killed cannot call jobs off; nothing else would end a worker whose policy hangs."""
    if sentinel is None:
        parent = parent_process()
        assert parent is not None
        sentinel = parent.sentinel
    wait_for_any([sentinel])
    os._exit(1)
