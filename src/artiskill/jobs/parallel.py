"""Jobs on several processes: results in the jobs' order, news on the way, a prompt end whatever happens."""

import multiprocessing
import os
import time
from collections import deque
from collections.abc import Callable, Sequence
from multiprocessing.connection import wait as wait_for_any
from typing import Any, Protocol, TypeVar

from artiskill.errors import PolicyError
from artiskill.jobs.fork_server import fork_server
from artiskill.jobs.workers import Worker, spawn_workers, stop_workers

_POLL_S = 0.05
_PATIENCE_S = 20.0  # with jobs before one that has failed
_HINT = "the policy ended it, or memory ran out; try 1 worker"

Job = TypeVar("Job")
Result = TypeVar("Result")
Tell = Callable[[Any], None]


class JobSource(Protocol):
    """Jobs that are not all known beforehand; called in the parent process only."""

    def next(self) -> Any | None:
        """The next job; None if there is none at present: it is asked again whenever a job has finished."""

    def finished(self, number: int, result: Any) -> None:
        """The result of the job that was named as the `number`-th, counted from 0."""


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_jobs(
    function: Callable[[Job, Tell], Result],
    jobs: Sequence[Job],
    workers: int,
    on_news: Tell | None = None,
    describe: Callable[[Job], str] = str,
    own_process: bool = False,
    isolated: bool = False,
    hint: str = _HINT,
) -> list[Result]:
    """`function(job, tell)` of every job.

    With one worker, or one job, everything happens in this process. Otherwise processes are spawned, not forked:
    they inherit nothing from this one. What a job leaves behind in its process meets the next one there; where it
    may leave something, as foreign code does, jobs are `isolated`.

    Args:
        function: a module-level function; it may `tell` pickled news while it works. With `own_process`, also
            `Busy`, the time that its next part may take.
        jobs: pickled values.
        workers: processes, at least 1.
        on_news: called in this process with all news, in no fixed order.
        describe: a job's name, for errors.
        own_process: have one worker, too, be another process.
        isolated: have a process of its own for every job, forked from the `fork_server`; its function is of this
            package, or of a module that can be imported.
        hint: why a worker may have ended by itself, and what to do then.

    Returns:
        The results, in the order of the jobs.

    Raises:
        ArtiSkillError: what a job raised, as any other exception; of several, the first that became known, of
            isolated ones the first in their order.
        PolicyError: a worker ended by itself, or was `Busy` for too long.
        KeyboardInterrupt: Ctrl-C; its text names the jobs that had to be ended, if there were any.
    """
    listed = _ListedJobs(jobs)
    count = min(workers, len(jobs))
    run_source(function, listed, count, on_news, describe, own_process and bool(jobs), isolated, hint)
    return [listed.results[k] for k in range(len(jobs))]


def run_source(
    function: Callable[[Any, Tell], Any],
    source: JobSource,
    workers: int,
    on_news: Tell | None = None,
    describe: Callable[[Any], str] = str,
    own_process: bool = False,
    isolated: bool = False,
    hint: str = _HINT,
) -> None:
    """`run_jobs` of jobs that a source names one by one, until it names none and all have finished.

    Args:
        function: as in `run_jobs`, as the other ones.
        source: of the jobs.
        workers: processes.
        on_news: called with all news.
        describe: a job's name, for errors.
        own_process: have one worker, too, be another process.
        isolated: have a process of its own for every job.
        hint: why a worker may have ended by itself, and what to do then.

    Raises:
        ArtiSkillError: as `run_jobs`.
        KeyboardInterrupt: likewise.
    """
    on_news = on_news or _ignore
    if workers <= 1 and not own_process and not isolated:
        number = 0
        while (job := source.next()) is not None:
            source.finished(number, function(job, on_news))
            number += 1
        return
    crew = _Crew(source, on_news, describe, hint)
    try:
        if isolated:
            crew.run_isolated(function, max(1, workers))
        else:
            crew.run(function, max(1, workers))
    except KeyboardInterrupt as interrupt:
        ended = stop_workers(crew.workers)
        if not ended:
            raise
        what = "; ".join(sorted(crew.name_of(worker) for worker in ended if not worker.is_retired))
        raise KeyboardInterrupt(
            f"interrupted: ended workers that did not stop by themselves ({what})"
        ) from interrupt
    finally:
        stop_workers(crew.workers)


