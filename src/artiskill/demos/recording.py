"""Recording an episode while it is played."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.demos.columns import Columns, joined
from artiskill.demos.config import StoreConfig
from artiskill.demos.instants import (
    digest_of,
    frame_of,
    positions_of,
    rounded_states,
    state_columns,
    velocities_of,
)
from artiskill.envs.manipulation import ManipulationEnv


class Player(Protocol):
    """Who acts in an episode that is recorded.

    Attributes:
        disturbed: whether the last action was another than the one who acts had wanted.
    """

    disturbed: bool

    def begin(self, env: ManipulationEnv) -> None:
        """Begin an episode at its first state."""

    def act(self, env: ManipulationEnv) -> np.ndarray | None:
        """The next action, (A,) float32; None to end the recording."""


@dataclass(frozen=True, eq=False)
class Recording:
    """An episode of T steps as it is stored; A actions, F flags.

    Attributes:
        actions: (T, A) float32.
        disturbed: (T,) bool, actions that are not what the expert wanted: they pushed it off its way.
        rewards: (T,) float64, dense.
        flags: (T, F) bool, which conditions have held long enough after each step.
        digests: (T + 1,) uint64, `digest_of` the state before the first and after each step.
        states: (T + 1, D) float32, rounded positions and velocities.
        key_frames: (M, W) float64, exact states.
        state_columns: which of the D are what.
        key_frame_columns: which of the W are what.
    """

    actions: np.ndarray
    disturbed: np.ndarray
    rewards: np.ndarray
    flags: np.ndarray
    digests: np.ndarray
    states: np.ndarray
    key_frames: np.ndarray
    state_columns: Columns
    key_frame_columns: Columns

    @property
    def success(self) -> bool:
        """Whether the task was solved at the end."""
        return bool(len(self.flags) and self.flags[-1].all())


# the arrays of a recording, each a dataset of a file
ARRAYS = ("actions", "disturbed", "rewards", "flags", "digests", "states", "key_frames")
# the one of them that does not follow from level and actions
UNREPEATED = "disturbed"


def key_frame_steps(steps: int, every: int) -> np.ndarray:
    """At which steps the exact state of an episode is kept, (M,): 0, every, 2 every, ..., and the last."""
    return np.unique(np.append(np.arange(0, steps + 1, every), steps))


def record(
    env: ManipulationEnv, obj: ArticulatedObject, level: int, target: str, player: Player, store: StoreConfig
) -> Recording:
    """Play a level to its end.

    Args:
        env: to play in.
        obj: the object to play with.
        level: which episode.
        target: link.
        player: who acts.
        store: what is kept.

    Raises:
        DivergedError: the physics ran away.
    """
    env.reset(options={"level": level, "object": obj, "target": target})
    player.begin(env)
    tape = _Tape(env, len(obj.joints), store)
    tape.look(env)
    done = False
    while not done and (action := player.act(env)) is not None:
        _, reward, terminated, truncated, info = env.step(action)
        tape.add(action, player.disturbed, reward, info["flags"])
        tape.look(env)
        done = terminated or truncated
    return tape.wind_up(env)


class _Tape:
    """What was seen so far."""

    def __init__(self, env: ManipulationEnv, joints: int, store: StoreConfig) -> None:
        self._actions: list[np.ndarray] = []
        self._disturbed: list[bool] = []
        self._rewards: list[float] = []
        self._flags: list[tuple[bool, ...]] = []
        self._store, self._joints = store, joints
        self._columns = state_columns(env.snapshot, joints)
        self._frame_columns = Columns.of(frame_of(env.save_state()))
        self._positions: list[np.ndarray] = []
        self._velocities: list[np.ndarray] = []
        self._digests: list[int] = []
        self._frames: list[np.ndarray] = []

    def add(self, action: np.ndarray, disturbed: bool, reward: float, flags: Mapping[str, bool]) -> None:
        """Take down a step."""
        self._actions.append(action)
        self._disturbed.append(disturbed)
        self._rewards.append(reward)
        self._flags.append(tuple(flags.values()))

    def look(self, env: ManipulationEnv) -> None:
        """Take down an instant."""
        state, snapshot = env.save_state(), env.snapshot
        if len(self._digests) % self._store.key_frame_steps == 0:
            self._frames.append(joined(frame_of(state)))
        self._digests.append(digest_of(state.simulation))
        self._positions.append(joined(positions_of(snapshot, self._joints)))
        self._velocities.append(joined(velocities_of(snapshot, self._joints)))

    def wind_up(self, env: ManipulationEnv) -> Recording:
        """The recording; the environment is still at the last instant."""
        if len(self._actions) % self._store.key_frame_steps:
            self._frames.append(joined(frame_of(env.save_state())))
        size, flags = env.control.size, env.task.flag_names
        return Recording(
            actions=np.array(self._actions, dtype=np.float32).reshape(-1, size),
            disturbed=np.array(self._disturbed, dtype=np.bool_),
            rewards=np.array(self._rewards, dtype=np.float64),
            flags=np.array(self._flags, dtype=np.bool_).reshape(-1, len(flags)),
            digests=np.array(self._digests, dtype=np.uint64),
            states=rounded_states(np.array(self._positions), np.array(self._velocities), self._store),
            key_frames=np.array(self._frames),
            state_columns=self._columns,
            key_frame_columns=self._frame_columns,
        )
