"""How all kernels are compiled."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import njit

from artiskill.geometry.kernel_cache import keep_compiled
from artiskill.geometry.subroutine import SubroutineCompiler

Array = np.ndarray
Point = tuple[float, float, float]

F = TypeVar("F", bound=Callable[..., object])


def kernel(function: F) -> F:
    """Compile on first use, keep on disk, release the GIL.

    No `fastmath`: sums keep their order, so that all processors with FMA give the same pixels. Division by zero
    gives an infinity, as in NumPy; whoever divides must be ready for it.

    Called from Python, it is compiled with all that it calls and kept, see `kernel_cache`. Called from another
    kernel, it becomes part of that one's machine code and gets none of its own, see `subroutine`.
    """
    return _compiled(function)


def inlined_kernel(function: F) -> F:
    """A kernel that becomes part of whoever calls it.

    For small kernels that are called often and take arrays: an array is handed over as ten numbers, so that a call
    may take longer than the work.
    """
    return _compiled(function, forceinline=True)


def _compiled(function: F, **options: bool) -> F:
    called: Any = njit(nogil=True, error_model="numpy", **options)(function)
    if called is function:  # NUMBA_DISABLE_JIT
        return function
    keep_compiled(called)
    within: Any = njit(
        nogil=True,
        error_model="numpy",
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        pipeline_class=SubroutineCompiler,
        **options,
    )(function)
    # what Numba asks of a function that is called in one that it compiles
    called.get_call_template, called.get_overload = within.get_call_template, within.get_overload
    called.within = within
    kernel_function: F = called
    return kernel_function
