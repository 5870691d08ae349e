"""`run_source` on a Ray cluster: the same jobs, messages and results, done by whichever nodes there are.

Ray itself is not imported here, but by a process that runs `ray_driver`.
"""

import contextlib
import importlib.util
import logging
import math
import os
import pickle
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from multiprocessing import Pipe
from typing import Any

from artiskill.errors import ClusterError, ConfigError, MissingExtraError, UnknownNameError
from artiskill.jobs.parallel import JobSource, available_cores, check_workers
from artiskill.jobs.ray_driver import DIFFERENT, LOCAL, NodeOutcome, facts
from artiskill.jobs.worker import FAILED, Send, pack

_LOGGER = logging.getLogger("artiskill.jobs")

RUNNING = "auto"
_LEGAL = (LOCAL, RUNNING, "HOST:PORT")
_CLIENT_SCHEME = "ray://"
_MOST_PORT = 65535
_PROBE_S = 5.0
_POLL_S = 0.2
_NO_CPU_S = 60.0  # nodes may come back
_CONNECT_S = 30.0  # takes a few seconds; what is no Ray cluster may never answer
_START_S = 90.0  # of one's own cluster, on a machine that is busy or slow
_LOST_S = 20  # that Ray tries to find a head that has gone; by itself it takes a minute
_STAMP = re.compile(r"^\[[^]]*\] \S+: ")  # time and place, before what Ray says
_GRACE_S = 10.0  # for cancelling jobs and, where the cluster is its own, ending that
_DYING_S = 2.0  # between the end of the pipe and that of the process


@dataclass(frozen=True)
class RayCluster:
    """A Ray cluster to run jobs on.

    Attributes:
        address: `HOST:PORT` of a cluster that this machine is a node of; `auto`, the cluster that this machine is
            a node of, whatever its address; `local`, one on this machine that is started for the jobs and ended
            with them.
        most_jobs: at a time; None for one per CPU of the cluster, however many that are at the time.

    Raises:
        UnknownNameError: no such address.
        ConfigError: an address of Ray Client, or an illegal number.
    """

    address: str
    most_jobs: int | None = None

    def __post_init__(self) -> None:
        """Check the values."""
        if self.address.startswith(_CLIENT_SCHEME):
            raise ConfigError(
                f"{self.address!r} is an address of Ray Client, which is not supported: run this on a machine "
                f"of the cluster, with {RUNNING!r} as its address"
            )
        if self.address not in (LOCAL, RUNNING) and self.host_and_port is None:
            raise UnknownNameError("address of a Ray cluster", self.address, _LEGAL)
        if self.most_jobs is not None:
            check_workers(self.most_jobs)

    @property
    def host_and_port(self) -> tuple[str, int] | None:
        """Host and port of an address that has them."""
        host, _, port = self.address.rpartition(":")
        is_port = port.isascii() and port.isdecimal() and len(port) <= 5 and 0 < int(port) <= _MOST_PORT
        return (host.strip("[]"), int(port)) if host and is_port else None

    def check(self) -> None:
        """See whether Ray is installed and, at an address, somebody answers.

        Raises:
            MissingExtraError: Ray is not installed.
            ClusterError: nobody answers.
        """
        if importlib.util.find_spec("ray") is None:
            raise MissingExtraError("work on a Ray cluster", "distributed")
        if self.host_and_port is None:
            return
        try:
            socket.create_connection(self.host_and_port, timeout=_PROBE_S).close()
        except OSError as error:
            raise ClusterError(
                f"no Ray cluster at {self.address!r}: {error.strerror or error}; "
                "its address is what `ray start --head` printed; on a machine of the cluster, --ray auto finds it"
            ) from error


