"""A limit on the time that a policy takes for one action."""

import math
from collections.abc import Callable
from typing import Any

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError, shown
from artiskill.evaluation.policies import Actor
from artiskill.jobs.workers import IDLE, Busy


class TimedActor:
    """An actor that says when it begins and ends to think; who hears that ends the process if it takes too long.

    Nothing inside a process can stop whatever code a policy runs there.

    Args:
        actor: who acts.
        limit_s: for each `reset` and each `act`.
        tell: of a job that has a process of its own, see `run_jobs`.
    """

    def __init__(self, actor: Actor, limit_s: float, tell: Callable[[Busy], None]) -> None:
        self._actor, self._limit_s, self._tell = actor, limit_s, tell
        self.name, self.obs_mode, self.control_mode = actor.name, actor.obs_mode, actor.control_mode
        self._where, self._step = "", 0

    def reset(self, env: ManipulationEnv, observation: Any, info: dict[str, Any]) -> None:
        """Begin an episode."""
        self._where, self._step = f"object {info['object']}, level {info['level']}", 0
        self._begin("reset() has not ended", self._where)
        self._actor.reset(env, observation, info)
        self._tell(IDLE)

    def act(self, env: ManipulationEnv, observation: Any) -> Any:
        """The actor's action."""
        self._begin("no action", f"{self._where}, step {self._step}")
        self._step += 1
        action = self._actor.act(env, observation)
        self._tell(IDLE)
        return action

    def _begin(self, what: str, where: str) -> None:
        self._tell(Busy(f"{self.name}: {what} within {self._limit_s:g} s ({where})", self._limit_s))


def check_limit(limit_s: object) -> None:
    """Raise `ConfigError` unless it is a positive, finite number of seconds, or None."""
    if limit_s is None:
        return
    is_number = isinstance(limit_s, int | float) and not isinstance(limit_s, bool)
    if not is_number or not 0 < limit_s < math.inf:  # type: ignore[operator]
        raise ConfigError(f"the time limit per step must be a positive number of seconds, not {shown(limit_s)}")
