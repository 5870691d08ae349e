"""Solutions: a participant's policy that sees observations, and whose every fault is one clear `PolicyError`.

A fault of a solution must look like one: the message names the file, the line, what was raised or returned, the
object, the level and the step, and never shows the benchmark's own frames. A solution file runs in a process of
its own, see `solution_process`, and what comes from there is checked as what a stranger sends.
"""

import json
import math
import os
import time
import weakref
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.compat import user_policy
from artiskill.compat.observations import describe_for_2021
from artiskill.config import from_mapping, to_mapping
from artiskill.envs.control import CONTROL_MODES, JOINT
from artiskill.envs.options import OBSERVATION_MODES
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ArtiSkillError, PolicyError, UnknownNameError, shown
from artiskill.evaluation import solution_process as wire
from artiskill.evaluation.sandbox import Confinement, SandboxConfig
from artiskill.evaluation.solution_channel import BROKEN, MOST_SAID, open_process
from artiskill.evaluation.solution_process import SolutionCode, SolutionError
from artiskill.files import open_regular, parse_json
from artiskill.tasks.registry import SEEN_SECTIONS

_DECLARED = ("obs_mode", "control_mode", "sampling", "observation_config")
_NUMBER_BYTES = 8  # of a number of an action


class Solution:
    """A policy that sees observations, called with care; `ObjectSolution` and `FileSolution` are complete.

    Args:
        name: of the file, for messages and reports.
        declared: what its object says of itself, of `_DECLARED`; None for a function.

    Attributes:
        obs_mode: the observation mode that it needs; None if any will do.
        control_mode: the control mode that its actions are of; None if they may be of any.
        sampling: of the clouds that it sees; None for the full ones.
        observation_config: values of `cameras`, `render` and `state` that it needs; None for the task's.
        confinement: of its process, as was found out there; None if it has none of its own.

    Raises:
        PolicyError: its `obs_mode` or `control_mode` is unknown, or what it asks of observations illegal.
    """

    confinement: Confinement | None = None

    def __init__(self, name: str, declared: Mapping[str, Any] | None) -> None:
        self.name = name
        said = dict.fromkeys(_DECLARED) if declared is None else {"control_mode": JOINT, **declared}
        self.obs_mode, self.control_mode = said["obs_mode"], said["control_mode"]
        if declared is not None and self.obs_mode not in OBSERVATION_MODES:
            raise PolicyError(f"{name}: {UnknownNameError('obs_mode', self.obs_mode, OBSERVATION_MODES)}")
        if self.control_mode not in (None, *CONTROL_MODES):
            raise PolicyError(f"{name}: {UnknownNameError('control_mode', self.control_mode, CONTROL_MODES)}")
        self.sampling = _checked_sampling(said.get("sampling"), name, self.obs_mode)
        self.observation_config = _checked_observation_config(said.get("observation_config"), name)
        self._where, self._step = "", 0

    def reset(self, observation: Any, info: Mapping[str, Any]) -> None:
        """Begin an episode.

        Args:
            observation: the first one.
            info: with `object`, `level` and `target`; where they are not known, with the number of the `episode`.

        Raises:
            PolicyError: `reset` raises.
        """
        known = f"object {info['object']}, level {info['level']}" if "object" in info else None
        self._where, self._step = known or f"episode {info['episode']}", 0
        try:
            self._begin(observation, info)
        except SolutionError as fault:
            raise policy_error(self.name, fault, self._where) from fault.__cause__

    def act(self, observation: Any, shape: tuple[int, ...]) -> np.ndarray:
        """Return the next action, of that shape and finite.

        Raises:
            PolicyError: `act` raises, or what it returns is no legal action.
        """
        self._step += 1
        try:
            return self._next(observation, shape[0])
        except SolutionError as fault:
            where = f"{self._where}, step {self._step - 1}"
            raise policy_error(self.name, fault, where) from fault.__cause__

    def close(self) -> None:
        """End what belongs to it."""

    def _begin(self, observation: Any, info: Mapping[str, Any]) -> None:
        raise NotImplementedError

    def _next(self, observation: Any, size: int) -> np.ndarray:
        raise NotImplementedError


