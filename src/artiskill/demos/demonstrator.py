"""An expert as a demonstrator: its actions in the environment's own control mode, as they are stored."""

import numpy as np

from artiskill.envs.control import JOINT
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.experts.registry import Expert, make_expert


class Demonstrator:
    """Acts as the task's expert.

    Every episode has an expert of its own, for no episode may depend on the one before.

    Args:
        env: in which it acts.
    """

    def __init__(self, env: ManipulationEnv) -> None:
        self._config = make_expert(env.task.name, env.task.robot).config  # read from its file only once
        self._expert: Expert | None = None

    def begin(self, env: ManipulationEnv) -> None:
        """Begin an episode at its first state."""
        self._expert = make_expert(env.task.name, env.task.robot, self._config)
        self._expert.reset(env.snapshot, env.goal)

    def act(self, env: ManipulationEnv) -> np.ndarray:
        """The next action, (A,) float32."""
        assert self._expert is not None
        action = self._expert.act(env.snapshot, env.goal)
        if env.control.mode != JOINT:
            targets = env.control.joint_scale.to_targets(action[None])
            action = env.control.to_actions(targets, env.snapshot)[0]
        return action.astype(np.float32)


class Replay:
    """Acts as it was recorded.

    Args:
        actions: (T, A).
    """

    def __init__(self, actions: np.ndarray) -> None:
        self._actions, self._step = actions, 0

    def begin(self, env: ManipulationEnv) -> None:
        """Begin at the first action."""
        self._step = 0

    def act(self, env: ManipulationEnv) -> np.ndarray | None:
        """The next action; None if there are no more."""
        if self._step == len(self._actions):
            return None
        self._step += 1
        action: np.ndarray = self._actions[self._step - 1]
        return action