@contextlib.contextmanager
def connected(cluster: RayCluster) -> Iterator[Callable[..., None]]:
    """Connect to a cluster, and yield a `run_source` that works there, each job on one CPU.

    It takes `function`, `source`, `on_message` and `describe`.

    Messages of a job come with its result, in the order in which it sent them. A job that is lost, with its node
    or its process, is done again elsewhere, and the log has a warning; no message arrives twice. So jobs must
    leave no traces where they are done. Their function must be of a module that nodes can import. A `Deadline`
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
        yield lambda *jobs, **options: _RemoteRun(process, *jobs, **options).run()
    finally:
        process.stop()


@dataclass(eq=False)
class _RemoteRun:
    """Jobs that are given out, and what comes back."""

    process: "RayProcess"
    function: Callable[[Any, Send], Any]
    source: JobSource
    on_message: Send = lambda message: None
    describe: Callable[[Any], str] = str
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
        self.process.send(True)
        while self.may_have_next or self.given:
            message = self.process.receive(_POLL_S)
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
            self.process.send(None)
            return
        self.given[self.count] = job
        self.process.send((self.count, pack(self.function, job)))
        self.count += 1

    def _take_outcome(self, number: int, packed: bytes) -> None:
        outcome: NodeOutcome = pickle.loads(packed)
        for item in outcome.messages:
            self.on_message(item)
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
        _LOGGER.warning("%s: lost, and started again (%s)", name, reason)


class RayProcess:
    """A process that runs `artiskill.jobs.ray_driver`; what Ray prints goes to a file that nobody sees.

    Args:
        cluster: that it connects to.

    Attributes:
        address: of the cluster.
    """

    def __init__(self, cluster: RayCluster) -> None:
        self.address = cluster.address
        self._is_connected = False
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `stop`
        self._connection, theirs = Pipe()
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "artiskill.jobs.ray_driver", str(theirs.fileno())],
            env=os.environ | {"RAY_gcs_rpc_server_reconnect_timeout_s": str(_LOST_S)},
            cwd=os.sep,  # Ray has nodes look for modules where its driver is, whatever lies there
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=self._log,
            pass_fds=(theirs.fileno(),),
            start_new_session=True,  # a Ctrl-C is not its business
        )
        theirs.close()
        self.send((cluster.address, cluster.most_jobs, available_cores(), facts()))

    def connect(self) -> None:
        """Wait until it has reached the cluster.

        Raises:
            ClusterError: there is none, or it does not answer.
        """
        most_s = _START_S if self.address == LOCAL else _CONNECT_S
        kind, reason = self.receive(most_s) or (
            "",
            f"no answer within {most_s:g} s; is this machine a node of it?",
        )
        if kind != "connected":
            hint = "" if self.address in (LOCAL, RUNNING) else "; one with a token needs RAY_AUTH_MODE=token"
            raise ClusterError(f"cannot use the Ray cluster at {self.address!r}: {reason}{hint}")
        self._is_connected = True

    def send(self, message: Any) -> None:
        """Send it something."""
        with contextlib.suppress(OSError):  # it has just ended, which `receive` will find
            self._connection.send(message)

    def receive(self, most_s: float) -> tuple[Any, ...] | None:
        """Return what it sends next, or None if that is nothing for so long.

        Raises:
            ClusterError: it has ended.
        """
        try:
            return self._connection.recv() if self._connection.poll(most_s) else None
        except (EOFError, OSError) as error:
            raise ClusterError(f"the Ray cluster at {self.address!r} is lost ({self._how_it_ended()})") from error

    def stop(self) -> None:
        """Have the jobs cancelled, and end it."""
        self._connection.close()
        try:
            self._process.wait(_GRACE_S if self._is_connected else 0.0)
        except subprocess.TimeoutExpired:
            pass
        finally:  # a second Ctrl-C ends the grace
            if self._process.poll() is None:
                os.killpg(self._process.pid, signal.SIGKILL)
                self._process.wait()
            self._log.close()

    def _how_it_ended(self) -> str:
        """Return its exit status and the last line that it printed."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_DYING_S)
        self._log.seek(0)
        lines = [line.strip() for line in self._log.read().decode(errors="replace").splitlines() if line.strip()]
        last = [_STAMP.sub("", line).split(". ")[0] for line in lines[-1:]]
        return ": ".join([f"exit status {self._process.poll()}", *last])