class ObjectSolution(Solution):
    """A function or an object with `obs_mode`, `reset` and `act`, and what else a policy may declare.

    It runs in this process, and is told object, level and target: who passes it has them at hand anyway. Python's
    and NumPy's global generators start from the level.

    Args:
        policy: either.
        name: for messages and reports; by default its own.

    Raises:
        PolicyError: it is neither, or declares what is not legal.
    """

    def __init__(self, policy: Any, name: str | None = None) -> None:
        name = name or str(getattr(policy, "__name__", type(policy).__name__))
        try:
            self._code = SolutionCode(policy, name)
        except SolutionError as fault:
            raise policy_error(name, fault) from fault.__cause__
        super().__init__(name, self._code.declared)

    def _begin(self, observation: Any, info: Mapping[str, Any]) -> None:
        told = {key: info[key] for key in ("object", "level", "target", "episode") if key in info}
        self._code.reset(observation, told, info.get("level", info.get("episode", 0)))

    def _next(self, observation: Any, size: int) -> np.ndarray:
        return self._code.act(observation, size)


class FileSolution(Solution):
    """A solution file, in a process of its own that ends with this object.

    Args:
        path: of the file.
        task: name of the task, which a `UserPolicy` of 2021 is told.
        sandbox: how the process is confined.

    Raises:
        PolicyError: the file is missing, does not import, has neither or both of the legal forms, or its `Policy`
            cannot be constructed, lacks something, or declares what is not legal.
        ConfigError: the kind of confinement that was asked for does not hold here.
    """

    def __init__(self, path: Path, task: str | None = None, sandbox: SandboxConfig | None = None) -> None:
        name = str(path)
        try:
            with open_regular(path) as file:
                is_user_policy = task is not None and wire.USER_POLICY.encode() in file.read()
        except FileNotFoundError as error:
            raise PolicyError(f"solution file {name!r} does not exist") from error
        except OSError as error:
            raise PolicyError(f"solution file {shown(name)} cannot be read: {error.strerror}") from error
        self._limits = sandbox = sandbox or SandboxConfig()
        self._process, self.confinement = open_process(path, sandbox)
        self._end = weakref.finalize(self, self._process.end)
        self._layout: list[Any] = [[], 0]  # of observations, and the size of an action
        self._rest_s = math.inf  # of the episode's time
        job = {"file": os.path.realpath(path), "user_policy": _user_policy(task) if is_user_policy else None}
        try:
            declared = _declaration(self._process.ask(wire.START, _json(job), wire.DECLARED, MOST_SAID))
        except SolutionError as fault:
            raise policy_error(name, fault) from fault.__cause__
        super().__init__(name, declared)

    def close(self) -> None:
        """End the process."""
        self._end()

    def _begin(self, observation: Any, info: Mapping[str, Any]) -> None:
        self._rest_s = self._limits.episode_timeout_s
        layout = [[keys, array.dtype.str, list(array.shape)] for keys, array in _arrays_in(observation)]
        if layout != self._layout[0]:
            self._tell(layout, self._layout[1])
        self._timed(wire.RESET, _packed(observation), wire.DONE, 0, "reset() has not ended")

    def _next(self, observation: Any, size: int) -> np.ndarray:
        if size != self._layout[1]:
            self._tell(self._layout[0], size)
        wanted = size * _NUMBER_BYTES
        said = self._timed(wire.ACT, _packed(observation), wire.ACTION, wanted, "no action")
        action = np.frombuffer(said, np.float64) if len(said) == wanted else np.array([np.nan])
        if not np.logical_and.reduce(np.isfinite(action)):
            raise SolutionError(f"{BROKEN}: an action of {len(said)} bytes, {wanted} of finite numbers are legal")
        return action

    def _timed(self, kind: bytes, body: bytes, answer: bytes, most_bytes: int, late: str) -> bytes:
        """Send a frame and return the content of the answer, which must come in time."""
        step_s, start_s = self._limits.step_timeout_s, time.monotonic()
        try:
            return self._process.ask(kind, body, answer, most_bytes, min(step_s, self._rest_s))
        except TimeoutError:
            if step_s <= self._rest_s:
                raise SolutionError(f"{late} within {step_s:g} s") from None
            episode_s = self._limits.episode_timeout_s
            raise SolutionError(f"its actions took more than {episode_s:g} s in this episode") from None
        finally:
            self._rest_s = max(0.0, self._rest_s - (time.monotonic() - start_s))

    def _tell(self, layout: list[Any], size: int) -> None:
        """Say where arrays are in an observation, and how many numbers an action has."""
        self._layout = [layout, size]
        self._timed(wire.LAYOUT, _json(self._layout), wire.DONE, 0, "no answer")


