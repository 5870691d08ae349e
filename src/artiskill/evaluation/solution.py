"""Solution files: a participant's Python file becomes a policy whose every fault is one clear `PolicyError`.

A fault of a solution must look like one: the message names the file, the line, what was raised or returned, the
object, the level and the step, and never shows the benchmark's own frames.
"""

import inspect
import random
import signal
import sys
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from artiskill.config import from_mapping, to_mapping
from artiskill.envs.control import CONTROL_MODES, JOINT
from artiskill.envs.options import OBSERVATION_MODES
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ArtiSkillError, PolicyError, UnknownNameError, shown
from artiskill.files import read_bytes

LEGAL_FORMS = (
    "a solution has either a function policy(observation) -> action "
    "or a class Policy with obs_mode, reset(observation, info) and act(observation)"
)
_MODULE = "artiskill_solution"
_MEMBERS = ("obs_mode", "reset", "act")
_SEEN = ("cameras", "render")  # sections of a task's configuration that change what is seen, nothing else


class Solution:
    """A function or `Policy` object, called with care.

    Args:
        name: of the file, for messages and reports.
        reset: (observation, info) -> anything; None if there is nothing to reset.
        act: (observation) -> action.
        obs_mode: the observation mode that it needs; None if any will do.
        act_name: how the author calls `act`.
        control_mode: the control mode that its actions are of; None if they may be of any.
        sampling: of the clouds that it sees; None for the full ones.
        observation_config: values of the task's `cameras` and `render` that it needs; None for the task's.
    """

    def __init__(
        self,
        name: str,
        reset: Callable[[Any, dict[str, Any]], Any] | None,
        act: Callable[[Any], Any],
        obs_mode: str | None,
        act_name: str,
        control_mode: str | None = None,
        sampling: Sampling | None = None,
        observation_config: Mapping[str, Any] | None = None,
    ) -> None:
        self.name, self.obs_mode, self.control_mode, self.sampling = name, obs_mode, control_mode, sampling
        self.observation_config = observation_config
        self._reset, self._act, self._act_name = reset, act, act_name
        self._where, self._step = "", 0

    @classmethod
    def of_object(cls, policy: Any, name: str | None = None) -> "Solution":
        """Wrap a function or an object with `obs_mode`, `reset` and `act`, and what else a policy may declare.

        Raises:
            PolicyError: it is neither, or its `obs_mode` or `control_mode` is unknown, or what it asks of
                observations illegal.
        """
        name = name or str(getattr(policy, "__name__", type(policy).__name__))
        missing = [member for member in _MEMBERS if not hasattr(policy, member)]
        if inspect.isclass(policy) or (missing and not (len(missing) == len(_MEMBERS) and callable(policy))):
            what = "is a class, not an object of it" if inspect.isclass(policy) else f"lacks {', '.join(missing)}"
            raise PolicyError(f"{name}: the policy {what}; {LEGAL_FORMS}")
        if missing:
            return cls(name, None, policy, None, getattr(policy, "__name__", "the policy"))
        for member in ("reset", "act"):
            if not callable(getattr(policy, member)):
                raise PolicyError(f"{name}: {member} cannot be called; {LEGAL_FORMS}")
        control_mode = getattr(policy, "control_mode", JOINT)
        if policy.obs_mode not in OBSERVATION_MODES:
            raise PolicyError(f"{name}: {UnknownNameError('obs_mode', policy.obs_mode, OBSERVATION_MODES)}")
        if control_mode not in (None, *CONTROL_MODES):
            raise PolicyError(f"{name}: {UnknownNameError('control_mode', control_mode, CONTROL_MODES)}")
        sampling = _sampling_of(policy, name)
        asked = _observation_config_of(policy, name)
        return cls(name, policy.reset, policy.act, policy.obs_mode, "act", control_mode, sampling, asked)

    def reset(self, observation: Any, info: dict[str, Any]) -> None:
        """Begin an episode; Python's and NumPy's global generators then start from the level.

        Raises:
            PolicyError: `reset` raises.
        """
        self._where, self._step = f"object {info['object']}, level {info['level']}", 0
        random.seed(info["level"])
        np.random.seed(info["level"])  # noqa: NPY002 - for solutions that draw from it
        if self._reset is not None:
            reset, shown = self._reset, {key: info[key] for key in ("object", "level", "target")}
            _guarded(lambda: reset(observation, shown), self.name, "reset() raised", self._where)

    def act(self, observation: Any, shape: tuple[int, ...]) -> np.ndarray:
        """Return the next action, of that shape and finite.

        Raises:
            PolicyError: `act` raises, or what it returns is no legal action.
        """
        where = f"{self._where}, step {self._step}"
        self._step += 1
        action = _guarded(lambda: self._act(observation), self.name, f"{self._act_name}() raised", where)
        legal = f"an action is {shape[0]} finite numbers in [-1, 1]"
        try:
            array = np.asarray(action, dtype=np.float64)
        except Exception as error:  # what a foreign type raises when it is no array cannot be listed
            given = f"{type(action).__name__}, not an array ({_one_line(error)})"
            raise PolicyError(f"{self.name}: {self._act_name}() returned {given}; {legal} ({where})") from error
        if action is None or array.shape != shape or not np.isfinite(array).all():
            given = _describe(action, array, shape)
            raise PolicyError(f"{self.name}: {self._act_name}() returned {given}; {legal} ({where})")
        return array


