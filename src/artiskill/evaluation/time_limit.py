"""Limits on the time that a policy takes to load, and for one action."""

import math
import random
from collections.abc import Callable
from typing import Any

import numpy as np

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError, shown
from artiskill.evaluation.policies import Actor, load_policy
from artiskill.jobs.worker import NO_DEADLINE, Deadline

LOAD_TIMEOUT_S = 120.0  # to run a solution file and construct its policy: weights may be large


def load_within(policy: Any, limit_s: float, tell: Callable[[Deadline], None]) -> Actor:
    """`load_policy` in a process of its own, which is ended if it takes too long.

    Python's and NumPy's global generators start from the same numbers, whatever the process did before.

    Args:
        policy: as `load_policy` takes it.
        limit_s: in seconds.
        tell: of a job that has a process of its own, see `run_jobs`.

    Raises:
        UnknownNameError, PolicyError: as of `load_policy`.
    """
    tell(Deadline(f"{policy}: not loaded within {limit_s:g} s", limit_s))
    random.seed(0)
    np.random.seed(0)  # noqa: NPY002 - for solutions that draw from it
    actor = load_policy(policy)
    tell(NO_DEADLINE)
    return actor


class TimedActor:
    """An actor that says when it begins and ends to think; who hears that ends the process if it takes too long.

    Nothing inside a process can stop whatever code a policy runs there.

    Args:
        actor: who acts.
        limit_s: for each `reset` and each `act`.
        tell: of a job that has a process of its own, see `run_jobs`.
    """

    def __init__(self, actor: Actor, limit_s: float, tell: Callable[[Deadline], None]) -> None:
        self._actor, self._limit_s, self._tell = actor, limit_s, tell
        self.name, self.obs_mode, self.control_mode = actor.name, actor.obs_mode, actor.control_mode
        self._where, self._step = "", 0

    def reset(self, env: ManipulationEnv, observation: Any, info: dict[str, Any]) -> None:
        """Begin an episode."""
        self._where, self._step = f"object {info['object']}, level {info['level']}", 0
        self._begin("reset() has not ended", self._where)
        self._actor.reset(env, observation, info)
        self._tell(NO_DEADLINE)

    def act(self, env: ManipulationEnv, observation: Any) -> Any:
        """The actor's action."""
        self._begin("no action", f"{self._where}, step {self._step}")
        self._step += 1
        action = self._actor.act(env, observation)
        self._tell(NO_DEADLINE)
        return action

    def _begin(self, what: str, where: str) -> None:
        self._tell(Deadline(f"{self.name}: {what} within {self._limit_s:g} s ({where})", self._limit_s))


def check_limit(limit_s: object, what: str = "per step") -> None:
    """Raise `ConfigError` unless it is a positive, finite number of seconds."""
    is_number = isinstance(limit_s, int | float) and not isinstance(limit_s, bool)
    if not is_number or not 0 < limit_s < math.inf:  # type: ignore[operator]
        raise ConfigError(f"the time limit {what} must be a positive number of seconds, not {shown(limit_s)}")
