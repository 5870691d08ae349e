"""What calls a solution's code, and the program of the process in which a solution file runs.

The program needs Python and NumPy and nothing of this package. `sandbox_process` starts it, with a socket; it is
sent the file's path, then observations, and answers each with an action. It is told neither object nor target nor
level, and seeds Python's and NumPy's global generators from the episode's number, which it counts itself.

A frame, in either direction, is a header and a content: a letter, three bytes that mean nothing, the number of the
content's bytes (four, in the machine's order), and these bytes. Every frame of the evaluator is answered by one.
This happens in every step, and finds the processor's caches full of the simulation: the less code, the faster.
"""

import dataclasses
import inspect
import json
import math
import os
import random
import signal
import socket
import struct
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

HEADER = struct.Struct("=cxxxI")  # as long as `ALIGNMENT`
# of the evaluator: what confines you; file; where arrays are in an observation; the first one, and a later one
CONFINE, START, LAYOUT, RESET, ACT = b"C", b"S", b"L", b"R", b"A"
# of the policy: what confines it; what it declares; all done; an action, float64; what went wrong
CONFINED, DECLARED, DONE, ACTION, FAULT = b"c", b"d", b"o", b"a", b"f"
ALIGNMENT = 8  # of the arrays in an observation, bytes
LEGAL_FORMS = (
    "a solution has either a function policy(observation) -> action "
    "or a class Policy with obs_mode, reset(observation, info) and act(observation)"
)
USER_POLICY = "UserPolicy"  # the class of a solution of 2021's benchmark
_MODULE = "artiskill_solution"
_MEMBERS = ("obs_mode", "reset", "act")
_DECLARATIONS = ("obs_mode", "control_mode", "sampling", "observation_config")
_MOST_TEXT, _MOST_TRACEBACK = 300, 8000  # characters of an error's message, and of its traceback


class SolutionError(Exception):
    """What a solution does wrong.

    Args:
        text: one line.
        line: of its file, where that is known.
    """

    def __init__(self, text: str, line: int | None = None) -> None:
        super().__init__(text)
        self.text, self.line = text, line


class SolutionCode:
    """A function or `Policy` object, called with care.

    Args:
        policy: either.
        file: in which a line is looked for where it raises; empty where none is known.

    Attributes:
        declared: what a `Policy` object says of itself, of `obs_mode`, `control_mode`, `sampling` and
            `observation_config`; None for a function.

    Raises:
        SolutionError: it is neither.
    """

    def __init__(self, policy: Any, file: str) -> None:
        missing = [member for member in _MEMBERS if not hasattr(policy, member)]
        if inspect.isclass(policy) or (missing and not (len(missing) == len(_MEMBERS) and callable(policy))):
            what = "is a class, not an object of it" if inspect.isclass(policy) else f"lacks {', '.join(missing)}"
            raise SolutionError(f"the policy {what}; {LEGAL_FORMS}")
        self._file, self._reset = file, None
        self.declared: dict[str, Any] | None = None
        self._act, self._act_name = policy, getattr(policy, "__name__", "the policy")
        if not missing:
            for member in ("reset", "act"):
                if not callable(getattr(policy, member)):
                    raise SolutionError(f"{member} cannot be called; {LEGAL_FORMS}")
            self.declared = {name: getattr(policy, name) for name in _DECLARATIONS if hasattr(policy, name)}
            self._reset, self._act, self._act_name = policy.reset, policy.act, "act"

    def reset(self, observation: Any, info: dict[str, Any], seed: int) -> None:
        """Begin an episode; Python's and NumPy's global generators then start from the seed.

        Raises:
            SolutionError: `reset` raises.
        """
        random.seed(seed)
        np.random.seed(seed)  # noqa: NPY002 - for solutions that draw from it
        if self._reset is not None:
            reset: Callable[..., Any] = self._reset
            guarded(lambda: reset(observation, info), self._file, "reset() raised")

    def act(self, observation: Any, size: int) -> np.ndarray:
        """Return the next action, (size,) float64 and finite.

        Raises:
            SolutionError: `act` raises, or what it returns is no legal action.
        """
        try:
            action = self._act(observation)
        except BaseException as error:
            raise fault(error, self._file, f"{self._act_name}() raised") from error
        try:
            array = np.asarray(action, dtype=np.float64)
        except Exception as error:  # what a foreign type raises when it is no array cannot be listed
            given = f"{type(action).__name__}, not an array ({_one_line(error)})"
            raise SolutionError(self._illegal(given, size)) from error
        if action is None or array.shape != (size,) or not np.logical_and.reduce(np.isfinite(array)):
            raise SolutionError(self._illegal(_describe(action, array, size), size))
        return array

    def _illegal(self, given: str, size: int) -> str:
        return f"{self._act_name}() returned {given}; an action is {size} finite numbers in [-1, 1]"