class _ListedJobs:
    """A fixed list of jobs, and their results by number."""

    def __init__(self, jobs: Sequence[Any]) -> None:
        self.results: dict[int, Any] = {}
        self._waiting = deque(jobs)

    def next(self) -> Any | None:
        return self._waiting.popleft() if self._waiting else None

    def finished(self, number: int, result: Any) -> None:
        self.results[number] = result


class _Crew:
    """Workers, and the jobs that they were given so far."""

    def __init__(self, source: JobSource, on_news: Tell, describe: Callable[[Any], str], hint: str) -> None:
        self.workers: list[Worker] = []
        self._source, self._on_news, self._describe, self._hint = source, on_news, describe, hint
        self._given: list[Any] = []
        self._has_next = True
        self._heard_s = time.monotonic()

    def run(self, function: Callable[[Any, Any], Any], count: int) -> None:
        """Have all jobs done."""
        spawn_workers(self.workers, count, multiprocessing.get_context("spawn"), function)
        while self._has_next or self._busy:
            self._attend_all()
            self._give_next()

    def run_isolated(self, function: Callable[[Any, Any], Any], count: int) -> None:
        """Have all jobs done, each in a process of its own, so many at a time.

        Of several that fail, the first in their order counts, as with one process: those before it are waited for,
        as long as one of them is heard of now and then.
        """
        server, failures = fork_server(), dict[int, Exception]()
        while True:
            while not failures and self._busy < count and (job := self._source.next()) is not None:
                self.workers.append(server.start(function))
                self._give(self.workers[-1], job)
            if failures and not self._may_fail_before(min(failures)):
                raise failures[min(failures)]
            if not self._busy:
                return
            self._attend_all(failures)
            for worker in self.workers:
                if worker.job is None and not worker.is_retired:
                    worker.retire()
            self.workers = [worker for worker in self.workers if not (worker.is_retired and worker.has_left)]

    def _may_fail_before(self, number: int) -> bool:
        """Whether a job before this one is at work, and was heard of lately."""
        is_silent = time.monotonic() - self._heard_s > _PATIENCE_S
        return not is_silent and any(w.job is not None and w.job < number for w in self.workers)

    @property
    def _busy(self) -> int:
        return sum(worker.job is not None for worker in self.workers)

    def _attend_all(self, failures: dict[int, Exception] | None = None) -> None:
        """Wait until any has something to say, or a moment; hear it.

        Args:
            failures: where to put the errors of jobs, by number; raised at once where None.
        """
        wanted = [worker for worker in self.workers if worker.is_wanted]
        wait_for_any([sign for worker in wanted for sign in worker.signs], timeout=_POLL_S)
        for worker in wanted:
            try:
                self._attend(worker)
            except Exception as error:
                if failures is None or worker.job is None:
                    raise
                failures[worker.job] = error
                worker.job, worker.is_ready = None, True

    def name_of(self, worker: Worker) -> str:
        """What it is working on."""
        return "none" if worker.job is None else self._describe(self._given[worker.job])

    def _attend(self, worker: Worker) -> None:
        for kind, value in worker.messages():
            self._heard_s = time.monotonic()
            if kind == "news":
                self._on_news(value)
            elif kind == "failed":
                error, text = value
                error.add_note(text)
                raise error
            else:
                self._take_result(worker, kind, value)
        if worker.is_gone and worker.is_wanted:
            raise self._vanished(worker)
        complaint = worker.complaint
        if complaint is not None:
            raise PolicyError(complaint)

    def _take_result(self, worker: Worker, kind: str, value: Any) -> None:
        """It is ready, or done with a job."""
        if kind == "done":
            assert worker.job is not None
            self._source.finished(worker.job, value)
            worker.job = None
        worker.is_ready = True

    def _give_next(self) -> None:
        """Jobs for those that have none."""
        for worker in self.workers:
            if not worker.is_ready or worker.job is not None:
                continue
            job = self._source.next()
            self._has_next = job is not None
            if job is None:
                return
            self._give(worker, job)

    def _give(self, worker: Worker, job: Any) -> None:
        self._given.append(job)
        worker.give(len(self._given) - 1, job)

    def _vanished(self, worker: Worker) -> PolicyError:
        how = worker.how_it_ended()
        if worker.job is None and worker.was_killed:
            return PolicyError(f"a worker process was killed while it started ({how}): {self._hint}")
        if worker.job is None:
            return PolicyError(
                f"a worker process could not start ({how}); a script that uses several workers must keep its own "
                "work under `if __name__ == '__main__':`; or use 1 worker"
            )
        return PolicyError(f"{self.name_of(worker)}: a worker process ended by itself ({how}): {self._hint}")


def _ignore(item: Any) -> None:
    pass
