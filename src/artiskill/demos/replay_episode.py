"""One trajectory replayed: simulated from its level, or restored state by state, and written as it is observed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import gymnasium as gym
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.demos.demo_file import Trajectory
from artiskill.demos.demonstrator import RecordedActions
from artiskill.demos.hdf5 import write_compressed
from artiskill.demos.recording import digest_of
from artiskill.envs.control import Control
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import DivergedError
from artiskill.scene.scene import cached_scene
from artiskill.sim.states import with_values

STATE, AGENT = "state", "agent"
_DIGEST_STEPS = 10  # states are compared so often, and at the end: what differs once stays different
_CHUNK_BYTES = 1 << 17  # frames that are read and unpacked at once
_MOST_FRAMES = 256  # of a chunk
_GAIN = 0.5  # share of the way back to the recorded joint positions that a step makes up
_TOLERANCE = 2e-3  # rad or m from them that count as being there: far above their rounding
_MORE_STEPS = 20  # at the end, to come to rest where the recording did
_MET = 1e-4  # difference between asked and given drive targets that counts as none


@dataclass(frozen=True)
class Outcome:
    """What came of a trajectory."""

    source: int  # its number in the file of demonstrations
    success: bool  # whether it is solved
    # whether it is the recorded one, bit for bit; a restored one only where all of its states are stored exactly
    exact: bool
    steps: int  # that it has now
    clipped: int  # actions that could not ask for the recorded drive targets
    kept: bool = False  # whether it is in the training file
    fault: str = ""  # what ended the episode before its end: a text; else empty


@dataclass(frozen=True)
class OutcomeCounts:
    """What came of many trajectories."""

    replayed: int  # number of trajectories
    solved: int  # of these
    exact: int  # of these
    steps: int  # of all
    clipped: int  # of these steps

    @classmethod
    def of(cls, outcomes: Sequence[Outcome]) -> "OutcomeCounts":
        """Return the sums."""
        return cls(
            replayed=len(outcomes),
            solved=sum(one.success for one in outcomes),
            exact=sum(one.exact for one in outcomes),
            steps=sum(one.steps for one in outcomes),
            clipped=sum(one.clipped for one in outcomes),
        )


def leaf_spaces(space: gym.Space[Any], name: str = STATE) -> dict[str, gym.spaces.Box]:
    """Return the arrays of an observation space by path, `pointcloud/xyz` say; `state` for one without parts."""
    if not isinstance(space, gym.spaces.Dict):
        assert isinstance(space, gym.spaces.Box), "observations are arrays"
        return {name: space}
    found: dict[str, gym.spaces.Box] = {}
    for key, below in space.items():
        found |= {path if path == key else f"{key}/{path}": leaf for path, leaf in leaf_spaces(below, key).items()}
    return found


class TrajectoryWriter:
    """Writes a trajectory of a training file while it is played; frames go to the file when they fill a chunk.

    `traj_<i>` has `obs` as the environment nests it, T + 1 rows, and T rows of `actions`, `disturbed`, `rewards`,
    `dones` and `success`. In the visual modes `obs/state` is another name of `obs/agent`, that of ManiSkill's own
    loaders.

    Args:
        group: of the trajectory, empty.
        space: of the observations.
        compression: level of gzip.
    """

    def __init__(self, group: Any, space: gym.Space[Any], compression: int) -> None:
        self._group, self._compression = group, compression
        folder = group.create_group("obs")
        self._leaves = {
            path: _Frames(folder, path, leaf, compression) for path, leaf in leaf_spaces(space).items()
        }
        if AGENT in self._leaves:
            folder[STATE] = folder[AGENT]
        self._actions: list[np.ndarray] = []
        self._disturbed: list[bool] = []
        self._rewards: list[float] = []
        self._successes: list[bool] = []

    def add_observation(self, observation: Any) -> None:
        """Add the observation before the first step, or after one."""
        for path, frames in self._leaves.items():
            leaf = observation
            for key in path.split("/") if isinstance(observation, dict) else ():
                leaf = leaf[key]
            frames.add(np.asarray(leaf))

    def add_step(self, action: np.ndarray, disturbed: bool, reward: float, success: bool) -> None:
        """Add a step; its observation follows."""
        self._actions.append(np.asarray(action, dtype=np.float32))
        self._disturbed.append(bool(disturbed))
        self._rewards.append(float(reward))
        self._successes.append(bool(success))

    def close(self, size: int, **about: Any) -> None:
        """Write the rest; `size` numbers are in an action, `about` become attributes.

        The last step ends the episode, also where there were no more actions.
        """
        for frames in self._leaves.values():
            frames.flush()
        for name, values in {
            "actions": np.array(self._actions, np.float32).reshape(-1, size),
            "disturbed": np.array(self._disturbed, np.bool_),
            "rewards": np.array(self._rewards, np.float64),
            "dones": np.arange(len(self)) == len(self) - 1,
            "success": np.array(self._successes, np.bool_),
        }.items():
            write_compressed(self._group, name, values, self._compression)
        self._group.attrs.update(about)

    def __len__(self) -> int:
        """Return the number of steps so far."""
        return len(self._actions)


class _Frames:
    """One array of the observations, (T + 1, ...)."""

    def __init__(self, folder: Any, path: str, space: gym.spaces.Box, compression: int) -> None:
        bytes_each = int(np.prod(space.shape)) * space.dtype.itemsize
        count = min(max(_CHUNK_BYTES // max(bytes_each, 1), 1), _MOST_FRAMES)
        self._buffer = np.empty((count, *space.shape), dtype=space.dtype)
        self._filled = self._written = 0
        packed: dict[str, Any] = {}
        if compression:  # sorting bytes by significance is of use for numbers of several bytes, but not for images
            is_vector = len(space.shape) < 3 and space.dtype.itemsize > 1
            packed = {"compression": "gzip", "compression_opts": compression, "shuffle": is_vector}
        self._data = folder.create_dataset(
            path,
            (0, *space.shape),
            space.dtype,
            maxshape=(None, *space.shape),
            chunks=self._buffer.shape,
            **packed,
        )

    def add(self, frame: np.ndarray) -> None:
        self._buffer[self._filled] = frame
        self._filled += 1
        if self._filled == len(self._buffer):
            self.flush()

    def flush(self) -> None:
        end = self._written + self._filled
        self._data.resize(end, axis=0)
        self._data[self._written : end] = self._buffer[: self._filled]
        self._written, self._filled = end, 0


def simulate(
    number: int,
    trajectory: Trajectory,
    env: ManipulationEnv,
    obj: ArticulatedObject,
    source: Control,
    writer: TrajectoryWriter,
) -> Outcome:
    """Play the actions from the level on; `env` may have another control mode than they have."""
    is_same = source.mode == env.control.mode
    actor = RecordedActions(trajectory.actions) if is_same else Retarget(trajectory, source)
    observation, info = env.reset(options={"level": trajectory.level, "object": obj, "target": trajectory.target})
    actor.begin(env)
    writer.add_observation(observation)
    disturbed, done, fault = trajectory.disturbed, False, ""
    is_exact = is_same and _digest(env) == trajectory.recording.digests[0]
    try:
        while not done and (action := actor.act(env)) is not None:
            observation, reward, terminated, truncated, info = env.step(action)
            done, step = terminated or truncated, len(writer)
            is_disturbed = step < len(disturbed) and disturbed[step]  # a retargeted one may take longer
            writer.add_step(action, is_disturbed, reward, info["success"])
            writer.add_observation(observation)
            is_exact = is_exact and _is_as_recorded(env, trajectory, step, reward, info["flags"])
    except DivergedError as error:
        fault = str(error)
    steps = len(writer)
    return Outcome(
        source=number,
        success=bool(info["success"]),  # which ends an episode: one that diverges has not come to it
        exact=is_exact and steps == len(trajectory),
        steps=steps,
        clipped=0 if isinstance(actor, RecordedActions) else actor.clipped,
        fault=fault,
    )


def _is_as_recorded(
    env: ManipulationEnv, trajectory: Trajectory, step: int, reward: float, flags: Mapping[str, bool]
) -> bool:
    """Return whether a step led to the recorded reward and flags, and now and then, to the recorded state."""
    if step >= len(trajectory):
        return False
    recording = trajectory.recording
    is_due = step % _DIGEST_STEPS == 0 or step == len(trajectory) - 1
    return (
        reward == recording.rewards[step]
        and list(flags.values()) == recording.flags[step].tolist()
        and (not is_due or _digest(env) == recording.digests[step + 1])
    )


def _digest(env: ManipulationEnv) -> int:
    return digest_of(env.save_state().simulation)


def restore(
    number: int,
    trajectory: Trajectory,
    env: ManipulationEnv,
    obj: ArticulatedObject,
    source: Control,
    writer: TrajectoryWriter,
) -> Outcome:
    """Restore every recorded state; rewards and successes are the recorded ones.

    States are exact where the file has them so, else rounded as it has them. Nothing is simulated, so that this
    works with demonstrations of another version of the engine, too.
    """
    scene = cached_scene(env.task.robot, obj, env.task.physics, env.task.props)
    exact = set(trajectory.exact_steps.tolist())
    recording, states = trajectory.recording, trajectory.states
    solved = [bool(row.all()) for row in recording.flags]
    clipped, steps = 0, len(trajectory)
    state = trajectory.env_state(0)
    observation, _ = env.restore_state(state)
    writer.add_observation(observation)
    for step, recorded in enumerate(trajectory.actions):
        action, is_met = _converted(recorded, source, env)
        clipped += not is_met
        if step + 1 in exact:
            state = trajectory.env_state(step + 1)
        else:
            values = {name: value[step + 1] for name, value in states.items()}
            simulation = with_values(state.simulation, scene, values, env.snapshot)
            state = replace(state, simulation=simulation, elapsed=step + 1)
        observation, _ = env.restore_state(state)
        writer.add_step(action, recording.disturbed[step], recording.rewards[step], solved[step])
        writer.add_observation(observation)
    is_exact = source.mode == env.control.mode and len(exact) == steps + 1
    return Outcome(number, trajectory.success, is_exact, steps, clipped)


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
        self._positions = trajectory.states["robot_qpos"].astype(np.float64)
        self._source, self._step = source, 0
        # fingers are driven to positions, all else by velocities: only these can be led back
        self._is_led = source.joint_scale.center == 0.0

    def begin(self, env: ManipulationEnv) -> None:
        """Begin at the first action."""
        self._step = self.clipped = 0

    def act(self, env: ManipulationEnv) -> np.ndarray | None:
        """Return the next action, (A,) float32; None if there are no more."""
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
        """Return the velocities (R,) that lead back to the recorded positions."""
        snapshot = env.snapshot
        off = self._positions[step] - snapshot.robot_qpos[0]
        velocity = np.where(np.abs(off) > _TOLERANCE, off, 0.0) * (_GAIN / snapshot.step_s)
        yaw = float(snapshot.robot_qpos[0, 2])  # the base is driven in its own frame
        x, y = velocity[:2].tolist()
        velocity[0] = np.cos(yaw) * x + np.sin(yaw) * y
        velocity[1] = np.cos(yaw) * y - np.sin(yaw) * x
        return velocity


def _converted(action: np.ndarray, source: Control, env: ManipulationEnv) -> tuple[np.ndarray, bool]:
    """Return the action (A,) in the environment's mode that asks for the same drive targets at its present state.

    And whether it does ask for them.
    """
    if source.mode == env.control.mode:
        return action, True
    return _asking_for(source.to_targets(action[None].astype(np.float64), env.snapshot), env)


def _asking_for(targets: np.ndarray, env: ManipulationEnv) -> tuple[np.ndarray, bool]:
    """Return the action (A,) that asks for drive targets (1, A), or comes near; and whether it does."""
    action = env.control.to_actions(targets, env.snapshot).astype(np.float32)
    given = env.control.to_targets(action.astype(np.float64), env.snapshot)
    return action[0], bool(np.abs(given - targets).max() <= _MET)
