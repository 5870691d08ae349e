"""Acting in another control mode as it was demonstrated: the same drive targets, and back to the recorded way."""

import numpy as np

from artiskill.demos.trajectory import Trajectory
from artiskill.envs.control import Control
from artiskill.envs.manipulation import ManipulationEnv

_GAIN = 0.5  # share of the way back to the recorded joint positions that a step makes up
_ON_THE_WAY = 2e-3  # rad or m from them that count as being there: far above their rounding
_MORE_STEPS = 20  # at the end, to come to rest where the recording did
_MET = 1e-4  # difference between asked and given drive targets that counts as none


class Retarget:
    """Plays a trajectory in the environment's own control mode.

    Each action asks for the drive targets of the recorded one, converted at the present state. Where the mode
    cannot express them, they are clipped and the robot falls behind; velocity targets then also lead back to the
    recorded joint positions. After the last action the robot is led there for up to a second more.

    Args:
        trajectory: what is played.
        source: of the recorded actions.

    Attributes:
        clipped: actions so far that could not ask for what they should.
    """

    def __init__(self, trajectory: Trajectory, source: Control) -> None:
        self.clipped = 0
        self._actions = trajectory.actions
        self._way = trajectory.states["robot_qpos"].astype(np.float64)
        self._source, self._step = source, 0
        # fingers are driven to positions, all else by velocities: only these can be led back
        self._is_led = source.joint_scale.center == 0.0

    def begin(self, env: ManipulationEnv) -> None:
        """Begin at the first action."""
        self._step = self.clipped = 0

    def act(self, env: ManipulationEnv) -> np.ndarray | None:
        """The next action, (A,) float32; None if there are no more."""
        steps, step = len(self._actions), self._step
        if step == steps + _MORE_STEPS or not steps:
            return None
        self._step += 1
        recorded = self._actions[min(step, steps - 1)].astype(np.float64)
        targets = self._source.to_targets(recorded[None], env.snapshot)
        if step >= steps:
            targets[0, self._is_led] = 0.0
        targets[0, self._is_led] += self._correction(env, min(step, steps))[self._is_led]
        action, is_met = _asking_for(targets, env)
        self.clipped += not is_met
        return action

    def _correction(self, env: ManipulationEnv, step: int) -> np.ndarray:
        """(R,) velocities that lead back to the recorded positions."""
        snapshot = env.snapshot
        off = self._way[step] - snapshot.robot_qpos[0]
        velocity = np.where(np.abs(off) > _ON_THE_WAY, off, 0.0) * (_GAIN / snapshot.step_s)
        yaw = float(snapshot.robot_qpos[0, 2])  # the base is driven in its own frame
        x, y = velocity[:2].tolist()
        velocity[0] = np.cos(yaw) * x + np.sin(yaw) * y
        velocity[1] = np.cos(yaw) * y - np.sin(yaw) * x
        return velocity


def converted_at(action: np.ndarray, source: Control, env: ManipulationEnv) -> tuple[np.ndarray, bool]:
    """The action in the environment's mode that asks for the same drive targets at its present state.

    Returns:
        (A,) float32, and whether it does ask for them.
    """
    if source.mode == env.control.mode:
        return action, True
    found, is_met = _asking_for(source.to_targets(action[None].astype(np.float64), env.snapshot), env)
    return found, is_met


def _asking_for(targets: np.ndarray, env: ManipulationEnv) -> tuple[np.ndarray, bool]:
    """The action (A,) that asks for drive targets (1, A), or comes near; whether it does."""
    action = env.control.to_actions(targets, env.snapshot).astype(np.float32)
    given = env.control.to_targets(action.astype(np.float64), env.snapshot)
    return action[0], bool(np.abs(given - targets).max() <= _MET)
