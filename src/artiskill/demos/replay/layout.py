"""A trajectory of a training file, written while it is played.

`traj_<i>` has `obs` as the environment nests it, T + 1 rows, and T rows of `actions`, `disturbed`, `rewards`,
`dones` and `success`. In the visual modes `obs/state` is another name of `obs/agent`, that of ManiSkill's own
loaders.
"""

from typing import Any

import gymnasium as gym
import numpy as np

from artiskill.demos.hdf5 import write_compressed

_CHUNK_BYTES = 1 << 17  # frames that are read and unpacked at once
_MOST_FRAMES = 256  # of a chunk
STATE, AGENT = "state", "agent"


def leaf_spaces(space: gym.Space[Any], name: str = STATE) -> dict[str, gym.spaces.Box]:
    """The arrays of an observation space by path, `pointcloud/xyz` say; one that is not nested is `state`."""
    if not isinstance(space, gym.spaces.Dict):
        assert isinstance(space, gym.spaces.Box), "observations are arrays"
        return {name: space}
    found: dict[str, gym.spaces.Box] = {}
    for key, below in space.items():
        found |= {path if path == key else f"{key}/{path}": leaf for path, leaf in leaf_spaces(below, key).items()}
    return found


def leaf_of(observation: Any, path: str) -> np.ndarray:
    """The array of an observation at a path of `leaf_spaces`."""
    if not isinstance(observation, dict):
        return np.asarray(observation)
    for key in path.split("/"):
        observation = observation[key]
    return np.asarray(observation)


class TrajectoryWriter:
    """Writes one trajectory; frames go to the file as soon as they fill a chunk.

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

    def observe(self, observation: Any) -> None:
        """The observation before the first step, or after one."""
        for path, frames in self._leaves.items():
            frames.add(leaf_of(observation, path))

    def step(self, action: np.ndarray, disturbed: bool, reward: float, success: bool) -> None:
        """A step; its observation follows."""
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
        level = self._compression
        write_compressed(self._group, "actions", np.array(self._actions, np.float32).reshape(-1, size), level)
        write_compressed(self._group, "disturbed", np.array(self._disturbed, np.bool_), level)
        write_compressed(self._group, "rewards", np.array(self._rewards, np.float64), level)
        write_compressed(self._group, "dones", np.arange(len(self)) == len(self) - 1, level)
        write_compressed(self._group, "success", np.array(self._successes, np.bool_), level)
        self._group.attrs.update(about)

    def __len__(self) -> int:
        """Steps so far."""
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