def policy_error(name: str, fault: SolutionError, where: str = "") -> PolicyError:
    """Return the error of a fault.

    Args:
        name: of the solution.
        fault: of its code.
        where: object, level and step.
    """
    place = ", ".join(part for part in (f"line {fault.line}" if fault.line else "", where) if part)
    error = PolicyError(f"{name}: {fault.text} ({place})" if place else f"{name}: {fault.text}")
    for note in getattr(fault, "__notes__", ()):
        error.add_note(note)
    return error


def _declaration(body: bytes) -> dict[str, Any] | None:
    """Return what a process says of its policy.

    Raises:
        SolutionError: it makes no sense.
    """
    try:
        said = parse_json(body)
    except ValueError:
        said = 0
    if said is None:
        return None
    if not isinstance(said, dict) or not said.keys() <= set(_DECLARED) or "obs_mode" not in said:
        raise SolutionError(f"{BROKEN}: its declaration makes no sense")
    return said


def _user_policy(task: str | None) -> dict[str, Any]:
    """Return what the process needs for a solution of 2021; it has no access to this package."""
    assert task is not None
    return {"source": Path(user_policy.__file__).read_text(encoding="utf-8"), "about": describe_for_2021(task)}


def _json(value: Any) -> bytes:
    return json.dumps(value).encode()


def _arrays_in(observation: Any) -> Iterator[tuple[list[str], np.ndarray]]:
    """Yield all arrays of an observation, which may be nested, each with its keys."""
    if not isinstance(observation, Mapping):
        yield [], np.asarray(observation)
        return
    for key, value in observation.items():
        for keys, array in _arrays_in(value):
            yield [key, *keys], array


def _packed(observation: Any) -> bytes:
    """Return the bytes of an observation's arrays, each filled up to `ALIGNMENT`."""
    if isinstance(observation, np.ndarray):
        return observation.tobytes() + bytes(-observation.nbytes % wire.ALIGNMENT)
    return b"".join(_packed(array) for _, array in _arrays_in(observation))


def _checked_sampling(given: Any, name: str, obs_mode: str | None) -> Sampling | None:
    """Return the `sampling` of a policy's object, where it has one.

    Raises:
        PolicyError: it is no mapping with the arguments of `PointCloudDownsample`, or not for clouds.
    """
    if given is None:
        return None
    if obs_mode != "pointcloud":
        raise PolicyError(f"{name}: sampling is for obs_mode 'pointcloud', not for {obs_mode!r}")
    try:
        return from_mapping(Sampling, to_mapping(given), "sampling")
    except ArtiSkillError as error:
        raise PolicyError(f"{name}: {error}") from error


def _checked_observation_config(given: Any, name: str) -> Mapping[str, Any] | None:
    """Return the `observation_config` of a policy's object, where it has one.

    Raises:
        PolicyError: it is no mapping, or changes more than what is seen.
    """
    if given is None:
        return None
    if not isinstance(given, Mapping) or any(str(key).partition(".")[0] not in SEEN_SECTIONS for key in given):
        legal = ", ".join(f"{key!r}" for key in SEEN_SECTIONS)
        raise PolicyError(f"{name}: observation_config changes the sections {legal} only, not {shown(given)}")
    return given
