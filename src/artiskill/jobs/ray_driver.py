"""The process that talks to Ray: it asks for jobs through a pipe, has them done, and tells what came of them.

It is a process of its own because Ray takes a process over: it prints there, handles its signals, and ends it when
the cluster is lost. Run as `python -m artiskill.jobs.ray_driver HANDLE`.
"""

import re
import sys
import time
from multiprocessing.connection import Connection
from typing import Any

from artiskill.jobs.ray_cluster import LOCAL

_POLL_S = 0.05
_COUNT_S = 1.0  # between looks at how large the cluster is
# a job that is lost so often is to blame itself, not the nodes that it was on
_MOST_TRIES = 5
TASK = "artiskill"  # as Ray calls the processes that do jobs


def main(handle: int) -> None:
    """Serve the pipe until its other end is closed."""
    import ray

    connection = Connection(handle)
    address, most_jobs, cores, facts = connection.recv()
    own = {"num_cpus": cores, "include_dashboard": False} if address == LOCAL else {}
    try:
        ray.init(address=address, log_to_driver=False, logging_level="error", **own)
    except Exception as error:  # whatever Ray raises
        connection.send(("refused", _text_of(error)))
        return
    try:
        connection.send(("connected", ""))
        _Driver(ray, connection, most_jobs, facts).run()
    finally:
        ray.shutdown()


class _Driver:
    """The jobs that Ray has.

    Once it is told that there are jobs, it says `want` when it has room for one more, and waits for the answer, a
    job with its number or None. That is all that the other end says; so the two never both wait for the other one
    to read.
    """

    def __init__(self, ray: Any, connection: Connection, most_jobs: int | None, facts: dict[str, str]) -> None:
        self._ray, self._connection, self._most_jobs, self._facts = ray, connection, most_jobs, facts
        self._play = _remote_play(ray)
        self._packed: dict[int, bytes] = {}
        self._tries: dict[int, int] = {}
        self._numbers: dict[Any, int] = {}  # reference -> job
        self._cpus, self._counted_s = -1, -_COUNT_S
        self._may_have_next = False

    def run(self) -> None:
        """Have jobs done until nobody wants them any more."""
        try:
            while True:
                self._count()
                self._ask()
                self._look()
                if self._connection.poll(0.0 if self._numbers else _POLL_S):
                    self._may_have_next = self._connection.recv()
        except (EOFError, OSError):
            for reference in self._numbers:
                self._ray.cancel(reference, force=True)

    def _count(self) -> None:
        """Tell how many jobs the cluster can do at a time."""
        if time.monotonic() < self._counted_s + _COUNT_S:
            return
        cpus = int(self._ray.cluster_resources().get("CPU", 0))
        if cpus != self._cpus:
            self._connection.send(("cpus", cpus))
        self._cpus, self._counted_s = cpus, time.monotonic()

    def _ask(self) -> None:
        """For as many jobs as there is room for; at least one, which makes a cluster grow that can."""
        room = max(1, self._cpus) if self._most_jobs is None else self._most_jobs
        while self._may_have_next and len(self._numbers) < room:
            self._connection.send(("want",))
            answer = self._connection.recv()
            self._may_have_next = answer is not None
            if answer is not None:
                number, self._packed[number] = answer
                self._tries[number] = 0  # numbers begin anew with every list of jobs
                self._submit(number)

    def _submit(self, number: int) -> None:
        self._tries[number] += 1
        self._numbers[self._play.remote(self._packed[number], self._facts)] = number

    def _look(self) -> None:
        """Tell of jobs that have come to an end; those that are lost begin anew."""
        if not self._numbers:
            return
        waiting = list(self._numbers)
        ended, _ = self._ray.wait(waiting, num_returns=1, timeout=_POLL_S)
        if ended:
            ended, _ = self._ray.wait(waiting, num_returns=len(waiting), timeout=0)
        for reference in ended:
            number = self._numbers.pop(reference)
            try:
                outcome = self._ray.get(reference)
            except self._ray.exceptions.LocalRayletDiedError:
                raise  # nothing can be asked of the cluster any more
            except self._ray.exceptions.RayError as error:
                self._take_loss(number, error)
            else:
                self._connection.send(("ended", number, outcome))
                self._may_have_next = True
                del self._packed[number]

    def _take_loss(self, number: int, error: Exception) -> None:
        is_fault = isinstance(error, self._ray.exceptions.RayTaskError)
        again = not is_fault and self._tries[number] < _MOST_TRIES
        self._connection.send(("lost", number, _text_of(error), again))
        if again:
            self._submit(number)


def _remote_play(ray: Any) -> Any:
    """The task; it travels by value, so that a node that cannot import this package can say so."""

    @ray.remote(num_cpus=1, max_retries=0, name=TASK)
    def play(packed: bytes, expected: dict[str, str]) -> bytes:
        from artiskill.jobs import ray_node

        return ray_node.play(packed, expected)

    return play


def _text_of(error: Exception) -> str:
    """What Ray says, without its advice; of an exception at a node, that one, and where it was."""
    cause = getattr(error, "cause", None)
    if cause is not None:
        place = re.search(r"ip=([\w.:]+)", str(error))  # Ray says it nowhere else
        return f"node {place[1] if place else '?'}: {type(cause).__name__}: {cause}"
    reason: BaseException = error
    while (deeper := reason.__cause__ or reason.__context__) is not None:
        reason = deeper
    texts = [str(one).strip().split("\n")[0].split(". ")[0].rstrip(".") for one in (error, reason)]
    return ": ".join(dict.fromkeys(text or type(error).__name__ for text in texts))


if __name__ == "__main__":
    main(int(sys.argv[1]))