def _describe(action: Any, array: np.ndarray, size: int) -> str:
    if action is None:
        return "None"
    if array.shape != (size,):
        return f"shape {array.shape}"
    bad = np.flatnonzero(~np.isfinite(array)).tolist()
    return f"{array[bad].tolist()} in entries {bad}"


def guarded(call: Callable[[], Any], file: str, what: str) -> Any:
    """Return the call's result.

    Raises:
        SolutionError: it raises anything; with the line in the file.
        KeyboardInterrupt: Ctrl-C, in a process that it reaches.
    """
    try:
        return call()
    except BaseException as error:
        raise fault(error, file, what) from error


def fault(error: BaseException, file: str, what: str) -> SolutionError:
    """Return what came out of foreign code, `sys.exit()` included, as a fault of it.

    Raises:
        KeyboardInterrupt: it is one, in a process that Ctrl-C reaches.
    """
    if isinstance(error, KeyboardInterrupt) and signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        raise error
    return SolutionError(f"{what} {_one_line(error)}", _line_of(error, file))


def _line_of(error: BaseException, file: str) -> int | None:
    """Return the last line of the file in the error's traceback."""
    if isinstance(error, SyntaxError) and error.filename == file:
        return error.lineno
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return frames[-1].lineno if frames else None


def _one_line(error: BaseException) -> str:
    """Return `ValueError: its message`, shortened."""
    says = error.msg if isinstance(error, SyntaxError) else str(error)
    says = " ".join(says.split())
    says = says if len(says) <= _MOST_TEXT else says[: _MOST_TEXT - 3] + "..."
    return f"{type(error).__name__}: {says}" if says else type(error).__name__


def load_solution(file: str, user_policy: dict[str, Any] | None = None) -> SolutionCode:
    """Run a solution file and take its policy; the file's folder joins `sys.path`, as for any Python script.

    Args:
        file: its path.
        user_policy: if it may be one of 2021, the source text of `compat.user_policy`, and `about` the task.

    Raises:
        SolutionError: the file does not import, has neither or both of the legal forms, or its `Policy` cannot be
            constructed or lacks something.
    """
    compat = None if user_policy is None else _compat_module(user_policy)
    module = _import_file(file)
    function, policy_class = getattr(module, "policy", None), getattr(module, "Policy", None)
    if function is None and policy_class is None and compat is not None and hasattr(module, USER_POLICY):
        return _of_2021(module, compat, file)
    if function is None and policy_class is None:
        near = [key for key in vars(module) if key.lower() == "policy"]
        has = f" (it has {near[0]!r})" if near else ""
        raise SolutionError(f"it has neither 'policy' nor 'Policy'{has}; {LEGAL_FORMS}")
    if function is not None and policy_class is not None:
        raise SolutionError(f"it has both 'policy' and 'Policy'; keep one of them ({LEGAL_FORMS})")
    if policy_class is None:
        if inspect.isclass(function) or not callable(function):
            raise SolutionError(f"'policy' is {type(function).__name__!r}, not a function; {LEGAL_FORMS}")
        found = SolutionCode(lambda observation: function(observation), file)
        found._act_name = "policy"
        return found
    if not inspect.isclass(policy_class):
        raise SolutionError(f"'Policy' is {type(policy_class).__name__!r}, not a class; {LEGAL_FORMS}")
    return SolutionCode(guarded(policy_class, file, "Policy() raised"), file)


def _compat_module(user_policy: dict[str, Any]) -> Any:
    """Return `compat.user_policy`, after it has prepared what a file of 2021 imports."""
    compat: Any = ModuleType("artiskill_user_policy")
    exec(compile(user_policy["source"], "user_policy.py", "exec"), vars(compat))
    compat.install(user_policy["about"])
    compat.env_name = user_policy["about"]["env_name"]
    return compat


def _of_2021(module: ModuleType, compat: Any, file: str) -> SolutionCode:
    """Return a file's `UserPolicy(env_name)`, called as it was in 2021."""
    make = vars(module)[USER_POLICY]
    return SolutionCode(
        guarded(lambda: compat.Adapter(make(compat.env_name)), file, f"{USER_POLICY}() raised"), file
    )


