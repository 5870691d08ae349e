"""The process that talks to Ray, and what happens at a node: a job asked for through a pipe, done, and sent back.

Ray takes a process over: it prints there, handles its signals, and ends it when the cluster is lost. So it gets
one of its own, run as `python -m artiskill.jobs.ray_driver HANDLE`.
"""

import hashlib
import pickle
import re
import socket
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from artiskill.jobs.worker import do_job
from artiskill.versions import versions

LOCAL = "local"  # address of a cluster that is started for the jobs, and ended with them
_POLL_S = 0.05
_COUNT_S = 1.0  # between looks at how large the cluster is
# a job that is lost so often is to blame itself, not the nodes that it was on
_MOST_TRIES = 5
TASK = "artiskill"  # as Ray calls the processes that do jobs

_PACKAGE = Path(__file__).parents[1]
_CODE = "code of artiskill"
_SOURCES = (".py", ".yaml")
_DIGITS = 12  # of a digest, to tell two apart

DIFFERENT = "different"


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

    Once it is told that there are jobs, it sends `want` when one more fits, and waits for the answer, a job with
    its number or None. That is all that the other end sends; so the two never both wait for the other one to
    read.
    """

    def __init__(self, ray: Any, connection: Connection, most_jobs: int | None, facts: dict[str, str]) -> None:
        self._ray, self._connection, self._most_jobs, self._facts = ray, connection, most_jobs, facts
        self._remote = _remote_function(ray)
        self._packed: dict[int, bytes] = {}
        self._tries: dict[int, int] = {}
        self._numbers: dict[Any, int] = {}  # reference -> job
        self._cpus, self._counted_s = -1, -_COUNT_S
        self._may_have_next = False

    def run(self) -> None:
        """Have jobs done until the pipe is closed."""
        try:
            while True:
                self._send_cpus()
                self._request_jobs()
                self._send_results()
                if self._connection.poll(0.0 if self._numbers else _POLL_S):
                    self._may_have_next = self._connection.recv()
        except (EOFError, OSError):
            for reference in self._numbers:
                self._ray.cancel(reference, force=True)

    def _send_cpus(self) -> None:
        """Send how many jobs the cluster can do at a time, where that has changed."""
        if time.monotonic() < self._counted_s + _COUNT_S:
            return
        cpus = int(self._ray.cluster_resources().get("CPU", 0))
        if cpus != self._cpus:
            self._connection.send(("cpus", cpus))
        self._cpus, self._counted_s = cpus, time.monotonic()

    def _request_jobs(self) -> None:
        """Ask for as many jobs as fit; at least one, which makes a cluster grow that can."""
        most = max(1, self._cpus) if self._most_jobs is None else self._most_jobs
        while self._may_have_next and len(self._numbers) < most:
            self._connection.send(("want",))
            answer = self._connection.recv()
            self._may_have_next = answer is not None
            if answer is not None:
                number, self._packed[number] = answer
                self._tries[number] = 0  # every list of jobs counts from 0 again
                self._submit(number)

    def _submit(self, number: int) -> None:
        self._tries[number] += 1
        self._numbers[self._remote.remote(self._packed[number], self._facts)] = number

    def _send_results(self) -> None:
        """Send what came of jobs that have ended; those that are lost start again."""
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
                self._send_loss(number, error)
            else:
                self._connection.send(("ended", number, outcome))
                self._may_have_next = True
                del self._packed[number]

    def _send_loss(self, number: int, error: Exception) -> None:
        is_fault = isinstance(error, self._ray.exceptions.RayTaskError)
        again = not is_fault and self._tries[number] < _MOST_TRIES
        self._connection.send(("lost", number, _text_of(error), again))
        if again:
            self._submit(number)


def _remote_function(ray: Any) -> Any:
    """Return the remote function. It travels by value, so that a node without this package gives a clear error."""

    @ray.remote(num_cpus=1, max_retries=0, name=TASK)
    def do_at_node(packed: bytes, expected: dict[str, str]) -> bytes:
        from artiskill.jobs import ray_driver

        return ray_driver.do_at_node(packed, expected)

    return do_at_node


def _text_of(error: Exception) -> str:
    """Return Ray's message without its advice; of an exception at a node, that one, and where it was."""
    cause = getattr(error, "cause", None)
    if cause is not None:
        place = re.search(r"ip=([\w.:]+)", str(error))  # Ray says it nowhere else
        return f"node {place[1] if place else '?'}: {type(cause).__name__}: {cause}"
    reason: BaseException = error
    while (deeper := reason.__cause__ or reason.__context__) is not None:
        reason = deeper
    texts = [str(one).strip().split("\n")[0].split(". ")[0].rstrip(".") for one in (error, reason)]
    return ": ".join(dict.fromkeys(text or type(error).__name__ for text in texts))


# -- at a node ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class NodeOutcome:
    """What came of a job at a node.

    Attributes:
        node: where it was done.
        messages: that the job sent, in order.
        kind: `DONE`, `FAILED`, or `DIFFERENT` where it was not begun.
        value: the job's result, its error and traceback, or how the node differs.
    """

    node: str
    messages: list[Any]
    kind: str
    value: Any


@cache
def facts() -> dict[str, str]:
    """Return what a job's result depends on besides the job: versions, and the package's own code."""
    digest = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*")):
        if path.suffix in _SOURCES:
            digest.update(str(path.relative_to(_PACKAGE)).encode() + b"\0" + path.read_bytes())
    return versions() | {_CODE: digest.hexdigest()[:_DIGITS]}


def do_at_node(packed: bytes, expected: Mapping[str, str]) -> bytes:
    """Do a job at a node of a Ray cluster.

    Nothing of it is unpacked before it is known that this place and the one where it comes from are alike.

    Args:
        packed: see `worker.pack`.
        expected: the `facts` of where the job comes from.

    Returns:
        A pickled `NodeOutcome`. It holds the messages, too, so that those of a node that is lost are lost with the
        result, and none of them arrives twice when the job is done again.
    """
    node, found = socket.gethostname(), facts()
    differing = [name for name in sorted({*expected, *found}) if expected.get(name) != found.get(name)]
    if differing:
        text = ", ".join(f"{name} {found.get(name)} there, {expected.get(name)} here" for name in differing)
        return pickle.dumps(NodeOutcome(node, [], DIFFERENT, text))
    messages: list[Any] = []
    kind, value = do_job(packed, messages.append)
    return pickle.dumps(NodeOutcome(node, messages, kind, value))


if __name__ == "__main__":
    main(int(sys.argv[1]))
