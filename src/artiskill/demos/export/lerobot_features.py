"""What the columns and videos of a LeRobotDataset are, and how they come out of a training file."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

from artiskill.demos.replay_episode import AGENT, STATE, leaf_spaces
from artiskill.demos.training_file import ReplaySettings
from artiskill.envs.control import JOINT
from artiskill.errors import ConfigError
from artiskill.tasks.state_vector import ObservationField, robot_fields
from artiskill.tasks.task import Task

_CHANNELS = 3
_CAMERAS = ("front", "left", "right")  # in the order of the task's
_TRUNK = ("base x", "base y", "base yaw", "lift")
_FINGERS = ("finger 1", "finger 2")
_JOINTS = tuple(f"joint {k} velocity" for k in range(1, 8))
_TWIST = ("hand x", "hand y", "hand z", "hand roll", "hand pitch", "hand yaw", "null motion")


@dataclass(frozen=True, eq=False)
class Feature:
    """One column, or one video.

    Attributes:
        key: its name.
        dtype: of its numbers; `video` for a video, `image` for pictures that are kept as they are.
        shape: of a frame.
        names: of its numbers, or of its axes.
        read: a training file's trajectory -> (T or T + 1, ...).
    """

    key: str
    dtype: str
    shape: tuple[int, ...]
    names: tuple[str, ...] | None
    read: Callable[[Any], np.ndarray]


class Layout:
    """All features of a dataset.

    Args:
        settings: of the training files.
        spaces: of observations and actions.

    Attributes:
        robot: name.
        frames_per_s: of the data.
        columns: those in Parquet, the indices and masks included.
        videos: the others, in files of their own.

    Raises:
        ConfigError: pictures of an odd number of pixels.
    """

    def __init__(self, settings: ReplaySettings, spaces: tuple[Any, Any]) -> None:
        task = settings.make_task()
        self.robot, self.frames_per_s = task.robot.name, round(1.0 / task.physics.step_s)
        leaves = leaf_spaces(spaces[0])
        self.videos, masks = _pictures(task, leaves)
        self._own = (
            *_observed(task, leaves),
            *masks,
            Feature(
                "action",
                "float32",
                spaces[1].shape,
                action_names(settings.control_mode, len(task.robot.mounts)),
                lambda group: group["actions"][()],
            ),
            Feature("disturbed", "bool", (1,), None, lambda group: group["disturbed"][()]),
            Feature("next.reward", "float32", (1,), None, lambda group: group["rewards"][()].astype(np.float32)),
            Feature("next.done", "bool", (1,), None, lambda group: group["dones"][()]),
            Feature("next.success", "bool", (1,), None, lambda group: group["success"][()]),
        )
        self.columns = self._own + tuple(
            Feature(key, "float32" if key == "timestamp" else "int64", (1,), None, _never)
            for key in ("timestamp", "frame_index", "episode_index", "index", "task_index")
        )

    def read(self, group: Any) -> dict[str, np.ndarray]:
        """The columns of a trajectory but for the indices, T rows each."""
        count = len(group["actions"])
        return {feature.key: feature.read(group)[:count] for feature in self._own}

    def to_mapping(self) -> dict[str, Any]:
        """As `info.json` has them."""
        found: dict[str, dict[str, Any]] = {}
        for feature in (*self.videos, *self.columns):
            names = None if feature.names is None else list(feature.names)
            found[feature.key] = {"dtype": feature.dtype, "shape": list(feature.shape), "names": names}
        for feature in self.videos:
            found[feature.key]["info"] = {
                "video.height": feature.shape[0],
                "video.width": feature.shape[1],
                "video.codec": "h264",
                "video.pix_fmt": "yuv420p",
                "video.is_depth_map": False,
                "video.fps": self.frames_per_s,
                "video.channels": feature.shape[2],
                "has_audio": False,
            }
        return found


def action_names(mode: str, arms: int) -> tuple[str, ...]:
    """What the numbers of an action are, docs/control.md."""
    arm = (*(_JOINTS if mode == JOINT else _TWIST), *_FINGERS)
    prefixes = [""] if arms == 1 else [f"arm {k + 1} " for k in range(arms)]
    return (*_TRUNK, *(prefix + name for prefix in prefixes for name in arm))


def _observed(task: Task, leaves: dict[str, gym.spaces.Box]) -> list[Feature]:
    """The vector, and the arrays of point clouds."""
    vector = AGENT if AGENT in leaves else STATE
    fields = robot_fields(len(task.robot.mounts)) if vector == AGENT else task.state_fields
    found = [
        Feature(
            "observation.state", "float32", leaves[vector].shape, _field_names(fields), _reader(f"obs/{vector}")
        )
    ]
    for path, space in leaves.items():
        if path.startswith("pointcloud/"):
            key = f"observation.{path.replace('/', '.')}"
            dtype = "uint8" if space.dtype == np.bool_ else str(space.dtype)
            found.append(Feature(key, dtype, space.shape, ("point", "channel"), _reader(f"obs/{path}", dtype)))
    return found


def _pictures(task: Task, leaves: dict[str, gym.spaces.Box]) -> tuple[tuple[Feature, ...], tuple[Feature, ...]]:
    """A video per camera; and pictures of its masks, white where they are, if they are three at most.

    Videos are not exact, least of all where little is to be seen. Masks must be, and are small as PNG.
    """
    if "rgbd/rgb" not in leaves:
        return (), ()
    cameras, masks = task.cameras, len(task.mask_names)
    shape = (cameras.height, cameras.width, _CHANNELS)
    if cameras.height % 2 or cameras.width % 2:
        raise ConfigError(f"videos need pictures of even sides, not {cameras.width} x {cameras.height}")
    names = ("height", "width", "channel")
    numbers = range(cameras.number)
    keys = [f"observation.images.{name}" for name in camera_names(cameras.number)]
    videos = tuple(Feature(keys[k], "video", shape, names, _colours(k)) for k in numbers)
    if masks > _CHANNELS:
        return videos, ()
    return videos, tuple(Feature(f"{keys[k]}_masks", "image", shape, names, _masks(k, masks)) for k in numbers)


def camera_names(number: int) -> tuple[str, ...]:
    """What the cameras are called; where they look to is known of the usual three."""
    return _CAMERAS if number == len(_CAMERAS) else tuple(f"camera_{k}" for k in range(number))


def _colours(camera: int) -> Callable[[Any], np.ndarray]:
    start = _CHANNELS * camera
    return lambda group: group["obs/rgbd/rgb"][..., start : start + _CHANNELS]


def _masks(camera: int, masks: int) -> Callable[[Any], np.ndarray]:
    def read(group: Any) -> np.ndarray:
        seg = group["obs/rgbd/seg"][..., masks * camera : masks * (camera + 1)]
        found = np.zeros((*seg.shape[:-1], _CHANNELS), dtype=np.uint8)
        found[..., :masks] = seg * np.uint8(255)
        return found

    return read


def _reader(path: str, dtype: str = "float32") -> Callable[[Any], np.ndarray]:
    return lambda group: group[path][()].astype(dtype)


def _field_names(fields: tuple[ObservationField, ...]) -> tuple[str, ...]:
    return tuple(f"{field.name} [{k}]" for field in fields for k in range(field.size))


def _never(group: Any) -> np.ndarray:
    raise AssertionError("indices are not read but counted")
