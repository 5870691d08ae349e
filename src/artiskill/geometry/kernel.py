"""How all kernels are compiled: called from Python as functions of their own, called from kernels as subroutines.

Numba optimises every function together with all that it calls, and makes machine code of both, before it does so
again for the caller: what lies ten calls deep goes through LLVM ten times. Here only the outermost kernel is made
into machine code. A subroutine is compiled to types and LLVM code once, and linked into those that call it. This,
and no wrappers to be called from Python, halve the time.

Numba counts references to an array, at each name that it is given and each call: in a structure of arrays, to each
of them. A kernel that makes no arrays needs none of that: whoever called it from Python holds all that it sees.
That is a tenth of the time.

This follows Numba's "Customizing the compiler" (https://numba.readthedocs.io/en/stable/extending), but for
`JITCodeLibrary`, which is internal.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import _dynfunc, njit, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.errors import TypingError
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import NativeLowering, NopythonTypeInference

from artiskill.geometry.kernel_cache import keep_compiled

Array = np.ndarray
Point = tuple[float, float, float]

F = TypeVar("F", bound=Callable[..., object])

# functions in a module. With all parts optimised, the first point cloud takes 1.2 s longer; with none, 0.6 s less,
# but drawing takes 3 to 10 % longer
_LARGE = 12


def kernel(function: F) -> F:
    """Compile on first use, keep on disk, release the GIL.

    No `fastmath`: sums keep their order, so that all processors with FMA give the same pixels. Division by zero
    gives an infinity, as in NumPy; whoever divides must be ready for it. Arrays are the caller's; a kernel that
    makes one is an `allocating_kernel`, one that returns some of those that it was given a `structure_kernel`.
    """
    return _compile(function, _OutermostCompiler, _nrt=False)


def structure_kernel(function: F) -> F:
    """Compile a kernel that returns parts of its arguments; references are counted if Python calls it."""
    return _compile(function, _nrt=False)


def allocating_kernel(function: F) -> F:
    """Compile a kernel that makes arrays: it counts references to arrays, and frees them."""
    return _compile(function, _nrt=True)


def inlined_kernel(function: F) -> F:
    """Compile a kernel into whoever calls it.

    For small kernels that are called often and take arrays: an array is handed over as ten numbers, so that a call
    may take longer than the work.
    """
    return _compile(function, _OutermostCompiler, _nrt=False, forceinline=True)


def _compile(function: F, outermost: type[CompilerBase] = Compiler, **options: bool) -> F:
    for_python = {**options, "_nrt": outermost is Compiler, "pipeline_class": outermost}
    called: Any = njit(nogil=True, error_model="numpy", no_cfunc_wrapper=True, **for_python)(function)
    if called is function:  # NUMBA_DISABLE_JIT
        return function
    keep_compiled(called)
    within: Any = njit(
        nogil=True,
        error_model="numpy",
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        pipeline_class=_SubroutineCompiler,
        **options,
    )(function)

    def get_call_template(args: Any, kws: Any) -> Any:
        # not once for each number that is written out in a call
        found = within.get_call_template([types.unliteral(kind) for kind in args], kws)
        _check_counted_alike(within, found[2])
        return found

    # what Numba asks of a function that is called in one that it compiles
    called.get_call_template, called.get_overload = get_call_template, within.get_overload
    called.within = within
    kernel_function: F = called
    return kernel_function


def _check_counted_alike(called: Any, args: Any) -> None:
    """Refuse a call that returns arrays where only one side counts references: they would leak, or be freed."""
    returned = called.overloads[tuple(args)].signature.return_type
    has_arrays = _has_arrays(called.targetdescr.target_context, returned)
    if has_arrays and called.targetoptions["_nrt"] != ConfigStack.top_or_none().nrt:
        name = called.py_func.__name__
        raise TypingError(f"{name} returns arrays: it and its caller must both be allocating kernels, or neither")


def _has_arrays(context: Any, kind: Any) -> bool:
    holds: bool = context.data_model_manager[kind].contains_nrt_meminfo()
    return holds


@register_pass(mutates_CFG=False, analysis_only=True)
class _RefuseArrays(AnalysisPass):
    _name = "refuse_arrays"

    def __init__(self) -> None:
        AnalysisPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Refuse to give Python an array to which no reference was counted."""
        if _has_arrays(state.targetctx, state.return_type):
            name = state.func_id.func_name
            raise TypingError(f"{name} returns arrays: it must be an allocating_kernel or a structure_kernel")
        return False


class _OutermostCompiler(CompilerBase):
    """Numba's compiler, for functions that return no arrays."""

    def define_pipelines(self) -> list[Any]:
        """Return the usual passes, with a look at what is returned."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_RefuseArrays, NopythonTypeInference)
        passes.finalize()
        return [passes]


class _SubroutineCompiler(CompilerBase):
    """Numba's compiler with another last step."""

    def define_pipelines(self) -> list[Any]:
        """Return the usual passes, with lowering replaced."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_SubroutineLowering, NativeLowering)
        passes.passes = [(kind, why) for kind, why in passes.passes if kind is not NativeLowering]
        passes.finalize()
        return [passes]


class _SubroutineLibrary(JITCodeLibrary):
    """LLVM code to be linked into that of others; each function in it is simplified, the whole is left to them."""

    def _optimize_final_module(self) -> None:
        """Optimise small parts, which hold the inner loops; large ones are left to the outermost kernel."""
        defined = [function for function in self._final_module.functions if not function.is_declaration]
        if len(defined) < _LARGE:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        """Do without the engine, which would make machine code."""
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _SubroutineLowering(NativeLowering):
    _name = "subroutine_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower into a library of the kind above, and tell Numba where the function is to be found."""
        state.library = _SubroutineLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags = state.flags.copy()
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        module, name = lowered.fndesc.lookup_module(), lowered.fndesc.qualname.split(".")[-1]
        # by this function, which cannot be called, Numba knows the code
        key = _dynfunc.make_function(module, name, "compiled subroutine", 0, lowered.env, (state.library,))
        state.targetctx.insert_user_function(key, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=key)
        return True
