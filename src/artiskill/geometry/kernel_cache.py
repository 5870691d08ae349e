"""Where compiled kernels are kept, and the line on standard error that says that they are being compiled.

A folder holds the code of one state of the sources: its name is a digest of all kernels and of the versions that
compile them, so that nothing in it is ever out of date, whichever file was changed. (Numba itself looks only at
the file of the called kernel.) Files are replaced whole, and of several processes that need the same kernel one
compiles it; the others wait and load.
"""

import contextlib
import fcntl
import functools
import gc
import hashlib
import os
import platform
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import llvmlite
import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.compiler_lock import global_compiler_lock

_PACKAGE = Path(__file__).parents[1]
# what a source of compiled code contains
_KINDS = (b"@kernel", b"@inlined_kernel", b"@structure_kernel", b"@allocating_kernel")
_MARKERS = (*_KINDS, b"@intrinsic", b"_SubroutineLowering")
# names the folder that a process is told to read: it has another home, or may not write to this one
TOLD = "ARTISKILL_KERNELS"
# folders of other states of the sources that are kept: of other environments, other branches
_OTHERS_KEPT = 7
# a process that compiles for longer than this was stopped, or its machine is: others stop waiting
_LONGEST_WAIT_S = 180.0
_POLL_S = 0.05

# from one look at how far a compilation is to the next; what takes less than the second figure gets no line
CHECK_EVERY_S, SHORT_S = 1.0, 4.0
# of the time that the functions take: what it takes besides to optimise all of them together
_LAST_STEP = 1.3
# done before an estimate makes sense
_LEAST_SHARE = 0.1
# names this process and all that it starts, which find it there: the line is printed once for all of them
_TREE = os.environ.setdefault("ARTISKILL_PROCESS_TREE", f"{os.getpid()}-{time.time_ns():x}")
_announced = False


def keep_compiled(kernel: Any) -> None:
    """Keep what Numba compiles of a function (a dispatcher) in the folder, and say so while it compiles.

    Functions of others, whose sources the folder's name does not know, are compiled in every process.
    """
    if kernel.py_func.__module__.split(".")[0] != _PACKAGE.name:
        return
    folder = kernel_folder()
    compile_now = kernel.compile
    if _folder_to_read() is None:

        def compile_once(signature: Any) -> Any:
            with _compiling(kernel, None):
                return compile_now(signature)

    else:
        kernel._cache = cache = _KernelCache(kernel.py_func)

        def compile_once(signature: Any) -> Any:
            with global_compiler_lock, ExitStack() as until_compiled:
                cache.when_missing = lambda: until_compiled.enter_context(_compiling(kernel, folder))
                return compile_now(signature)

    kernel.compile = compile_once


@functools.cache
def kernel_folder() -> Path | None:
    """Return the folder of compiled kernels, made if need be; None where nothing can be written.

    It lies in the first that can be written to of `$NUMBA_CACHE_DIR`, `$XDG_CACHE_HOME/artiskill` or
    `~/.cache/artiskill`, and the package's own `__pycache__`. A process that is told a folder (`TOLD`) tries that
    first.
    """
    digest = _own_digest()
    home = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    roots = [home / "artiskill", _PACKAGE / "__pycache__"]
    if numba.config.CACHE_DIR:
        roots.insert(0, Path(numba.config.CACHE_DIR))
    told = _told_folder()
    for folder in [*([told] if told else []), *(root / "kernels" / digest for root in roots)]:
        with contextlib.suppress(OSError):
            if not folder.is_dir():
                folder.mkdir(parents=True, exist_ok=True)
                _delete_oldest(folder)
            tempfile.TemporaryFile(dir=folder).close()
            os.utime(folder)
            return folder
    return None


@functools.cache
def _own_digest() -> str:
    return sources_digest(_PACKAGE)


def _told_folder() -> Path | None:
    """Return the folder that this process is told, if it is of these sources."""
    told = Path(os.environ.get(TOLD, ""))
    return told if told.name == _own_digest() and told.is_dir() else None


@functools.cache
def _folder_to_read() -> Path | None:
    """Return the folder that compiled kernels are read from, also where nothing can be written."""
    return kernel_folder() or _told_folder()


def has_compiled(module: str) -> bool:
    """Return whether kernels of a module are kept; true also where none could be, or none are compiled."""
    folder = None if numba.config.DISABLE_JIT else kernel_folder()
    return folder is None or any(folder.glob(f"*-{module}-*.nbi"))


def sources_digest(package: Path) -> str:
    """Return a digest of all sources of compiled code and of the versions that compile them."""
    versions = platform.python_implementation(), platform.python_version(), numba.__version__, llvmlite.__version__
    digest = hashlib.sha256(repr(versions).encode())
    for path in sorted(package.rglob("*.py")):
        text = path.read_bytes()
        if any(marker in text for marker in _MARKERS):
            digest.update(str(path.relative_to(package)).encode() + b"\0" + text)
    return digest.hexdigest()[:16]