def _import_file(file: str) -> ModuleType:
    folder = os.path.dirname(os.path.realpath(file))
    if folder not in sys.path:
        sys.path.insert(0, folder)
    module = ModuleType(_MODULE)
    module.__file__ = file
    sys.modules[_MODULE] = module  # dataclasses and pickling look their module up

    def run() -> None:
        with open(file, "rb") as opened:
            source = opened.read()
        exec(compile(source, file, "exec"), module.__dict__)

    guarded(run, file, "cannot be imported:")
    return module


# -- the process --------------------------------------------------------------------------------------------------


def main(handle: int, confined: bytes) -> None:
    """Load a solution file and let it act, until the evaluator leaves.

    Args:
        handle: of a socket.
        confined: how this process is confined, as the evaluator is told.
    """
    channel = socket.socket(fileno=handle)
    try:
        _serve(channel, confined)
    except SolutionError as fault:
        lines = traceback.format_exception(fault.__cause__ or fault)
        said = {"text": fault.text, "line": fault.line, "traceback": "".join(lines)[-_MOST_TRACEBACK:]}
        with suppress(OSError):
            _send(channel, FAULT, json.dumps(said).encode())
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass


def _serve(channel: socket.socket, confined: bytes) -> None:
    os.set_inheritable(channel.fileno(), False)
    _receive(channel)
    _send(channel, CONFINED, confined)
    job = json.loads(_receive(channel)[1][HEADER.size :])
    random.seed(0)
    np.random.seed(0)  # noqa: NPY002 - for solutions that draw from it
    code = load_solution(job["file"], job["user_policy"])
    _send(channel, DECLARED, json.dumps(code.declared, default=_plain).encode())
    layout: list[_Place] = []
    size, episode, most_bytes = 0, 0, 0
    while True:
        kind, frame = _receive(channel, most_bytes)
        if kind == ACT:
            _send(channel, ACTION, code.act(_observation(frame, layout), size).tobytes())
        elif kind == LAYOUT:
            arrays, size = json.loads(frame[HEADER.size :])
            layout, most_bytes = _places(arrays)
            _send(channel, DONE, b"")
        else:
            code.reset(_observation(frame, layout), {"episode": episode}, episode)
            episode += 1
            _send(channel, DONE, b"")


class _Place(NamedTuple):
    """Where an array of the observation stands in a frame's content: `offset` bytes from its beginning."""

    keys: list[str]
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    entries: int
    offset: int


def _places(arrays: list[tuple[list[str], str, list[int]]]) -> tuple[list[_Place], int]:
    """Return where arrays stand, and how many bytes they take."""
    places, offset = [], 0
    for keys, name, shape in arrays:
        dtype, entries = np.dtype(name), math.prod(shape)
        places.append(_Place(keys, dtype, tuple(shape), entries, offset))
        offset += -(-entries * dtype.itemsize // ALIGNMENT) * ALIGNMENT
    return places, offset


def _plain(value: Any) -> Any:
    """Return a declared value as JSON has it; what no JSON can hold as text, which the evaluator refuses."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return dataclasses.asdict(value)
    return value.item() if isinstance(value, np.generic) else repr(value)


def _observation(frame: bytearray, layout: list[_Place]) -> Any:
    """Return the observation in a frame, whose arrays may be written to."""
    found: dict[str, Any] = {}
    for place in layout:
        array = np.frombuffer(frame, place.dtype, place.entries, HEADER.size + place.offset).reshape(place.shape)
        if not place.keys:
            return array
        level = found
        for key in place.keys[:-1]:
            level = level.setdefault(key, {})
        level[place.keys[-1]] = array
    return found


def _receive(channel: socket.socket, likely_bytes: int = 0) -> tuple[bytes, bytearray]:
    """Return a frame's letter, and the frame, header included.

    Args:
        channel: to the evaluator, which sends one frame and waits.
        likely_bytes: of its content; a frame that is no longer comes in one piece.
    """
    frame = bytearray(HEADER.size + likely_bytes)
    found = _read(channel, frame, 0, HEADER.size)
    kind, length = HEADER.unpack_from(frame)
    if length != likely_bytes:
        frame = frame[: HEADER.size + length].ljust(HEADER.size + length)
    _read(channel, frame, found, len(frame))
    return kind, frame


def _read(channel: socket.socket, frame: bytearray, found: int, wanted: int) -> int:
    """Fill a frame on from `found` bytes until it has those wanted, or more, and return how many it has."""
    while found < wanted:
        got = channel.recv_into(memoryview(frame)[found:] if found else frame)
        if not got:
            raise EOFError
        found += got
    return found


def _send(channel: socket.socket, kind: bytes, body: bytes) -> None:
    channel.sendall(HEADER.pack(kind, len(body)) + body)
