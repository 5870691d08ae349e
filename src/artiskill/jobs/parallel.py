"""Jobs on several processes: results in the jobs' order, messages on the way, a prompt end whatever happens.

`concurrent.futures` with a preloaded fork server, and `pebble`, were tried. A new process for each job takes 9
to 16 ms with the first, 98 to 128 ms with the second, and 5 to 10 ms here. Neither ends what a job has started,
nor knows which of several errors comes first in the jobs' order, nor limits the time of a part of a job.
"""

import os
import time
from collections import deque
from collections.abc import Callable, Sequence
from multiprocessing.connection import wait as wait_for_any
from typing import Any, Protocol, TypeVar

from artiskill.errors import ConfigError, PolicyError, shown
from artiskill.jobs.fork_server import fork_server
from artiskill.jobs.worker import DONE, FAILED, MESSAGE, Send, Worker, pack, stop_workers

_POLL_S = 0.05
_PATIENCE_S = 20.0  # with jobs before one that has failed
_HINT = "memory ran out, or the job ended it; try 1 worker"

Job = TypeVar("Job")
Result = TypeVar("Result")


class JobSource(Protocol):
    """Jobs that are not all known beforehand; called in the parent process only."""

    def next(self) -> Any | None:
        """Return the next job; None if there is none at present: it is asked again whenever a job has finished."""

    def finished(self, number: int, result: Any) -> None:
        """Take the result of the job that was named as the `number`-th, counted from 0."""


def available_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_workers(workers: object) -> None:
    """Raise `ConfigError` unless this is a number of processes."""
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise ConfigError(f"workers must be a whole number of at least 1, not {shown(workers)}")


def run_jobs(
    function: Callable[[Job, Send], Result],
    jobs: Sequence[Job],
    workers: int,
    on_message: Send | None = None,
    describe: Callable[[Job], str] = str,
    isolated: bool = False,
    hint: str = _HINT,
) -> list[Result]:
    """Return `function(job, send)` of every job.

    With one worker, or one job, everything happens in this process, unless jobs are `isolated`. Otherwise
    processes are forked from the `fork_server`: they inherit nothing from this one, and never run the caller's
    script.

    Args:
        function: of a module that can be imported, not of a script; it may `send` pickled messages while it works.
            In another process also a `Deadline`, the time that its next part may take.
        jobs: pickled values.
        workers: processes, at least 1.
        on_message: called in this process with all messages, in no fixed order.
        describe: a job's name, for errors.
        isolated: have a new process for every job, with one worker, too. Otherwise what a job leaves behind in its
            process meets the next one there.
        hint: why a worker may have ended unexpectedly, and what to do then.

    Returns:
        The results, in the order of the jobs.

    Raises:
        ArtiSkillError: what a job raised, as any other exception; of several, the first that became known, of
            isolated ones the first in their order.
        PolicyError: a worker died, or missed a `Deadline`.
        KeyboardInterrupt: Ctrl-C; its text names the jobs that had to be ended, if there were any.
    """
    listed = _ListedJobs(jobs)
    run_source(function, listed, min(workers, len(jobs)), on_message, describe, isolated, hint)
    return [listed.results[k] for k in range(len(jobs))]


def run_source(
    function: Callable[[Any, Send], Any],
    source: JobSource,
    workers: int,
    on_message: Send | None = None,
    describe: Callable[[Any], str] = str,
    isolated: bool = False,
    hint: str = _HINT,
) -> None:
    """Do the jobs that a source names one by one, as `run_jobs` does, until it names none and all have finished.

    Raises:
        ArtiSkillError: as `run_jobs`.
        KeyboardInterrupt: likewise.
    """
    on_message = on_message or (lambda message: None)
    if workers <= 1 and not isolated:
        number = 0
        while (job := source.next()) is not None:
            source.finished(number, function(job, on_message))
            number += 1
        return
    pool = _Pool(function, source, on_message, describe, hint)
    try:
        pool.run(max(1, workers), isolated)
    except KeyboardInterrupt as interrupt:
        ended = stop_workers(pool.workers)
        if not ended:
            raise
        what = "; ".join(sorted(pool.name_of(worker) for worker in ended if worker.job is not None))
        raise KeyboardInterrupt(
            f"interrupted: ended workers that did not stop by themselves ({what})"
        ) from interrupt
    finally:
        stop_workers(pool.workers)


