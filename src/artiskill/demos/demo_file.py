"""`DemoFile`: one file of demonstrations, open for reading; and `Trajectory`: one demonstration in memory."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import is_nameable, object_of
from artiskill.assets.names import partnet_id
from artiskill.demos.file_format import ATTEMPT_TYPE, ATTEMPTS, Header
from artiskill.demos.hdf5 import (
    TRAJECTORY,
    Form,
    TrajectoryFile,
    check_finite,
    check_forms,
    reading,
    whole_number,
)
from artiskill.demos.recording import ARRAYS, STREAKS, Recording, digest_of, key_frame_steps, simulation_state
from artiskill.demos.settings import Settings
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.state import EnvState
from artiskill.errors import ArtiSkillError, DemoError, check_name, shown
from artiskill.tasks.levels import check_level

_ADVICE = "its folder may be handed over: `--objects FOLDER` of verify and replay, `--object FOLDER` of pictures"

AnyEnv = ManipulationEnv | gym.Env[Any, Any]


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """One episode of T steps."""

    header: Header  # of its file
    name: str  # as errors call it
    target: str  # link
    level: int  # of the episode
    recording: Recording  # actions, whether they were disturbed, rewards, flags, digests, states and key frames

    def __repr__(self) -> str:
        """Return one line."""
        end = "solved" if self.success else "not solved"
        return f"Trajectory({self.name}: {self.target}, level {self.level}, {len(self)} steps, {end})"

    def __len__(self) -> int:
        """Return the number of steps, T."""
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
        """(M,) steps of which the exact state is in the file."""
        return key_frame_steps(len(self), self.header.settings.store.key_frame_steps)

    def env_state(self, step: int, env: AnyEnv | None = None) -> EnvState:
        """Return the environment's exact state before action `step`, or after the last one.

        Args:
            step: 0 to T.
            env: in which steps that are not in the file are simulated, from the last one before that is; see
                `DemoFile.make_env`. It is left in that state; Gymnasium's wrappers are left out. Not needed at
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

    def env_states(self, env: AnyEnv) -> Iterator[EnvState]:
        """Yield the exact states of all steps, 0 to T, in one run; the environment may be used between them.

        Raises:
            DemoError, StateError, TypeError: as in `env_state`.
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

    def _bare(self, env: AnyEnv | None) -> ManipulationEnv:
        """Return the environment without wrappers, which must have the trajectory's control mode."""
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


