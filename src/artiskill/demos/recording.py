"""Recording an episode while it is played: what is stored of each of its steps."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from hashlib import blake2b
from typing import Any, Protocol

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.demos.settings import Settings, StoreConfig
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.state import EnvState
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import SimulationState

DIGEST_BYTES = 8
STREAKS = "streaks"  # the episode's own part of a key frame; all else is the simulation's


@dataclass(frozen=True)
class Columns:
    """Which columns of a matrix are which array, as a file's datasets store them."""

    parts: tuple[tuple[str, tuple[int, ...]], ...] = ()  # names and shapes, in order

    @classmethod
    def of(cls, arrays: Mapping[str, np.ndarray]) -> "Columns":
        """Return the columns of these arrays, raveled and side by side."""
        return cls(tuple((name, tuple(value.shape)) for name, value in arrays.items()))

    @classmethod
    def from_list(cls, given: Any) -> "Columns":
        """Return the columns that `to_list` described."""
        return cls(tuple((str(name), tuple(int(n) for n in shape)) for name, shape in given))

    def to_list(self) -> list[list[Any]]:
        """Return plain values, ready for JSON."""
        return [[name, list(shape)] for name, shape in self.parts]

    @property
    def width(self) -> int:
        """Number of columns."""
        return sum(math.prod(shape) for _, shape in self.parts)

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Name -> its columns."""
        found, start = {}, 0
        for name, shape in self.parts:
            found[name] = slice(start, start + math.prod(shape))
            start += math.prod(shape)
        return found

    def split(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """Return the arrays in rows (..., width), each (..., *its shape)."""
        return {name: rows[..., self.slices[name]].reshape(*rows.shape[:-1], *shape) for name, shape in self.parts}


def joined(arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return all arrays raveled and side by side, (width,) float64."""
    return np.concatenate([np.asarray(value, dtype=np.float64).ravel() for value in arrays.values()])


@dataclass(frozen=True, eq=False)
class Recording:
    """An episode of T steps as it is stored; A actions, F flags."""

    actions: np.ndarray  # (T, A) float32
    disturbed: np.ndarray  # (T,) bool, actions that are not what the expert wanted: they pushed it off its way
    rewards: np.ndarray  # (T,) float64, dense
    flags: np.ndarray  # (T, F) bool, which conditions have held long enough after each step
    digests: np.ndarray  # (T + 1,) uint64, `digest_of` the state before the first and after each step
    states: np.ndarray  # (T + 1, D) float32, rounded positions and velocities
    key_frames: np.ndarray  # (M, W) float64, exact states
    state_columns: Columns  # which of the D are what
    key_frame_columns: Columns  # which of the W are what

    @property
    def success(self) -> bool:
        """Whether the task was solved at the end."""
        return bool(len(self.flags) and self.flags[-1].all())


# the arrays of a recording, each a dataset of a file
ARRAYS = ("actions", "disturbed", "rewards", "flags", "digests", "states", "key_frames")
# the one of them that does not follow from level and actions
UNREPEATED = "disturbed"


class Actor(Protocol):
    """Who acts in an episode that is recorded.

    Attributes:
        disturbed: whether the last action was another than the actor had wanted.
    """

    disturbed: bool

    def begin(self, env: ManipulationEnv) -> None:
        """Begin an episode at its first state."""

    def act(self, env: ManipulationEnv) -> np.ndarray | None:
        """Return the next action, (A,) float32; None to end the recording."""


def key_frame_steps(steps: int, every: int) -> np.ndarray:
    """Return the steps of which the exact state is stored, (M,): 0, every, 2 every, ..., and the last."""
    return np.unique(np.append(np.arange(0, steps + 1, every), steps))


def record(
    env: ManipulationEnv, obj: ArticulatedObject, level: int, target: str, actor: Actor, store: StoreConfig
) -> Recording:
    """Play a level with an object and a target link to its end.

    Raises:
        DivergedError: the physics ran away.
    """
    env.reset(options={"level": level, "object": obj, "target": target})
    actor.begin(env)
    recorder = _Recorder(env, len(obj.joints), store)
    recorder.add_state(env)
    done = False
    while not done and (action := actor.act(env)) is not None:
        _, reward, terminated, truncated, info = env.step(action)
        recorder.add_step(action, actor.disturbed, reward, info["flags"])
        recorder.add_state(env)
        done = terminated or truncated
    return recorder.finish(env)