class _ListedJobs:
    """A fixed list of jobs, and their results by number."""

    def __init__(self, jobs: Sequence[Any]) -> None:
        self.results: dict[int, Any] = {}
        self._waiting = deque(jobs)

    def next(self) -> Any | None:
        return self._waiting.popleft() if self._waiting else None

    def finished(self, number: int, result: Any) -> None:
        self.results[number] = result


class _Pool:
    """Workers, and the jobs that they were given so far."""

    def __init__(
        self,
        function: Callable[[Any, Send], Any],
        source: JobSource,
        on_message: Send,
        describe: Callable[[Any], str],
        hint: str,
    ) -> None:
        self.workers: list[Worker] = []
        self._function, self._source, self._on_message = function, source, on_message
        self._describe, self._hint = describe, hint
        self._given: list[Any] = []
        self._failures: dict[int, Exception] = {}
        self._last_message_s = time.monotonic()

    def run(self, count: int, isolated: bool) -> None:
        """Have all jobs done, by so many workers at a time.

        Of several isolated jobs that fail, the first in their order counts, as with one worker: those before it
        are waited for, as long as one of them sends a message now and then.
        """
        while True:
            if not self._failures:
                self._give_jobs(count)
            elif not isolated or not self._may_fail_before(min(self._failures)):
                raise self._failures[min(self._failures)]
            if not self._busy:
                return
            self._receive_all()
            if isolated:
                for worker in self.workers:
                    if worker.job is None and not worker.is_retired:
                        worker.retire()
                self.workers = [worker for worker in self.workers if not (worker.is_retired and worker.has_left)]

    def name_of(self, worker: Worker) -> str:
        """Return the name of the job that it is working on."""
        assert worker.job is not None
        return self._describe(self._given[worker.job])

    @property
    def _busy(self) -> list[Worker]:
        return [worker for worker in self.workers if worker.job is not None]

    def _may_fail_before(self, number: int) -> bool:
        """Whether a job before this one is at work, and a message came lately."""
        is_silent = time.monotonic() - self._last_message_s > _PATIENCE_S
        return not is_silent and any(worker.job < number for worker in self._busy if worker.job is not None)

    def _give_jobs(self, count: int) -> None:
        idle = [worker for worker in self.workers if worker.job is None and not worker.is_retired]
        while len(self._busy) < count and (job := self._source.next()) is not None:
            packed = pack(self._function, job)
            if not idle:
                idle.append(fork_server().start())
                self.workers.append(idle[-1])
            self._given.append(job)
            idle.pop(0).give(len(self._given) - 1, packed)

    def _receive_all(self) -> None:
        """Wait until any worker has sent something, or a moment; take it in."""
        busy = self._busy
        wait_for_any([one for worker in busy for one in worker.waitables], timeout=_POLL_S)
        for worker in busy:
            assert worker.job is not None
            try:
                self._receive(worker)
            except Exception as error:
                if worker.job is None:  # its result was not taken
                    raise
                self._failures[worker.job] = error
                worker.job = None

    def _receive(self, worker: Worker) -> None:
        for kind, value in worker.receive():
            self._last_message_s = time.monotonic()
            if kind == MESSAGE:
                self._on_message(value)
            elif kind == FAILED:
                error, text = value
                error.add_note(text)
                raise error
            elif kind == DONE:
                number, worker.job = worker.job, None
                assert number is not None
                self._source.finished(number, value)
        if worker.job is not None and worker.is_gone:
            raise PolicyError(
                f"{self.name_of(worker)}: a worker process died ({worker.how_it_ended()}): {self._hint}"
            )
        if worker.job is not None and worker.overdue is not None:
            raise PolicyError(worker.overdue)
