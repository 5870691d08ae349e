"""`run_source` on a Ray cluster: the same jobs, news and results, done by whichever nodes there are."""

import logging
import math
import pickle
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol

from artiskill.errors import ClusterError
from artiskill.jobs.parallel import JobSource, Tell
from artiskill.jobs.ray_cluster import RayCluster
from artiskill.jobs.ray_node import DIFFERENT, FAILED, Outcome, pack
from artiskill.jobs.ray_process import RayProcess

_LOGGER = logging.getLogger("artiskill.jobs")
_POLL_S = 0.2
_NO_CPU_S = 60.0  # nodes may come back


@contextmanager
def connected(cluster: RayCluster) -> Iterator["RunSource"]:
    """Connect to a cluster, and yield what does there what `run_source` does here, each job on one CPU.

    News of a job come with its result, in the order in which it told them. A job that is lost, with its node or
    its process, begins anew elsewhere, and the log has a warning; nothing that it told is heard twice. So jobs
    must leave no traces where they are done. Their function must be of a module that nodes can import. `Busy`
    means nothing here.

    Args:
        cluster: where it is, and how many jobs it may be given at a time.

    Raises:
        MissingExtraError: Ray is not installed.
        ClusterError: there is no such cluster. While jobs are done: it is lost, or has had no CPU for a minute; a
            node has other versions or other code than this process; a job was lost again and again.
    """
    cluster.check()
    process = RayProcess(cluster)
    try:
        process.connect()
        yield partial(_run_source, process)
    finally:
        process.stop()


class RunSource(Protocol):
    """`run_source`, wherever the work is done."""

    def __call__(
        self,
        function: Callable[[Any, Tell], Any],
        source: JobSource,
        *,
        on_news: Tell | None = None,
        describe: Callable[[Any], str] = str,
    ) -> None:
        """Have all jobs done."""


def _run_source(
    process: RayProcess,
    function: Callable[[Any, Tell], Any],
    source: JobSource,
    *,
    on_news: Tell | None = None,
    describe: Callable[[Any], str] = str,
) -> None:
    _Foreman(process, function, source, on_news or _ignore, describe).run()


@dataclass(eq=False)
class _Foreman:
    """Jobs that are given out, and what is heard of them."""

    process: RayProcess
    function: Callable[[Any, Tell], Any]
    source: JobSource
    on_news: Tell
    describe: Callable[[Any], str]
    given: dict[int, Any] = field(default_factory=dict)
    count: int = 0
    may_have_next: bool = True
    no_cpu_until_s: float = math.inf

    def run(self) -> None:
        """Have all jobs done."""
        handlers: dict[str, Callable[..., None]] = {
            "cpus": self._take_cpus,
            "want": self._give,
            "ended": self._take_outcome,
            "lost": self._take_loss,
        }
        self.process.say(True)
        while self.may_have_next or self.given:
            message = self.process.hear(_POLL_S)
            if message is not None:
                kind, *values = message
                handlers[kind](*values)
            if time.monotonic() > self.no_cpu_until_s:
                raise ClusterError(
                    f"the Ray cluster at {self.process.address!r} has had no node with a CPU for {_NO_CPU_S:g} s"
                )

    def _take_cpus(self, cpus: int) -> None:
        self.no_cpu_until_s = math.inf if cpus else time.monotonic() + _NO_CPU_S

    def _give(self) -> None:
        job = self.source.next()
        self.may_have_next = job is not None
        if job is None:
            self.process.say(None)
            return
        self.given[self.count] = job
        self.process.say((self.count, pack(self.function, job)))
        self.count += 1

    def _take_outcome(self, number: int, packed: bytes) -> None:
        outcome: Outcome = pickle.loads(packed)
        for item in outcome.news:
            self.on_news(item)
        if outcome.kind == DIFFERENT:
            raise ClusterError(
                f"node {outcome.node} would give other results ({outcome.value}): "
                "all nodes need what is installed here"
            )
        if outcome.kind == FAILED:
            error, text = outcome.value
            error.add_note(f"at node {outcome.node}, {text}")
            raise error
        del self.given[number]
        self.may_have_next = True
        self.source.finished(number, outcome.value)

    def _take_loss(self, number: int, reason: str, again: bool) -> None:
        name = self.describe(self.given[number])
        if not again:
            raise ClusterError(f"{name}: cannot be done at the Ray cluster: {reason}")
        _LOGGER.warning("%s: lost, and begun anew (%s)", name, reason)


def _ignore(item: Any) -> None:
    pass