class _Recorder:
    """The steps and states so far."""

    def __init__(self, env: ManipulationEnv, joints: int, store: StoreConfig) -> None:
        self._actions: list[np.ndarray] = []
        self._disturbed: list[bool] = []
        self._rewards: list[float] = []
        self._flags: list[tuple[bool, ...]] = []
        self._store, self._joints = store, joints
        self._columns = Columns.of(_positions(env.snapshot, joints) | _velocities(env.snapshot, joints))
        self._frame_columns = Columns.of(_key_frame(env.save_state()))
        self._positions: list[np.ndarray] = []
        self._velocities: list[np.ndarray] = []
        self._digests: list[int] = []
        self._frames: list[np.ndarray] = []

    def add_step(self, action: np.ndarray, disturbed: bool, reward: float, flags: Mapping[str, bool]) -> None:
        self._actions.append(action)
        self._disturbed.append(disturbed)
        self._rewards.append(reward)
        self._flags.append(tuple(flags.values()))

    def add_state(self, env: ManipulationEnv) -> None:
        state, snapshot = env.save_state(), env.snapshot
        if len(self._digests) % self._store.key_frame_steps == 0:
            self._frames.append(joined(_key_frame(state)))
        self._digests.append(digest_of(state.simulation))
        self._positions.append(joined(_positions(snapshot, self._joints)))
        self._velocities.append(joined(_velocities(snapshot, self._joints)))

    def finish(self, env: ManipulationEnv) -> Recording:
        """Return the recording; the environment is still at the last state."""
        store = self._store
        if len(self._actions) % store.key_frame_steps:
            self._frames.append(joined(_key_frame(env.save_state())))
        positions = rounded(np.array(self._positions), store.position_bits)
        velocities = rounded(np.array(self._velocities), store.velocity_bits)
        return Recording(
            actions=np.array(self._actions, dtype=np.float32).reshape(-1, env.control.size),
            disturbed=np.array(self._disturbed, dtype=np.bool_),
            rewards=np.array(self._rewards, dtype=np.float64),
            flags=np.array(self._flags, dtype=np.bool_).reshape(-1, len(env.task.flag_names)),
            digests=np.array(self._digests, dtype=np.uint64),
            states=np.concatenate((positions, velocities), axis=1),
            key_frames=np.array(self._frames),
            state_columns=self._columns,
            key_frame_columns=self._frame_columns,
        )


def _positions(snapshot: Snapshot, joints: int) -> dict[str, np.ndarray]:
    """Return where everything is (B = 1); a snapshot is padded to more joints than the object has."""
    return {
        "robot_qpos": snapshot.robot_qpos[0],
        "object_qpos": snapshot.object_qpos[0, :joints],
        "root_position_w": snapshot.link_position_w[0, 0],
        "root_quaternion_w": snapshot.link_quaternion_w[0, 0],
        "prop_position_w": snapshot.prop_position_w[0],
    }


def _velocities(snapshot: Snapshot, joints: int) -> dict[str, np.ndarray]:
    """Return how fast everything moves (B = 1)."""
    return {
        "robot_qvel": snapshot.robot_qvel[0],
        "object_qvel": snapshot.object_qvel[0, :joints],
        "root_velocity_w": snapshot.root_velocity_w[0],
        "prop_velocity_w": snapshot.prop_velocity_w[0],
    }


def rounded(values: np.ndarray, bits: int) -> np.ndarray:
    """Round to multiples of 2**-bits, as float32: the zeros that follow are what makes it compress."""
    scale = 2.0**bits
    found: np.ndarray = (np.rint(values * scale) / scale).astype(np.float32)
    return found


def _key_frame(state: EnvState) -> dict[str, np.ndarray]:
    """Return all arrays that a state consists of, by name, without the batch dimension."""
    return simulation_arrays(state.simulation) | {STREAKS: np.asarray(state.streaks)}


def simulation_arrays(state: SimulationState) -> dict[str, np.ndarray]:
    """Return the arrays of a state of one environment."""
    values = {field.name: getattr(state, field.name) for field in fields(state)}
    return {name: value[0] for name, value in values.items() if isinstance(value, np.ndarray)}


def simulation_state(arrays: dict[str, np.ndarray], object_hash: str, settings: Settings) -> SimulationState:
    """Return the state with these `simulation_arrays`, of an object in a collection with these settings.

    Raises:
        DemoError: this version of the package has no such task.
    """
    batch = {name: value[None].copy() for name, value in arrays.items()}
    robot, physics, props = settings.setup
    return SimulationState(**batch, object_hash=object_hash, robot=robot, physics=physics, props=props)


def digest_of(state: SimulationState) -> int:
    """Return a digest of 64 bits of the physical state, which changes with any of its bits."""
    found = blake2b(digest_size=DIGEST_BYTES)
    for value in simulation_arrays(state).values():
        found.update(np.ascontiguousarray(value).data)
    return int.from_bytes(found.digest(), "little")
