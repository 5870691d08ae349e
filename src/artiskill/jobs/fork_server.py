"""A clean process that forks others: each begins with the package loaded, and with nothing that another one did.

The server is started as a new interpreter and runs code of this package only; jobs, and what they import, are
unpacked in the forked processes alone. So one of them takes milliseconds to start, and none depends on how many
were before it. The fork server of `multiprocessing` runs the caller's `__main__` in each process, is shared with
what else the caller has it import, and lets live what a process has started; else it is like this one.
"""

import atexit
import gc
import os
import pickle
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for_any
from multiprocessing.reduction import recv_handle, send_handle

from artiskill.errors import PolicyError
from artiskill.jobs.worker import Worker, serve_jobs

_CODE = "import sys; sys.path[:] = {path!r}; from artiskill.jobs.fork_server import serve; serve({handle})"
_CLOSING_S = 3.0
_PREPARE, _FORK, _SIGNAL = "prepare", "fork", "signal"


class ForkServer:
    """The caller's end; it may be used from several threads.

    The server inherits the environment, and ends with this process, and all that it has forked with it.
    """

    def __init__(self) -> None:
        self._owner, self._lock, self._prepared = os.getpid(), threading.Lock(), set[bytes]()
        self._has_forked = False
        self._control, theirs = Pipe()
        code = _CODE.format(path=[os.path.abspath(path) for path in sys.path], handle=theirs.fileno())
        self._process = subprocess.Popen(
            [sys.executable, *subprocess._args_from_interpreter_flags(), "-c", code],  # type: ignore[attr-defined]
            env={"PYTHONHASHSEED": "0"} | os.environ,  # so that sets of texts have one order in every run
            stdin=subprocess.DEVNULL,
            pass_fds=(theirs.fileno(),),
            process_group=0,  # a Ctrl-C is not its business
        )
        theirs.close()

    @property
    def is_usable(self) -> bool:
        """Whether it can fork: it is alive, and was started by this process, not by one that forked this one."""
        return self._owner == os.getpid() and not self._control.closed and self._process.poll() is None

    def prepare(self, call: Callable[[], object]) -> None:
        """Have something done once before anything else is forked: imports, and what fills caches.

        This returns at once. Errors are ignored: the job that needs it will meet them again.

        Args:
            call: of this package or the standard library; pickled.
        """
        packed = pickle.dumps(call)
        with self._lock, suppress(OSError):  # it has just ended, which `start` will find
            if packed not in self._prepared:
                self._prepared.add(packed)
                self._control.send((_PREPARE, packed))

    def start(self) -> Worker:
        """Fork a process that does jobs.

        It has this process's working directory, environment and module path as they are now.

        Raises:
            PolicyError: the server has ended.
        """
        connection, theirs = Pipe()
        status, their_status = Pipe(duplex=False)
        with self._lock, theirs, their_status:
            try:
                self._control.send((_FORK, (os.getcwd(), dict(os.environ), sys.path)))
                for handle in (theirs.fileno(), their_status.fileno()):
                    send_handle(self._control, handle, self._process.pid)
                self._has_forked = True
                pid = self._control.recv()
            except (OSError, EOFError) as error:
                raise PolicyError(
                    f"a worker process could not start ({error or 'its parent has ended'})"
                ) from error
            except BaseException:  # Ctrl-C: the answer would be taken for that to the next question
                self._control.close()
                raise
        return Worker(pid, status, connection, self._signal)

    def close(self) -> None:
        """End it, and all that it has forked."""
        self._control.close()
        if self._owner == os.getpid():
            if not self._has_forked:  # else it has others to end
                self._process.terminate()
            try:
                self._process.wait(_CLOSING_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()

    def _signal(self, pid: int, number: int) -> None:
        with self._lock, suppress(OSError):
            self._control.send((_SIGNAL, pid, number))


_shared: ForkServer | None = None


def fork_server() -> ForkServer:
    """Return this process's server, which the first call starts."""
    global _shared
    if _shared is None or not _shared.is_usable:
        _shared = ForkServer()
        atexit.register(_shared.close)
    return _shared


# -- the server's end ---------------------------------------------------------------------------------------------


def serve(handle: int) -> None:
    """Run the server until the process that started it has ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _Server(Connection(handle)).run()


class _Server:
    def __init__(self, control: Connection) -> None:
        self._control = control
        self._children: dict[int, Connection] = {}
        self._life, self._own_life = os.pipe()  # the second end is nobody's but this process's
        self._woken, wake = os.pipe()
        os.set_blocking(wake, False)
        signal.signal(signal.SIGCHLD, _notice)
        signal.set_wakeup_fd(wake, warn_on_full_buffer=False)

    def run(self) -> None:
        handlers: dict[str, Callable[..., None]] = {
            _PREPARE: _prepare,
            _FORK: self._fork,
            _SIGNAL: self._signal,
        }
        try:
            while True:
                ready = wait_for_any([self._control, self._woken])
                if self._woken in ready:
                    os.read(self._woken, 1024)
                    self._reap()
                if self._control in ready:
                    kind, *values = self._control.recv()
                    handlers[kind](*values)
        except (EOFError, OSError):  # the process that started it has ended, or closed it
            for pid in self._children:
                _signal_group(pid, signal.SIGKILL)

    def _fork(self, place: tuple[str, dict[str, str], list[str]]) -> None:
        connection, status = (Connection(recv_handle(self._control)) for _ in range(2))
        pid = os.fork()
        if pid == 0:
            os._exit(_exit_status(lambda: self._work(connection, place)))
        with suppress(OSError):  # it does so itself, but perhaps not before it is sent a signal
            os.setpgid(pid, pid)
        self._children[pid] = status
        connection.close()
        self._control.send(pid)

    def _work(self, connection: Connection, place: tuple[str, dict[str, str], list[str]]) -> None:
        """Do jobs, in a forked process."""
        with suppress(OSError):
            os.setpgid(0, 0)
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        self._control.close()
        os.close(self._own_life)
        for status in self._children.values():
            status.close()
        folder, environment, sys.path[:] = place
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        serve_jobs(connection, self._life)

    def _signal(self, pid: int, number: int) -> None:
        if pid in self._children:  # else its number may be another's by now
            _signal_group(pid, number)

    def _reap(self) -> None:
        """Send the exit status of children that have ended."""
        for pid, status in list(self._children.items()):
            if os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
                continue
            _signal_group(pid, signal.SIGKILL)  # what it started and left behind; the number is still its own
            _, how = os.waitpid(pid, 0)
            del self._children[pid]
            with status, suppress(OSError):
                status.send(os.waitstatus_to_exitcode(how))


def _exit_status(work: Callable[[], None]) -> int:
    """Do a process's only work and return its exit status; threads that are left are not waited for."""
    try:
        work()
    except BaseException:  # the process ends here
        traceback.print_exc()
        return 1
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(Exception):
                stream.flush()
    return 0


def _prepare(packed: bytes) -> None:
    with suppress(Exception):
        pickle.loads(packed)()
    gc.collect()
    gc.freeze()  # or the collector would write to pages that forked processes share


def _signal_group(pid: int, number: int) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, number)


def _notice(number: int, frame: object) -> None:
    """Do nothing: where a handler is set, the interpreter itself writes to the pipe that wakes the server."""
