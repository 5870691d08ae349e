"""Jobs on several processes: results in the jobs' order, news on the way, a clean end whatever happens."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing.connection import wait as wait_for_sentinel
from typing import Any, TypeVar

from artiskill.errors import ArtiSkillError, PolicyError

_POLL_S = 0.05

Job = TypeVar("Job")
Result = TypeVar("Result")
Tell = Callable[[Any], None]

# Set in worker processes only: where news goes, and whether the jobs are called off.
_news: Any = None
_called_off: Any = None


class _CalledOffError(Exception):
    """The jobs are no longer wanted."""


@dataclass(frozen=True)
class _Failure:
    """An ArtiSkill error on its way between processes: not all of its classes survive pickling."""

    message: str
    is_policy: bool

    def error(self) -> ArtiSkillError:
        return (PolicyError if self.is_policy else ArtiSkillError)(self.message)


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_jobs(
    function: Callable[[Job, Tell], Result], jobs: Sequence[Job], workers: int, on_news: Tell | None = None
) -> list[Result]:
    """`function(job, tell)` of every job.

    With one worker, or one job, everything happens in this process. Otherwise processes are spawned, not forked:
    they inherit nothing, so that results cannot depend on the number of workers.

    Args:
        function: a module-level function; it may `tell` pickled news while it works.
        jobs: pickled values.
        workers: processes, at least 1.
        on_news: called in this process with all news, in no fixed order.

    Returns:
        The results, in the order of the jobs.

    Raises:
        ArtiSkillError: what a job raised; of several failing jobs, the first that became known.
    """
    on_news = on_news or _ignore
    if min(workers, len(jobs)) <= 1:
        return [function(job, on_news) for job in jobs]
    context = multiprocessing.get_context("spawn")
    news, called_off = context.SimpleQueue(), context.Event()
    pool = ProcessPoolExecutor(min(workers, len(jobs)), context, _start_worker, (news, called_off))
    try:
        futures: list[Future[Any]] = [pool.submit(_run_job, function, job) for job in jobs]
        for done in _completed(futures):
            while not news.empty():
                on_news(news.get())
            _raise_failure(done)
        return [future.result() for future in futures]
    finally:  # after an error or Ctrl-C this waits for the jobs' next news
        called_off.set()
        pool.shutdown(wait=True, cancel_futures=True)


def _completed(futures: Sequence["Future[Any]"]) -> Iterator[set["Future[Any]"]]:
    """Again and again those that have completed since, until all have."""
    pending = set(futures)
    while pending:
        done, pending = wait(pending, timeout=_POLL_S, return_when=FIRST_COMPLETED)
        yield done


def _raise_failure(done: set["Future[Any]"]) -> None:
    for future in done:
        try:
            result = future.result()
        except BrokenProcessPool as error:
            raise PolicyError(
                "a worker process ended by itself: the policy ended it, or memory ran out; try --workers 1"
            ) from error
        if isinstance(result, _Failure):
            raise result.error()


def _start_worker(news: Any, called_off: Any) -> None:
    global _news, _called_off
    _news, _called_off = news, called_off
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which calls the jobs off
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A parent that is killed cannot call jobs off; nothing would ever end its idle workers."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait_for_sentinel([parent.sentinel])
    os._exit(1)


def _run_job(function: Callable[[Job, Tell], Result], job: Job) -> Result | _Failure | None:
    try:
        return None if _called_off.is_set() else function(job, _tell)
    except _CalledOffError:
        return None
    except ArtiSkillError as error:
        return _Failure(str(error), isinstance(error, PolicyError))


def _tell(item: Any) -> None:
    if _called_off.is_set():
        raise _CalledOffError
    _news.put(item)


def _ignore(item: Any) -> None:
    pass
