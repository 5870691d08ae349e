"""Confinement of a solution's process: its kinds, how a process is started under each, and what must hold of it.

Whatever a kind promises is tried out by every process before the solution's code is run, see `sandbox_process`.
"""

import glob
import json
import os
import re
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import IO, Any

from artiskill.config import check_positive
from artiskill.errors import ConfigError, UnknownNameError
from artiskill.evaluation import sandbox_process, solution_process
from artiskill.evaluation.sandbox_process import FILES, MEMORY, NETWORK, OPEN, PRIVILEGES, PROCESSES
from artiskill.files import parse_json, temporary_folder
from artiskill.geometry.kernel_cache import TOLD, kernel_folder

BUBBLEWRAP, LANDLOCK, LIMITS, NONE = "bubblewrap", "landlock", "limits", "none"
SANDBOXES = (BUBBLEWRAP, LANDLOCK, LIMITS, NONE)  # the best first
TIME = "time"
_CONFINED = (FILES, NETWORK, MEMORY, PROCESSES, PRIVILEGES)
_PROMISED: Mapping[str, tuple[str, ...]] = {BUBBLEWRAP: _CONFINED, LANDLOCK: _CONFINED, LIMITS: (), NONE: ()}
_GB = 10**9
_FILE_SIZE = 2 * _GB  # of one file that it writes, and of a temporary folder in memory
_SAID = "solution: "
_MOST_OUTPUT = 1_000_000  # characters that a process may print
_STARTING_S = 30.0  # for what a process prints as it ends
_ENDING_S = 0.5
_SIGNAL = 128  # bwrap adds it to the number of a signal

_BUBBLEWRAP = (
    *("bwrap", "--unshare-all", "--cap-drop", "ALL", "--die-with-parent", "--new-session"),
    *("--proc", "/proc", "--remount-ro", "/proc"),  # root could else write to /proc/sys, without any capability
    *("--dev", "/dev", "--ro-bind", "/dev/null", "/dev/zero"),  # that one: see `_DEVICES`
)
_SYSTEM = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32", "/sys/devices/system/cpu")
_SYSTEM_FILES = ("/etc/ld.so.cache", "/etc/ld.so.conf", "/etc/ld.so.conf.d", "/etc/localtime", "/etc/alternatives")
_PROC_FILES = ("/proc/self", "/proc/cpuinfo", "/proc/meminfo", "/proc/stat", "/proc/driver/nvidia")
_DEVICES = ("/dev/null", "/dev/full", "/dev/random", "/dev/urandom")  # /dev/zero is memory that no limit counts
_GPUS = ("/dev/nvidia*", "/dev/kfd", "/dev/dri", "/dev/dxg")
_GPU_FOLDERS = ("/sys/bus", "/sys/class", "/sys/devices")
_KEPT_VARIABLES = re.compile(
    r"PATH|LANG|LC_\w+|TZ|LD_LIBRARY_PATH|DYLD_LIBRARY_PATH|PYTHONHASHSEED|PYTHONUTF8|PYTHONWARNINGS"
    r"|\w+_NUM_THREADS|CUDA_VISIBLE_DEVICES|CUDA_HOME"
)


@dataclass(frozen=True)
class SandboxConfig:
    """How a solution's process is confined.

    Attributes:
        kind: one of `SANDBOXES`; None for the best that holds here.
        memory_gb: that it may use, in 10^9 bytes.
        step_timeout_s: for each `act` and each `reset`.
        episode_timeout_s: for all of them in one episode.
        readable: files and folders that it may read besides its own folder and its interpreter.
        hidden: files and folders that it may not read even there, the folder of the report above all.
    """

    kind: str | None = None
    memory_gb: float = 8.0
    step_timeout_s: float = 60.0
    episode_timeout_s: float = 1800.0
    readable: tuple[str, ...] = ()
    hidden: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.kind not in (None, *SANDBOXES):
            raise UnknownNameError("sandbox", self.kind, SANDBOXES)
        check_positive(self, "memory_gb", "step_timeout_s", "episode_timeout_s")

    @property
    def kinds(self) -> tuple[str, ...]:
        """Those to try, the best first."""
        return SANDBOXES if self.kind is None else (self.kind,)