def _delete_oldest(newest: Path) -> None:
    """Delete the folders beside this one that were not used for longest."""
    others = [path for path in newest.parent.iterdir() if path.is_dir() and path != newest]
    others.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    for path in others[_OTHERS_KEPT:]:
        shutil.rmtree(path, ignore_errors=True)


class _Locator:
    """Where the code of one function is kept, in Numba's terms."""

    def __init__(self, function: Callable[..., object], path: str) -> None:
        self._place = f"{function.__module__}-{function.__code__.co_firstlineno}"

    @classmethod
    def from_function(cls, function: Callable[..., object], path: str) -> "_Locator":
        return cls(function, path)

    def ensure_cache_path(self) -> None:
        Path(self.get_cache_path()).mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        return str(_folder_to_read())

    def get_source_stamp(self) -> str:
        return ""  # the folder's name says it

    def get_disambiguator(self) -> str:
        return self._place


class _CacheFiles(CompileResultCacheImpl):
    _locator_classes = (_Locator,)


class _KernelCache(FunctionCache):
    """Numba's cache of one function, for several processes at a time and for damaged files and full disks."""

    _impl_class = _CacheFiles
    when_missing: Callable[[], object] = staticmethod(lambda: None)

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Return what is kept; if it is missing, wait for whoever else compiles it."""
        found = self._load(signature, target_context)
        if found is None:
            self.when_missing()
            found = self._load(signature, target_context)
        return found

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep it if there is space; it works without."""
        with contextlib.suppress(OSError):
            try:
                super().save_overload(signature, data)
            except Exception:  # a damaged index can raise anything
                self.flush()
                super().save_overload(signature, data)

    def _load(self, signature: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(signature, target_context)
        except Exception:  # a damaged file can raise anything; it is written anew
            return None


@contextmanager
def _compiling(kernel: Any, folder: Path | None) -> Iterator[None]:
    """Compile in the body: one process at a time, and saying so if it takes long."""
    collecting = gc.isenabled()
    gc.disable()  # a compiler makes little garbage and much that is looked through in vain: a tenth of the time
    try:
        with _announced_if_long(kernel, folder), _locked(folder, kernel.py_func):
            yield
    finally:
        if collecting:
            gc.enable()


@contextmanager
def _locked(folder: Path | None, function: Callable[..., object]) -> Iterator[None]:
    """Hold a lock that ends with the process, however that ends; go on without where there are none."""
    handle = None
    with contextlib.suppress(OSError):
        if folder is not None:
            path = folder / f"{function.__module__}.{function.__name__}.lock"
            handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            _wait_for(handle)
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


def _wait_for(handle: int) -> None:
    """Lock a file, unless that takes too long."""
    deadline = time.monotonic() + _LONGEST_WAIT_S
    while time.monotonic() < deadline:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            time.sleep(_POLL_S)


@contextmanager
def _announced_if_long(kernel: Any, folder: Path | None) -> Iterator[None]:
    """Print a line on standard error if the body, which compiles a kernel, will take long.

    Once for this process and all that it starts, whose compilers wait for one another.
    """
    functions = _functions_within(kernel)
    start, before = time.perf_counter(), _count_compiled(functions)
    done = threading.Event()

    def watch() -> None:
        while not done.wait(CHECK_EVERY_S):
            elapsed = time.perf_counter() - start
            share = max((_count_compiled(functions) - before) / max(len(functions) - before, 1), _LEAST_SHARE)
            seconds = _LAST_STEP * elapsed / share
            if seconds > SHORT_S and (share > _LEAST_SHARE or elapsed > SHORT_S):
                _announce_once(seconds, folder)
                return

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        done.set()


def do_not_announce() -> None:
    """Print no line in this process, which says by itself what it is doing."""
    global _announced
    _announced = True


def _announce_once(seconds: float, folder: Path | None) -> None:
    global _announced
    if _announced or (folder is not None and not _is_first(folder)):
        return
    _announced = True
    again = "again each time: no cache can be written"
    if _folder_to_read() is not None:
        again = "again each time: this process may keep none; `artiskill warm` keeps them"
    how_often = again if folder is None else f"once: kept in {folder}; `artiskill warm` does it ahead"
    line = f"artiskill: compiling kernels for this processor, about {seconds:.0f} s for the first ({how_often})"
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def _is_first(folder: Path) -> bool:
    """Return whether no other process of the tree has announced it: the first one makes the tree's file."""
    tree = hashlib.sha256(_TREE.encode()).hexdigest()[:16]
    try:
        (folder / f"announced-{tree}").open("x").close()
    except FileExistsError:
        return False
    except OSError:  # better twice than never
        pass
    return True


def _functions_within(kernel: Any) -> list[Any]:
    """List all kernels that become part of this one, itself too."""
    found: dict[int, Any] = {id(kernel): kernel}
    pending = [kernel]
    while pending:
        function = pending.pop().py_func
        for name in function.__code__.co_names:
            called = function.__globals__.get(name)
            if hasattr(called, "within") and id(called) not in found:
                found[id(called)] = called
                pending.append(called)
    return list(found.values())


def _count_compiled(functions: list[Any]) -> int:
    return len([function for function in functions if function.within.overloads])
