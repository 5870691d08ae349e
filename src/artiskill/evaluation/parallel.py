"""Jobs on several processes: results in the jobs' order, news on the way, a prompt end whatever happens."""

import multiprocessing
import os
from collections import deque
from collections.abc import Callable, Sequence
from multiprocessing.connection import wait as wait_for_any
from typing import Any, TypeVar

from artiskill.errors import PolicyError
from artiskill.evaluation.workers import Worker, start_workers, stop_workers

_POLL_S = 0.05

Job = TypeVar("Job")
Result = TypeVar("Result")
Tell = Callable[[Any], None]


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
) -> list[Result]:
    """`function(job, tell)` of every job.

    With one worker, or one job, everything happens in this process. Otherwise processes are spawned, not forked:
    they inherit nothing, so that results cannot depend on the number of workers.

    Args:
        function: a module-level function; it may `tell` pickled news while it works. With `own_process`, also
            `Busy`, the time that its next part may take.
        jobs: pickled values.
        workers: processes, at least 1.
        on_news: called in this process with all news, in no fixed order.
        describe: a job's name, for errors.
        own_process: have one worker, too, be another process.

    Returns:
        The results, in the order of the jobs.

    Raises:
        ArtiSkillError: what a job raised, as any other exception; of several, the first that became known.
        PolicyError: a worker ended by itself, or was `Busy` for too long.
        KeyboardInterrupt: Ctrl-C; its text names the jobs that had to be ended, if there were any.
    """
    on_news = on_news or _ignore
    count = min(workers, len(jobs))
    if count <= 1 and not own_process:
        return [function(job, on_news) for job in jobs]
    crew = _Crew(jobs, on_news, describe)
    try:
        return crew.run(function, count)
    except KeyboardInterrupt as interrupt:
        ended = stop_workers(crew.workers)
        if not ended:
            raise
        what = "; ".join(sorted(crew.name_of(worker) for worker in ended))
        raise KeyboardInterrupt(
            f"interrupted: ended workers that did not stop by themselves ({what})"
        ) from interrupt
    finally:
        stop_workers(crew.workers)


class _Crew:
    """Workers, and what they have done so far."""

    def __init__(self, jobs: Sequence[Any], on_news: Tell, describe: Callable[[Any], str]) -> None:
        self.workers: list[Worker] = []
        self._jobs, self._on_news, self._describe = jobs, on_news, describe
        self._waiting = deque(range(len(jobs)))
        self._results: dict[int, Any] = {}

    def run(self, function: Callable[[Any, Any], Any], count: int) -> list[Any]:
        """The results of all jobs."""
        start_workers(self.workers, count, multiprocessing.get_context("spawn"), function)
        while len(self._results) < len(self._jobs):
            wanted = [worker for worker in self.workers if worker.is_wanted]
            wait_for_any([sign for worker in wanted for sign in worker.signs], timeout=_POLL_S)
            for worker in wanted:
                self._attend(worker)
        return [self._results[k] for k in range(len(self._jobs))]

    def name_of(self, worker: Worker) -> str:
        """What it is working on."""
        return "none" if worker.job is None else self._describe(self._jobs[worker.job])

    def _attend(self, worker: Worker) -> None:
        for kind, value in worker.messages():
            if kind == "news":
                self._on_news(value)
            elif kind == "failed":
                error, text = value
                error.add_note(text)
                raise error
            else:
                self._give_next(worker, kind, value)
        if worker.is_gone and worker.is_wanted:
            raise self._vanished(worker)
        complaint = worker.complaint
        if complaint is not None:
            raise PolicyError(complaint)

    def _give_next(self, worker: Worker, kind: str, value: Any) -> None:
        """It is ready, or done with a job."""
        if kind == "done":
            assert worker.job is not None
            self._results[worker.job] = value
        worker.job, worker.is_ready = None, True
        if self._waiting:
            number = self._waiting.popleft()
            worker.give(number, self._jobs[number])

    def _vanished(self, worker: Worker) -> PolicyError:
        how = worker.how_it_ended()
        if worker.job is None:
            return PolicyError(
                f"a worker process could not start ({how}); a script that uses several workers must keep its own "
                "work under `if __name__ == '__main__':`; or use 1 worker"
            )
        return PolicyError(
            f"{self.name_of(worker)}: a worker process ended by itself ({how}): "
            "the policy ended it, or memory ran out; try 1 worker"
        )


def _ignore(item: Any) -> None:
    pass