@dataclass(frozen=True)
class Confinement:
    """What was found to hold of a solution's process, as a report says it.

    Attributes:
        sandbox: its kind.
        version: of what confines it; empty for kinds that need nothing.
        held: what -> whether.
        tried: what -> attempt -> what came of it in the solution's process, before its code was run.
        limits: name -> number.
        readable: what else it may read, as asked for.
        passed_over: better kind -> why it does not hold here.
    """

    sandbox: str
    version: str
    held: dict[str, bool]
    tried: dict[str, dict[str, str]]
    limits: dict[str, float]
    readable: tuple[str, ...]
    passed_over: dict[str, str]

    def within(self, step_timeout_s: float) -> "Confinement":
        """Return the same with another time for each action."""
        return replace(self, limits=self.limits | {"step_timeout_s": float(step_timeout_s)})

    @property
    def text(self) -> str:
        """One line for people."""
        held, open_ = (
            [name for name, is_held in self.held.items() if is_held is wanted] for wanted in (True, False)
        )
        parts = [f"held: {', '.join(held)}", f"not held: {', '.join(open_)}" if open_ else ""]
        return f"confinement {self.sandbox} ({'; '.join(filter(None, parts))})"


class SandboxError(ConfigError):
    """A kind of confinement that does not hold here."""


def check_confinement(
    kind: str, config: SandboxConfig, said: bytes, passed_over: Mapping[str, str]
) -> Confinement:
    """Return what a process found out about its confinement.

    Args:
        kind: one of `SANDBOXES`.
        config: what was asked for.
        said: its answer; the solution's code has not been run.
        passed_over: better kinds, and why they do not hold.

    Raises:
        SandboxError: something that the kind promises does not hold.
    """
    answer: dict[str, Any] = parse_json(said)
    tried = answer["found"]
    held = {what: OPEN not in tried[what].values() for what in _CONFINED} | {TIME: True}
    for what in _PROMISED[kind]:
        if not held[what]:
            possible = next(attempt for attempt, outcome in tried[what].items() if outcome == OPEN)
            raise SandboxError("; ".join([f"a process in it can {possible}", *answer["failures"]]))
    limits = {name: float(getattr(config, name)) for name in ("memory_gb", "step_timeout_s", "episode_timeout_s")}
    if kind == NONE:
        del limits["memory_gb"]
    version = _bubblewrap_version() if kind == BUBBLEWRAP else ""
    return Confinement(kind, version, held, tried, limits, config.readable, dict(passed_over))


# -- the process --------------------------------------------------------------------------------------------------


