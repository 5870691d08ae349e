"""`ExpertTakeover`: an expert takes over in some episodes of an agent that trains.

A robot that stands at a chair learns from its own actions that hands there earn more than hands elsewhere, and
rarely that to push earns more still. In some episodes, the task's expert takes over from where the agent has come
to. What it does is stored beside what the agent does, and learned from in the same way: no action is imitated, and
the agent acts alone wherever it is measured.
"""

from typing import Any

import numpy as np

from artiskill.config import check
from artiskill.demos.demonstrator import FAULTS
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.experts.registry import make_expert
from artiskill.tasks.task import Task

_PRIVATE_STREAM = 11  # tells these random numbers from others of the same seed
_NEVER = np.iinfo(np.int64).max


def check_takeover(takeover_steps: tuple[int, int], task: Task) -> None:
    """Raise `ConfigError` if an episode of the task may be over before the expert takes over."""
    last, limit = takeover_steps[1], task.config.episode_steps
    rule = f"must lie below the {limit} steps of an episode"
    check(last < limit, f"algorithm.takeover_steps {rule}, not at {last}")


class ExpertTakeover:
    """Says in which environments the expert acts, and what it does there.

    Args:
        env: of B environments, which begin an episode now; an episode that ends is followed by another one.
        share: of the episodes, those in which the expert takes over if they last so long.
        takeover_steps: fewest and most steps of these after which the expert takes over.
        seed: of the run.

    Raises:
        PolicyError: the task has no expert.
        ConfigError: an episode of the task is over before the expert would take over.
    """

    def __init__(
        self, env: ManipulationVectorEnv, share: float, takeover_steps: tuple[int, int], seed: int
    ) -> None:
        check_takeover(takeover_steps, env.task)
        self._env, self._share, self._takeover_steps = env, share, takeover_steps
        self._expert = make_expert(env.task.name, env.task.robot)
        self._rng = np.random.default_rng([seed, _PRIVATE_STREAM])
        self._elapsed = np.zeros(env.num_envs, dtype=np.int64)
        self._first_step = np.array([self._draw() for _ in range(env.num_envs)], dtype=np.int64)

    @property
    def has_taken_over(self) -> np.ndarray:
        """Where the expert is to take the next step, (B,) bool."""
        return self._elapsed >= self._first_step

    @property
    def is_drawn(self) -> np.ndarray:
        """In which episodes the expert takes over if they last so long, (B,) bool."""
        return self._first_step != _NEVER

    def replace(self, actions: np.ndarray) -> np.ndarray:
        """Return the agent's actions (B, A), and the expert's where it has taken over and knows what to do."""
        where = np.flatnonzero(self.has_taken_over).tolist()
        if not where:
            return actions
        replaced = np.array(actions)
        snapshots, goals = self._env.get_attr("snapshot"), self._env.get_attr("goal")
        for i in where:
            try:
                action = self._expert.act(snapshots[i], goals[i])
            except FAULTS:
                continue
            if np.isfinite(action).all():
                replaced[i] = np.clip(action, -1.0, 1.0)
        return replaced

    def advance(self, done: np.ndarray) -> None:
        """Count a step, after which episodes `done` (B,) have ended."""
        self._elapsed += 1
        for i in np.flatnonzero(done).tolist():
            self._elapsed[i], self._first_step[i] = 0, self._draw()

    def _draw(self) -> int:
        """Return the step of a new episode from which on the expert acts."""
        if self._rng.random() >= self._share:
            return _NEVER
        low, high = self._takeover_steps
        return int(self._rng.integers(low, high + 1))

    @property
    def state(self) -> dict[str, Any]:
        """All that changes: set it to go on."""
        return {
            "rng": self._rng.bit_generator.state,
            "elapsed": self._elapsed.copy(),
            "first_step": self._first_step.copy(),
        }

    @state.setter
    def state(self, state: dict[str, Any]) -> None:
        self._rng.bit_generator.state = state["rng"]
        self._elapsed, self._first_step = state["elapsed"], state["first_step"]
