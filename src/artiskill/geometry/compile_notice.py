"""The one line that says why nothing seems to happen: kernels are being compiled."""

import hashlib
import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

PATIENCE_S = 1.0
# of the time that the functions take: what it takes besides to optimise all of them together
_LAST_STEP = 1.3
# done before an estimate makes sense
_LEAST_SHARE = 0.1
# what is over sooner is not worth a line
_SHORT_S = 4.0
# names this process and all that it starts, which find it there: they are told once
_TREE = os.environ.setdefault("ARTISKILL_PROCESS_TREE", f"{os.getpid()}-{time.time_ns():x}")
_said = False


@contextmanager
def announced(kernel: Any, folder: Path | None) -> Iterator[None]:
    """Write a line on standard error if the body takes longer than `PATIENCE_S`, and will take some more.

    Once for this process and all that it starts, whose compilers wait for one another.

    Args:
        kernel: what the body compiles, a dispatcher.
        folder: where it is kept, if anywhere.
    """
    functions = _functions_within(kernel)
    start, before = time.perf_counter(), _compiled(functions)

    done = threading.Event()

    def watch() -> None:
        while not done.wait(PATIENCE_S):
            elapsed = time.perf_counter() - start
            share = max((_compiled(functions) - before) / max(len(functions) - before, 1), _LEAST_SHARE)
            seconds = _LAST_STEP * elapsed / share
            if seconds > _SHORT_S and (share > _LEAST_SHARE or elapsed > _SHORT_S):
                _say_once(seconds, folder)
                return

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        done.set()


def do_not_announce() -> None:
    """Say nothing in this process, which tells by itself what it is doing."""
    global _said
    _said = True


def _say_once(seconds: float, folder: Path | None) -> None:
    global _said
    if _said or (folder is not None and not _is_first(folder)):
        return
    _said = True
    kept = "again each time: no cache can be written" if folder is None else f"once: kept in {folder}"
    line = f"artiskill: compiling kernels for this processor, about {seconds:.0f} s ({kept}"
    sys.stderr.write(f"{line}; `artiskill warm` does it ahead)\n")
    sys.stderr.flush()


def _is_first(folder: Path) -> bool:
    """Whether no other process of the tree has said it: whoever has made the tree's file in the folder says it."""
    tree = hashlib.sha256(_TREE.encode()).hexdigest()[:16]
    try:
        (folder / f"told-{tree}").open("x").close()
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


def _compiled(functions: list[Any]) -> int:
    return len([function for function in functions if function.within.overloads])