class SandboxedProcess:
    """A process of `sandbox_process` and then `solution_process`, and what belongs to it on this side.

    What it prints appears on the standard error stream of this process: nothing that it holds leads to a file or
    terminal.

    Args:
        file: the solution file.
        kind: one of `SANDBOXES`.
        config: of its confinement.

    Attributes:
        channel: the socket to it.
        process: itself, or what it runs in.

    Raises:
        SandboxError: what this kind needs is not installed.
    """

    def __init__(self, file: Path, kind: str, config: SandboxConfig) -> None:
        place = _Place(os.path.realpath(file), kind, config)
        self._kind = kind
        self.folder, self._lock = temporary_folder("artiskill-")
        self.channel, theirs = socket.socketpair()
        self._temporary = os.path.join(self.folder, "tmp")
        self._listeners = ExitStack()
        os.mkdir(self._temporary)
        flags = subprocess._args_from_interpreter_flags()  # type: ignore[attr-defined]
        program = [sys.executable, *flags, "-P", sandbox_process.__file__, str(theirs.fileno())]
        try:
            with theirs:
                self.process = subprocess.Popen(
                    [*place.prefix(), *program],
                    cwd=place.working_folder(self._temporary),
                    env=place.variables(self._temporary),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    pass_fds=(theirs.fileno(),),
                )
        except BaseException:
            self.channel.close()
            self._remove_folder()
            raise
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self._relay = _Relay(self.process.stdout)
        spec = place.spec(self._temporary) | self._probes()
        with suppress(BrokenPipeError), self.process.stdin as stdin:  # it has just ended, which `ask` will find
            stdin.write(json.dumps(spec).encode())

    def _probes(self) -> dict[str, Any]:
        """Lay out what the process will try to reach."""
        secret, path = (os.path.join(self.folder, name) for name in ("secret", "socket"))
        Path(secret).write_text("a confined process cannot read this\n")
        names = [path, f"\0artiskill-{secrets.token_hex(8)}"] if sys.platform.startswith("linux") else [path]
        for name in names:
            listener = self._listeners.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
            with suppress(OSError):  # a path that is too long, by which nobody can connect
                listener.bind(name)
                listener.listen()
        listener = self._listeners.enter_context(socket.create_server(("127.0.0.1", 0)))
        return {"secret": secret, "evaluator": os.getpid(), "tcp": listener.getsockname()[1], "unix": names}

    def settled(self) -> None:
        """Take away what it has tried to reach."""
        self._listeners.close()

    def exit_code(self, limit_s: float) -> int:
        """Return its exit status, or minus the number of the signal that has ended it.

        Raises:
            subprocess.TimeoutExpired: it has not ended within the limit.
        """
        code = self.process.wait(limit_s)
        is_signal = self._kind == BUBBLEWRAP and code - _SIGNAL in signal.valid_signals()
        return _SIGNAL - code if is_signal else code

    def last_words(self) -> str:
        """Return the last line that it printed, when it has ended."""
        self._relay.join(_STARTING_S)
        return self._relay.last_line

    def end(self) -> None:
        """End it; later calls do nothing."""
        self.channel.close()
        self._listeners.close()
        self.process.kill()
        self.process.wait()
        self._relay.join(_ENDING_S)  # what it has started may hold its output where nothing confines it
        self._remove_folder()

    def _remove_folder(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1


class _Relay(threading.Thread):
    """Prints what a process prints, but for control characters, and no more than a person would read.

    Each line says whose it is, so that none is taken for the evaluator's.
    """

    def __init__(self, stream: IO[bytes]) -> None:
        super().__init__(daemon=True)
        self._stream, self._rest = stream, _MOST_OUTPUT
        self.last_line = ""
        self.start()

    def run(self) -> None:
        with self._stream:
            for line in iter(lambda: self._stream.readline(8192), b""):
                if self._rest > 0:
                    self._show(line.decode(errors="replace"))

    def _show(self, line: str) -> None:
        text = "".join(c for c in line if c.isprintable() or c in "\n\t")
        self.last_line = text.strip() or self.last_line
        self._rest -= len(text)
        shown = text if self._rest > 0 else "(what it prints from here on is not shown)"
        with suppress(OSError, ValueError):  # this process's own stream is closed
            sys.stderr.write(f"{_SAID}{shown.rstrip()}\n")
            sys.stderr.flush()


# -- what it may use ----------------------------------------------------------------------------------------------


class _Place:
    """What a process of a kind is started with: command, variables, folders.

    Args:
        file: the solution file, without links.
        kind: one of `SANDBOXES`.
        config: what was asked for.

    Raises:
        SandboxError: what this kind needs is not installed.
    """

    def __init__(self, file: str, kind: str, config: SandboxConfig) -> None:
        self._file, self._kind, self._config = file, kind, config
        self._is_confined = kind in (BUBBLEWRAP, LANDLOCK)
        paths = [os.path.abspath(path) for path in sys.path]
        own = os.path.dirname(file)
        here = os.path.realpath(os.getcwd())
        self._path = paths if kind == NONE else [path for path in paths if os.path.realpath(path) != here]
        self._own = file if _is_wide(own) else own
        kernels = kernel_folder()
        self._kernels = os.path.realpath(kernels) if kernels else ""  # it reads them, and writes nothing there
        if kind == BUBBLEWRAP and shutil.which("bwrap") is None:
            raise SandboxError("bwrap is not on the path; a system's package `bubblewrap` has it")
        if self._is_confined and not sys.platform.startswith("linux"):
            raise SandboxError(f"it needs Linux, not {sys.platform}")

    def working_folder(self, temporary: str) -> str | None:
        """Return where it begins: in the solution's folder, unless nothing confines it."""
        if self._kind == NONE:
            return None
        return temporary if self._own == self._file else self._own

    def variables(self, temporary: str) -> dict[str, str]:
        """Return its environment; sets of texts have one order in every run."""
        if self._kind == NONE:
            return {"PYTHONHASHSEED": "0"} | os.environ
        kept = {name: value for name, value in os.environ.items() if _KEPT_VARIABLES.fullmatch(name)}
        home = "/tmp" if self._kind == BUBBLEWRAP else temporary
        own = {"HOME": home, "TMPDIR": home, "USER": "solution", "LOGNAME": "solution"}
        own |= {"PYTHONDONTWRITEBYTECODE": "1", TOLD: self._kernels}
        return {"PYTHONHASHSEED": "0"} | kept | own

    def spec(self, temporary: str) -> dict[str, Any]:
        """Return what `sandbox_process` is told."""
        is_limited = self._kind != NONE
        return {
            "path": self._path,
            "program": solution_process.__file__,
            "own": self._file,
            "memory": int(self._config.memory_gb * _GB) if is_limited else None,
            "file_size": _FILE_SIZE,
            "landlock": self._landlock(temporary) if self._kind == LANDLOCK else None,
            "filter": self._is_confined,
            "is_namespace": self._kind == BUBBLEWRAP,
        }

    def prefix(self) -> list[str]:
        """Return the command that its own command is given to."""
        return self._bubblewrap() if self._kind == BUBBLEWRAP else []

    def _roots(self) -> list[str]:
        """Return all that it may read, besides the system's; none is in another."""
        programs = [sandbox_process.__file__, solution_process.__file__]
        prefixes = [sys.prefix, sys.base_prefix, sys.exec_prefix, sys.base_exec_prefix]
        found = [path for path in (*prefixes, *self._path) if not _is_wide(path)]
        found += [*_links(sys.executable), *programs, self._own, *map(os.path.abspath, self._config.readable)]
        found += [self._kernels] if self._kernels else []
        both = {path for one in found for path in (one, os.path.realpath(one)) if os.path.exists(path)}
        return [path for path in sorted(both) if not any(_is_inside(path, other) for other in both - {path})]

    def _hidden(self) -> list[str]:
        """Return what it may not read though it may lie in a folder that it may: report and caches."""
        from artiskill.assets.partnet.hull_cache import default_cache_dir  # slow: it has scipy loaded

        numba = os.environ.get("NUMBA_CACHE_DIR")
        asked = [*self._config.hidden, str(default_cache_dir()), *([numba] if numba else [])]
        return [path for path in map(os.path.realpath, asked) if os.path.exists(path)]

    def _landlock(self, temporary: str) -> dict[str, list[str]]:
        hidden, read, names = self._hidden(), [*_SYSTEM, *_SYSTEM_FILES, *_PROC_FILES], []
        for root in self._roots():
            found, listed = _cut(root, hidden)
            read += found
            names += listed
        gpus = _gpus()
        read += _GPU_FOLDERS if gpus else ()
        return {"read": read, "names": names, "write": [temporary, *_DEVICES, *gpus]}

    def _bubblewrap(self) -> list[str]:
        memory = ["--size", str(_FILE_SIZE), "--tmpfs"]
        gpus = _gpus()
        words = [*_BUBBLEWRAP, *memory, "/dev/shm", *memory, "/tmp"]
        for path in (*_SYSTEM, *_SYSTEM_FILES, *(_GPU_FOLDERS if gpus else ())):
            is_link = os.path.islink(path)
            words += ["--symlink", os.readlink(path), path] if is_link else ["--ro-bind-try", path, path]
        for path in gpus:
            words += ["--dev-bind-try", path, path]
        roots = [path for path in self._roots() if not any(_is_inside(path, one) for one in _SYSTEM)]
        for path in roots:
            words += ["--ro-bind", path, path]
        for path in self._hidden():
            if any(_is_inside(path, root) for root in roots):
                is_file = os.path.isfile(path)
                words += ["--ro-bind", "/dev/null", path] if is_file else ["--tmpfs", path, "--remount-ro", path]
        return [*words, "--remount-ro", "/", "--chdir", self.working_folder("/tmp") or "/", "--"]


def _is_inside(path: str, folder: str) -> bool:
    """Whether a path is a folder, or in it; both without links."""
    return path == folder or path.startswith(folder.rstrip("/") + "/")


def _is_wide(folder: str) -> bool:
    """Whether other people's and programs' files are in a folder: temporary ones, or homes."""
    folder = os.path.realpath(folder)
    shared = ("/tmp", "/var/tmp", "/dev/shm", tempfile.gettempdir(), os.path.expanduser("~"))
    return any(_is_inside(os.path.realpath(one), folder) for one in shared)


def _links(path: str) -> Iterable[str]:
    """Yield a file and all that its links lead to, one by one."""
    for _ in range(40):  # as many as the kernel follows
        yield path
        if not os.path.islink(path):
            return
        path = os.path.normpath(os.path.join(os.path.dirname(path), os.readlink(path)))


def _cut(root: str, hidden: Iterable[str]) -> tuple[list[str], list[str]]:
    """Return what is left of a folder without what is hidden in it, and folders of which the names are left."""
    inside = [path for path in hidden if _is_inside(path, root)]
    if not inside:
        return [root], []
    if root in inside:
        return [], []
    read, names = [], [root]
    for entry in os.scandir(root):
        if entry.is_symlink():  # leave to follow it would be leave for what it leads to
            continue
        found, listed = _cut(entry.path, inside)
        read += found
        names += listed
    return read, names


def _gpus() -> list[str]:
    return [path for pattern in _GPUS for path in glob.glob(pattern)]


@lru_cache(maxsize=1)
def _bubblewrap_version() -> str:
    said = subprocess.run(["bwrap", "--version"], capture_output=True, text=True, check=False).stdout
    return said.split()[-1] if said.split() else "unknown"