class DemoFile(TrajectoryFile):
    """The demonstrations of one object; a sequence of `Trajectory`, and a context manager that closes the file.

    Args:
        path: of the file.

    Attributes:
        path: of the file.
        header: all but attempts and trajectories.

    Raises:
        DemoError: there is no such file, or it is damaged, foreign or of another version.
        MissingExtraError: h5py is not installed.
    """

    def __init__(self, path: Path | str) -> None:
        super().__init__(path, "its header")

    def _read_header(self, given: dict[str, Any]) -> None:
        self.header = Header.from_attributes(given, self.path)

    def __iter__(self) -> Iterator[Trajectory]:
        """Yield all trajectories."""
        return (self.trajectory(i) for i in range(len(self)))

    def __getitem__(self, i: int) -> Trajectory:
        """Return `trajectory(i)`; negative numbers count from the end."""
        number = whole_number(i, "a trajectory's number")
        return self.trajectory(number + len(self) if -len(self) <= number < 0 else number)

    def trajectory(self, i: int) -> Trajectory:
        """Read one trajectory whole.

        Raises:
            IndexError: there are not so many.
            TypeError: no whole number.
            DemoError: it is damaged, or the file has been closed.
        """
        i = self.checked(i)
        arrays = {name: self.array(i, name) for name in ARRAYS}
        with reading(self.path, f"trajectory {i}"):
            header = self.header
            _check_arrays(arrays, header)
            about = self._file[f"{TRAJECTORY}{i}"].attrs
            target, level = str(about["target"]), check_level(about["level"])
            check_name("target", target, tuple(count.target for count in header.targets))
            recording = Recording(
                **arrays, state_columns=header.state_columns, key_frame_columns=header.key_frame_columns
            )
            if bool(about["success"]) != recording.success:
                raise ValueError(f"its attribute says success {about['success']}, its flags {recording.success}")
            return Trajectory(header, f"{self.path.name}, trajectory {i}", target, level, recording)

    def array(self, i: int, name: str) -> np.ndarray:
        """Read one array of a trajectory, without the others; names as in `Recording`.

        Raises:
            IndexError: there are not so many trajectories.
            TypeError: no whole number.
            DemoError: it is damaged, or the file has been closed.
        """
        i = self.checked(i)
        with reading(self.path, f"{name} of trajectory {i}"):
            found: np.ndarray = self._file[f"{TRAJECTORY}{i}"][name][()]
            return found

    @cached_property
    def attempts(self) -> np.ndarray:
        """(N,) all attempts that were made, in order; see `file_format.ATTEMPT_TYPE`.

        Raises:
            DemoError: they are damaged, or the file has been closed.
        """
        self.check_open()
        with reading(self.path, "its attempts"):
            found: np.ndarray = self._file[ATTEMPTS][()]
            if found.dtype != ATTEMPT_TYPE or found.ndim != 1:
                raise ValueError(f"they are {found.dtype}, not {ATTEMPT_TYPE}")
            targets, numbers = found["target"], found["trajectory"]
            if len(found) and not 0 <= targets.min() <= targets.max() < len(self.header.targets):
                raise ValueError(f"the header has {len(self.header.targets)} targets")
            if sorted(numbers[numbers >= 0]) != list(range(len(self))):
                raise ValueError(f"they do not list the {len(self)} trajectories")
            if (found["success"] & (numbers < 0)).any():
                raise ValueError("one that was solved has no trajectory")
            return found

    def check_settings(self, wanted: Settings) -> None:
        """Raise `DemoError` unless the file was made with these settings, its manifest's say."""
        differences = self.header.settings.differences(wanted)
        if differences:
            raise DemoError(
                f"{str(self.path)!r} was made with other settings than its manifest says: {differences} "
                "(there: the file, here: the manifest); one of the two was changed"
            )

    def check_counts(self) -> None:
        """Raise `DemoError` unless the table of attempts has as many as the header says."""
        for k, count in enumerate(self.header.targets):
            rows = self.attempts[self.attempts["target"] == k]
            if (len(rows), int(rows["success"].sum())) != (count.attempts, count.successes):
                raise DemoError(f"{str(self.path)!r}: the attempts at {count.target} do not add up")

    def load_object(self, given: str | ArticulatedObject | None = None) -> ArticulatedObject:
        """Return the object, which must be the one that was demonstrated with.

        Args:
            given: where its own name does not lead to it: an imported one, say, or the name of its folder.

        Raises:
            DemoError: this version's, or this catalogue's, is another one; or there is none.
        """
        wanted = self.header.content_hash
        try:
            found = object_of(self._named_object() if given is None else given)
        except ArtiSkillError as error:
            raise DemoError(f"{str(self.path)!r}: cannot load its object: {error} ({_ADVICE})") from error
        if found.content_hash != wanted:
            raise DemoError(
                f"{str(self.path)!r} was made with another {self.header.object!r}: its content hash was {wanted}, "
                f"now it is {found.content_hash}"
            )
        return found

    def _named_object(self) -> str:
        """Return the name that the file says its object has: never a path, which is for the user to choose."""
        name: str = self.header.facts["name"]
        if is_nameable(name) or partnet_id(name) is not None:
            return name
        raise DemoError(f"its file calls it {shown(name)}, which is no name that a file may choose")

    def make_env(
        self, obs_mode: str = "state", obj: str | ArticulatedObject | None = None, **options: Any
    ) -> ManipulationEnv:
        """Return an environment of the file's task, control mode and object.

        Args:
            obs_mode: as `ManipulationEnv` takes it.
            obj: as in `load_object`.
            options: further arguments of `ManipulationEnv`.

        Raises:
            DemoError: its object or task has changed.
        """
        obj = self.load_object(obj)
        self.header.settings.make_task()
        return self.header.settings.make_env([obj], obs_mode, **options)


def _check_arrays(arrays: dict[str, np.ndarray], header: Header) -> None:
    """Raise `ValueError` unless a trajectory's arrays fit the header and one another, and are finite."""
    steps, columns = len(arrays["actions"]), header.state_columns
    drives = columns.slices["robot_qpos"]
    frames = len(key_frame_steps(steps, header.settings.store.key_frame_steps))
    wanted: dict[str, Form] = {
        "actions": ((steps, drives.stop - drives.start), np.float32),  # a number for each of the robot's joints
        "disturbed": ((steps,), np.bool_),
        "rewards": ((steps,), np.float64),
        "flags": ((steps, len(header.flag_names)), np.bool_),
        "digests": ((steps + 1,), np.uint64),
        "states": ((steps + 1, columns.width), np.float32),
        "key_frames": ((frames, header.key_frame_columns.width), np.float64),
    }
    check_forms(arrays, wanted)
    check_finite({name: arrays[name] for name in ("actions", "rewards", "states", "key_frames")})
