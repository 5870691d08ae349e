"""`Trajectory`: one demonstration in memory, and the environment's exact state at any of its steps."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import gymnasium as gym
import numpy as np

from artiskill.demos.header import Header
from artiskill.demos.instants import STREAKS, digest_of, simulation_state
from artiskill.demos.open_file import whole_number
from artiskill.demos.recording import Recording, key_frame_steps
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.state import EnvState
from artiskill.errors import DemoError


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """One episode of T steps.

    Attributes:
        header: of its file.
        name: as errors call it.
        target: link.
        level: of the episode.
        recording: actions, whether they were disturbed, rewards, flags, digests, states and key frames.
    """

    header: Header
    name: str
    target: str
    level: int
    recording: Recording

    def __repr__(self) -> str:
        """One line."""
        end = "solved" if self.success else "not solved"
        return f"Trajectory({self.name}: {self.target}, level {self.level}, {len(self)} steps, {end})"

    def __len__(self) -> int:
        """Steps, T."""
        return len(self.recording.actions)

    @property
    def actions(self) -> np.ndarray:
        """(T, A) float32, in the control mode of the header's settings."""
        return self.recording.actions

    @property
    def disturbed(self) -> np.ndarray:
        """(T,) bool, which actions are not what the expert wanted; leave these out when you train."""
        return self.recording.disturbed

    @property
    def rewards(self) -> np.ndarray:
        """(T,) float64, dense."""
        return self.recording.rewards

    @property
    def success(self) -> bool:
        """Whether it was solved."""
        return self.recording.success

    @cached_property
    def states(self) -> dict[str, np.ndarray]:
        """Name -> (T + 1, ...) float32: positions and velocities of robot and object, rounded."""
        return self.header.state_columns.split(self.recording.states)

    @cached_property
    def exact_steps(self) -> np.ndarray:
        """(M,) at which steps the exact state is in the file."""
        return key_frame_steps(len(self), self.header.settings.store.key_frame_steps)

    def env_state(self, step: int, env: "ManipulationEnv | gym.Env[Any, Any] | None" = None) -> EnvState:
        """The environment's exact state before action `step`, or after the last one.

        Args:
            step: 0 to T.
            env: in which steps that are not in the file are simulated, from the last one before that is; see
                `DemoFile.make_env`. It is left there; Gymnasium's wrappers are left out. Not needed at
                `exact_steps`.

        Raises:
            IndexError: there is no such step.
            TypeError: no whole number, or no environment.
            DemoError: the step must be simulated and there is no environment, or it comes out otherwise there.
            StateError: the environment is of another task, object or physics.
        """
        step = whole_number(step, "a step")
        if not 0 <= step <= len(self):
            raise IndexError(f"{self.name} has the steps 0 to {len(self)}, not {step}")
        frame = int(np.searchsorted(self.exact_steps, step, side="right")) - 1
        start = int(self.exact_steps[frame])
        state = self._key_frame(frame)
        if start == step:
            return state
        bare = self._bare(env)
        bare.restore_state(state)
        for action in self.actions[start:step]:
            bare.step(action)
        return self._checked(bare.save_state(), step)

    def env_states(self, env: "ManipulationEnv | gym.Env[Any, Any]") -> Iterator[EnvState]:
        """The exact states of all steps, 0 to T, in one run; the environment may be used between them.

        Raises:
            DemoError: as in `env_state`.
            StateError: likewise.
            TypeError: likewise.
        """
        bare = self._bare(env)
        state = self._key_frame(0)
        yield state
        for step, action in enumerate(self.actions, start=1):
            bare.restore_state(state)
            bare.step(action)
            state = self._checked(bare.save_state(), step)
            yield state

    def _key_frame(self, frame: int) -> EnvState:
        header = self.header
        arrays = header.key_frame_columns.split(self.recording.key_frames[frame])
        streaks = arrays.pop(STREAKS)
        state = EnvState(
            task=header.settings.task,
            object=header.object,
            target=self.target,
            level=self.level,
            simulation=simulation_state(arrays, header.content_hash, header.settings),
            elapsed=int(self.exact_steps[frame]),
            streaks=streaks.astype(np.int64),
        )
        return self._checked(state, state.elapsed)

    def _bare(self, env: "ManipulationEnv | gym.Env[Any, Any] | None") -> ManipulationEnv:
        """The environment without wrappers, which must have the trajectory's control mode."""
        mode = self.header.settings.control_mode
        if env is None:
            raise DemoError(
                f"{self.name}: exact states are stored of the steps {self.exact_steps.tolist()}; an environment "
                "is needed to simulate those between (DemoFile.make_env makes one)"
            )
        bare = getattr(env, "unwrapped", None)
        if not isinstance(bare, ManipulationEnv):
            raise TypeError(f"{self.name} needs a `ManipulationEnv`, wrapped or not, instead of {env!r}")
        if bare.control.mode != mode:
            raise DemoError(
                f"{self.name} has actions of control mode {mode!r}, the environment {bare.control.mode!r}"
            )
        return bare

    def _checked(self, state: EnvState, step: int) -> EnvState:
        found, wanted = digest_of(state.simulation), int(self.recording.digests[step])
        if found != wanted:
            raise DemoError(
                f"{self.name}: the state of step {step} has the digest {found:016x}, "
                f"not {wanted:016x} as recorded: `artiskill demos verify` says more"
            )
        return state
