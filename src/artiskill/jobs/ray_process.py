"""This end of the process that talks to Ray."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import tempfile
from multiprocessing import Pipe
from typing import Any

from artiskill.errors import ClusterError
from artiskill.jobs.parallel import available_cores
from artiskill.jobs.ray_cluster import LOCAL, RUNNING, RayCluster
from artiskill.jobs.ray_node import facts

_CONNECT_S = 30.0  # takes a few seconds; what is no Ray cluster may never answer
_START_S = 90.0  # of one's own cluster, on a machine that is busy or slow
_LOST_S = 20  # that Ray tries to find a head that has gone; by itself it takes a minute
_STAMP = re.compile(r"^\[[^]]*\] \S+: ")  # time and place, before what Ray says
_GRACE_S = 10.0  # for cancelling jobs and, where the cluster is its own, ending that
_DYING_S = 2.0  # between the end of the pipe and that of the process


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
        self.say((cluster.address, cluster.most_jobs, available_cores(), facts()))

    def connect(self) -> None:
        """Wait until it has reached the cluster.

        Raises:
            ClusterError: there is none, or it does not answer.
        """
        most_s = _START_S if self.address == LOCAL else _CONNECT_S
        kind, reason = self.hear(most_s) or ("", f"no answer within {most_s:g} s; is this machine a node of it?")
        if kind != "connected":
            hint = "" if self.address in (LOCAL, RUNNING) else "; one with a token needs RAY_AUTH_MODE=token"
            raise ClusterError(f"cannot use the Ray cluster at {self.address!r}: {reason}{hint}")
        self._is_connected = True

    def say(self, message: Any) -> None:
        """Answer it."""
        with contextlib.suppress(OSError):  # it has just ended, which `hear` will find
            self._connection.send(message)

    def hear(self, most_s: float) -> tuple[Any, ...] | None:
        """What it says next, or None if that is nothing for so long.

        Raises:
            ClusterError: it has ended.
        """
        try:
            return self._connection.recv() if self._connection.poll(most_s) else None
        except (EOFError, OSError) as error:
            raise ClusterError(f"the Ray cluster at {self.address!r} is lost ({self._last_words()})") from error

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

    def _last_words(self) -> str:
        """How it ended, and the last that was printed there."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_DYING_S)
        self._log.seek(0)
        lines = [line.strip() for line in self._log.read().decode(errors="replace").splitlines() if line.strip()]
        last = [_STAMP.sub("", line).split(". ")[0] for line in lines[-1:]]
        return ": ".join([f"exit status {self._process.poll()}", *last])
