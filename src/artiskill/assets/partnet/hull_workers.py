"""Parts decomposed on several processes at once, each result handed over as soon as it is there.

The processes do not run the caller's script again, as those of multiprocessing do, so that importing an object
needs no `if __name__ == "__main__"`. coacd and the linear algebra run on one thread in all of them, and even a
single worker is a process of its own: the bits do not depend on their number, and a part that crashes coacd ends
nothing else. Parts of a few flat boards are done at once, sooner than a process starts.
"""

import os
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for_any

import numpy as np

from artiskill.assets.partnet.decompose import DecompositionPart, decompose, decompose_quickly
from artiskill.errors import ArtiSkillError, AssetError
from artiskill.jobs.parallel import available_cores
from artiskill.jobs.worker import in_worker

Hulls = list[np.ndarray]
OnDone = Callable[[int, Hulls], None]

# results must not depend on how many threads there are, and the processes share the cores already
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "TBB_NUM_THREADS"), "1")
_POLL_S = 0.25
_COMMAND = "from artiskill.assets.partnet.hull_workers import serve; serve({})"


def default_workers() -> int:
    """One per core; one alone in a process that is itself one of many."""
    return 1 if in_worker() else available_cores()


def decompose_parts(
    parts: Sequence[DecompositionPart], workers: int, on_done: OnDone, on_wait: Callable[[], None]
) -> None:
    """`decompose` of each part, the largest first.

    Args:
        parts: of one object.
        workers: processes at most.
        on_done: called with a part's number and its hulls, in no fixed order.
        on_wait: called a few times a second, and after each part.

    Raises:
        AssetError: a process ended by itself.
        ArtiSkillError: what a part led to.
    """
    sizes = [sum(len(mesh.faces) for mesh in part.meshes) for part in parts]
    waiting: deque[int] = deque()
    for number in sorted(range(len(parts)), key=lambda k: (-sizes[k], k)):
        hulls = decompose_quickly(parts[number])
        if hulls is None:
            waiting.append(number)
        else:
            on_done(number, hulls)
    crew = [_Worker() for _ in range(min(workers, len(waiting)))]
    left = len(waiting)
    try:
        for worker in crew:
            worker.give(waiting.popleft(), parts)
        while left:
            for connection in wait_for_any([w.connection for w in crew if w.number is not None], timeout=_POLL_S):
                worker = next(w for w in crew if w.connection is connection)
                number, hulls = worker.take()
                left -= 1
                if waiting:
                    worker.give(waiting.popleft(), parts)
                on_done(number, hulls)
            on_wait()
    finally:
        for worker in crew:
            worker.stop()


class _Worker:
    """One process.

    Attributes:
        connection: to it.
        number: of the part that it is working on; None if on none.
    """

    def __init__(self) -> None:
        self.connection, theirs = Pipe()
        self.number: int | None = None
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", _COMMAND.format(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,  # coacd logs there
                env={
                    **os.environ,
                    **_ONE_THREAD,
                    "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
                },
            )

    def give(self, number: int, parts: Sequence[DecompositionPart]) -> None:
        """Have a part decomposed."""
        self.number = number
        with suppress(BrokenPipeError):  # `take` finds that it is gone
            self.connection.send(parts[number])

    def take(self) -> tuple[int, Hulls]:
        """The part's number and what became of it.

        Raises:
            AssetError: the process is gone.
            ArtiSkillError: what it raised.
        """
        assert self.number is not None
        number, self.number = self.number, None
        try:
            answer = self.connection.recv()
        except (EOFError, ConnectionError) as error:
            code = self._process.wait()
            how = signal.Signals(-code).name if code < 0 else f"exit status {code}"
            raise AssetError(
                f"the decomposition of a part into convex hulls ended by itself ({how}): memory ran out, or the "
                "part is more than coacd can do; what was done before is kept"
            ) from error
        if isinstance(answer, BaseException):
            raise answer
        return number, answer

    def stop(self) -> None:
        """End it, whatever it does."""
        self.connection.close()
        self._process.kill()
        self._process.wait()


def serve(descriptor: int) -> None:
    """Decompose what comes in by a connection, until it closes; called in the worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent, which ends this process
    connection = Connection(descriptor)
    with suppress(EOFError, ConnectionError):
        while True:
            connection.send(_answer(connection.recv()))


def _answer(part: DecompositionPart) -> Hulls | Exception:
    try:
        return decompose(part)
    except ArtiSkillError as error:
        return error
