"""An expert as a demonstrator: its actions in the environment's own control mode, as they are stored."""

import numpy as np

from artiskill.demos.config import load_demos_config
from artiskill.demos.instants import rounded
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.experts.registry import Expert, make_expert
from artiskill.experts.variation import Disturbance, load_variation, varied
from artiskill.tasks.levels import RngStream, level_generator

_MANNER, _PUSHES = 0, 1  # parts of the stream


class Demonstrator:
    """Acts as the task's expert, in a manner of its own in every episode, and disturbed now and then.

    Manner and disturbances are fixed by level, object and target. Every episode has an expert of its own, for no
    episode may depend on the one before.

    Args:
        env: in which it acts.
        variety: without it the expert acts in its usual manner, undisturbed.
        action_bits: actions are multiples of 2 to the power of minus this; by default as `demos.yaml` says.

    Attributes:
        disturbed: whether the last action was another than the expert had wanted.

    Raises:
        PolicyError: the task has no expert.
    """

    def __init__(self, env: ManipulationEnv, variety: bool = True, action_bits: int | None = None) -> None:
        self._config = make_expert(env.task.name, env.task.robot).config  # read from its file only once
        self._variation = load_variation(env.task.name) if variety else None
        self._action_bits = load_demos_config().store.action_bits if action_bits is None else action_bits
        self._expert: Expert | None = None
        self._disturbance: Disturbance | None = None
        self.disturbed = False

    def begin(self, env: ManipulationEnv) -> None:
        """Begin an episode at its first state."""
        config, self._disturbance = self._config, None
        if self._variation is not None:
            state = env.save_state()
            manner, pushes = (
                level_generator(state.level, RngStream.DEMONSTRATING, part, of=(state.object, state.target))
                for part in (_MANNER, _PUSHES)
            )
            config = varied(config, self._variation.ranges, manner)
            self._disturbance = Disturbance(
                self._variation.disturbance,
                env.control.joint_scale.half_range,
                len(env.task.robot.mounts),
                env.task.physics.step_s,
                pushes,
            )
        self._expert = make_expert(env.task.name, env.task.robot, config)
        self._expert.reset(env.snapshot, env.goal)
        self.disturbed = False

    def act(self, env: ManipulationEnv) -> np.ndarray:
        """The next action, (A,) float32.

        Raises:
            FloatingPointError: the expert's is not finite.
        """
        assert self._expert is not None
        wanted = self._expert.act(env.snapshot, env.goal)
        if not np.isfinite(wanted).all():
            raise FloatingPointError(f"the expert's action is not finite: {wanted.tolist()}")
        action = self._stored(wanted, env)
        offset = None if self._disturbance is None else self._disturbance.next(wanted)
        if offset is None:
            self.disturbed = False
            return action
        pushed = self._stored(wanted + offset, env)
        self.disturbed = bool((pushed != action).any())
        return pushed

    def _stored(self, action: np.ndarray, env: ManipulationEnv) -> np.ndarray:
        """A joint action (R,) in the environment's control mode, clipped and rounded as it is stored."""
        action = env.control.of_joint_action(action, env.snapshot)
        return rounded(np.clip(action, -1.0, 1.0), self._action_bits)


class Replay:
    """Acts as it was recorded.

    Args:
        actions: (T, A).

    Attributes:
        disturbed: False: nobody knows from the actions.
    """

    disturbed = False

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
