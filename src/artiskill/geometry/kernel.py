"""How all kernels are compiled, and how their compiled code is kept on disk."""

import contextlib
import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
from numba import njit

Array = np.ndarray
Point = tuple[float, float, float]

F = TypeVar("F", bound=Callable[..., object])

_PACKAGE = Path(__file__).parents[1]
# what a source of compiled code contains
_MARKERS = (b"@kernel", b"@inlined_kernel", b"@intrinsic")


def kernel(function: F) -> F:
    """Compile on first use, keep on disk, release the GIL.

    No `fastmath`: sums keep their order, so that all processors with FMA give the same pixels. Division by zero
    gives an infinity, as in NumPy; whoever divides must be ready for it.
    """
    compiled: F = njit(cache=True, nogil=True, error_model="numpy")(function)
    return compiled


def inlined_kernel(function: F) -> F:
    """A kernel that becomes part of whoever calls it.

    For small kernels that are called often and take arrays: an array is handed over as ten numbers, so that a call
    may take longer than the work.
    """
    compiled: F = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)(function)
    return compiled


def drop_stale_code(package: Path) -> bool:
    """Delete compiled kernels if any kernel's source has changed since they were compiled.

    Numba looks at the file of the called kernel only. Code taken in from kernels of other files would stay old
    after an edit or a `git pull`.

    Args:
        package: folder whose sources and `__pycache__` folders are looked at.

    Returns:
        Whether sources were new. Folders that cannot be written to are left alone: there Numba keeps its code
        elsewhere, and an installer renews all files at once.
    """
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        text = path.read_bytes()
        if any(marker in text for marker in _MARKERS):
            digest.update(str(path.relative_to(package)).encode() + b"\0" + text)
    stamp = package / "__pycache__" / "kernels.sha256"
    with contextlib.suppress(OSError):
        if stamp.exists() and stamp.read_text(encoding="ascii") == digest.hexdigest():
            return False
        for compiled in package.rglob("__pycache__/*.nb[ic]"):
            compiled.unlink(missing_ok=True)
        stamp.parent.mkdir(exist_ok=True)
        temporary = stamp.with_suffix(f".{os.getpid()}")
        temporary.write_text(digest.hexdigest(), encoding="ascii")
        temporary.replace(stamp)
        return True
    return False


drop_stale_code(_PACKAGE)