def read_solution(path: Path) -> Solution:
    """Run a solution file and take its policy; the file's folder joins `sys.path`, as for any Python script.

    Each call runs the file again and leaves no compiled file behind.

    Raises:
        PolicyError: the file is missing, does not import, has neither or both of the legal forms, or its `Policy`
            cannot be constructed or lacks something.
    """
    name = str(path)
    module = _import_file(path)
    function, policy_class = getattr(module, "policy", None), getattr(module, "Policy", None)
    if function is None and policy_class is None:
        near = [key for key in vars(module) if key.lower() == "policy"]
        has = f" (it has {near[0]!r})" if near else ""
        raise PolicyError(f"{name} has neither 'policy' nor 'Policy'{has}; {LEGAL_FORMS}")
    if function is not None and policy_class is not None:
        raise PolicyError(f"{name} has both 'policy' and 'Policy'; keep one of them ({LEGAL_FORMS})")
    if policy_class is None:
        if inspect.isclass(function) or not callable(function):
            raise PolicyError(f"{name}: 'policy' is {type(function).__name__!r}, not a function; {LEGAL_FORMS}")
        return Solution(name, None, function, None, "policy")
    if not inspect.isclass(policy_class):
        kind = type(policy_class).__name__
        raise PolicyError(f"{name}: 'Policy' is {kind!r}, not a class; {LEGAL_FORMS}")
    return Solution.of_object(_guarded(policy_class, name, "Policy() raised"), name)


def _sampling_of(policy: Any, name: str) -> Sampling | None:
    """Return the `sampling` of a policy's object, where it has one.

    Raises:
        PolicyError: it is no mapping with the arguments of `PointCloudDownsample`, or not for clouds.
    """
    given = getattr(policy, "sampling", None)
    if given is None:
        return None
    if policy.obs_mode != "pointcloud":
        raise PolicyError(f"{name}: sampling is for obs_mode 'pointcloud', not for {policy.obs_mode!r}")
    try:
        return from_mapping(Sampling, to_mapping(given), "sampling")
    except ArtiSkillError as error:
        raise PolicyError(f"{name}: {error}") from error


def _observation_config_of(policy: Any, name: str) -> Mapping[str, Any] | None:
    """Return the `observation_config` of a policy's object, where it has one.

    Raises:
        PolicyError: it is no mapping, or changes more than what is seen.
    """
    given = getattr(policy, "observation_config", None)
    if given is None:
        return None
    if not isinstance(given, Mapping) or any(str(key).partition(".")[0] not in _SEEN for key in given):
        legal = " and ".join(f"{key!r}" for key in _SEEN)
        raise PolicyError(f"{name}: observation_config changes the sections {legal} only, not {shown(given)}")
    return given


def _import_file(path: Path) -> ModuleType:
    try:
        source = read_bytes(path)
    except FileNotFoundError as error:
        raise PolicyError(f"solution file {str(path)!r} does not exist") from error
    except OSError as error:
        raise PolicyError(f"solution file {shown(str(path))} cannot be read: {error.strerror}") from error
    folder = str(path.resolve().parent)
    if folder not in sys.path:
        sys.path.insert(0, folder)
    module = ModuleType(_MODULE)
    module.__file__ = str(path)
    sys.modules[_MODULE] = module  # dataclasses and pickling look their module up

    def run() -> None:
        exec(compile(source, str(path), "exec"), module.__dict__)

    _guarded(run, str(path), "cannot be imported:")
    return module


def _guarded(call: Callable[[], Any], name: str, what: str, where: str = "") -> Any:
    """Return the call's result; raise any error as a `PolicyError` with the solution's line."""
    try:
        return call()
    except BaseException as error:  # anything may come out of foreign code, sys.exit() included
        if isinstance(error, KeyboardInterrupt) and signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
            raise  # Ctrl-C, in a process that it reaches
        line = _line_of(error, name)
        place = ", ".join(part for part in (f"line {line}" if line else "", where) if part)
        message = f"{name}: {what} {_one_line(error)}"
        raise PolicyError(f"{message} ({place})" if place else message) from error


def _line_of(error: BaseException, name: str) -> int | None:
    """Return the last line of the file in the error's traceback."""
    if isinstance(error, SyntaxError) and error.filename == name:
        return error.lineno
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == name]
    return frames[-1].lineno if frames else None


def _one_line(error: BaseException) -> str:
    """Return `ValueError: its message`, shortened."""
    says = error.msg if isinstance(error, SyntaxError) else str(error)
    says = " ".join(says.split())
    says = says if len(says) <= 300 else says[:297] + "..."
    return f"{type(error).__name__}: {says}" if says else type(error).__name__


def _describe(action: Any, array: np.ndarray, shape: tuple[int, ...]) -> str:
    if action is None:
        return "None"
    if array.shape != shape:
        return f"shape {array.shape}"
    bad = np.flatnonzero(~np.isfinite(array)).tolist()
    return f"{array[bad].tolist()} in entries {bad}"
