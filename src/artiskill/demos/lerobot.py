"""LeRobotDataset v3.0: numbers and masks in Parquet, cameras as videos, episodes and statistics beside them.

Each frame is an observation and the action taken there; the last observation of an episode, after its last action,
is left out. LeRobot, which needs torch, is not needed to write.
"""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from artiskill.demos.hdf5 import reading
from artiskill.demos.lerobot_files import (
    FILES_PER_CHUNK,
    EpisodeTable,
    Feature,
    FrameTable,
    VideoFile,
    stats_of,
    total_stats,
    write_tasks,
)
from artiskill.demos.replay_episode import AGENT, STATE, leaf_spaces
from artiskill.demos.training_file import ReplaySettings, TrainingFile, TrainingFiles
from artiskill.envs.control import JOINT
from artiskill.errors import ConfigError
from artiskill.tasks.state_vector import robot_fields
from artiskill.tasks.task import Task

VERSION = "v3.0"
_DATA_MB, _VIDEO_MB = 100, 200
_DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
# for language-conditioned policies
_INSTRUCTIONS = {
    "OpenCabinetDoor": "Open the marked door of the cabinet.",
    "OpenCabinetDrawer": "Open the marked drawer of the cabinet.",
    "PushChair": "Push the chair to the target and leave it standing there.",
    "MoveBucket": "Lift the bucket onto the platform without losing the ball.",
}
_CHANNELS = 3
_CAMERAS = ("front", "left", "right")  # in the order of the task's
_TRUNK = ("base x", "base y", "base yaw", "lift")
_FINGERS = ("finger 1", "finger 2")
_JOINTS = tuple(f"joint {k} velocity" for k in range(1, 8))
_TWIST = ("hand x", "hand y", "hand z", "hand roll", "hand pitch", "hand yaw", "null motion")


@contextmanager
def lerobot_writer(
    folder: Path, training: TrainingFiles, name: str
) -> Iterator[Callable[[TrainingFile, Any], None]]:
    """Yield what adds an episode to a LeRobotDataset; tables of episodes and statistics are written at the end.

    Raises:
        ConfigError: cameras of a size that the videos cannot have.
        MissingExtraError: pyarrow or imageio-ffmpeg is not installed.
    """
    writer = _Writer(folder, training)
    try:
        yield writer.add
        for video in writer.videos.values():
            video.finish()
    finally:
        writer.close()
    writer.write_tables()


class _Writer:
    """A dataset in progress."""

    def __init__(self, folder: Path, training: TrainingFiles) -> None:
        task = training.settings.source.task
        self._folder, self._instruction = folder, instruction_of(task)
        self._features = features = LeRobotFeatures(training.settings, training.spaces)
        self._frames = FrameTable(folder, _DATA_PATH, features.columns, _DATA_MB)
        self._episodes = EpisodeTable(folder)
        rate = features.frames_per_s
        self.videos = {feature.key: VideoFile(folder, _VIDEO_PATH, feature, rate) for feature in features.videos}
        self._count = self._total = 0

    def add(self, source: TrainingFile, group: Any) -> None:
        """Write an episode's rows and pictures."""
        with reading(source.path, group.name):
            columns = self._features.read(group)
        count = len(columns["action"])
        columns |= {
            "timestamp": (np.arange(count) / self._features.frames_per_s).astype(np.float32),
            "frame_index": np.arange(count),
            "episode_index": np.full(count, self._count),
            "index": np.arange(self._total, self._total + count),
            "task_index": np.zeros(count, dtype=np.int64),
        }
        stats = {key: stats_of(values) for key, values in columns.items()}
        chunk, file = divmod(self._frames.add(columns), FILES_PER_CHUNK)
        row: dict[str, Any] = {
            "episode_index": self._count,
            "tasks": [self._instruction],
            "length": count,
            "dataset_from_index": self._total,
            "dataset_to_index": self._total + count,
            "object": source.object,
            "target": str(group.attrs["target"]),
            "level": int(group.attrs["level"]),
            "data/chunk_index": chunk,
            "data/file_index": file,
        }
        for feature in self._features.videos:
            with reading(source.path, group.name):
                pictures = feature.read(group)[:count]
            row |= self.videos[feature.key].add(pictures)
            stats[feature.key] = stats_of(pictures)
        self._episodes.add(row, stats)
        self._count, self._total = self._count + 1, self._total + count

    def close(self) -> None:
        """Close all files."""
        self._frames.close()
        for video in self.videos.values():
            video.close()

    def write_tables(self) -> None:
        """Write what describes the frames."""
        self._episodes.write()
        write_tasks(self._folder, self._instruction)
        for name, content in (("info", self._info()), ("stats", total_stats(self._episodes.stats))):
            text = json.dumps(content, indent=1) + "\n"
            (self._folder / f"meta/{name}.json").write_text(text, encoding="utf-8")

    def _info(self) -> dict[str, Any]:
        features = self._features
        return {
            "codebase_version": VERSION,
            "robot_type": f"artiskill_{features.robot}",
            "total_episodes": self._count,
            "total_frames": self._total,
            "total_tasks": 1,
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": _DATA_MB,
            "video_files_size_in_mb": _VIDEO_MB,
            "fps": features.frames_per_s,
            "splits": {"train": f"0:{self._count}"},
            "data_path": _DATA_PATH,
            "video_path": _VIDEO_PATH if features.videos else None,
            "features": features.to_mapping(),
        }


class LeRobotFeatures:
    """All features of a dataset, and how they come out of a training file.

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
        names = action_names(settings.control_mode, len(task.robot.mounts))
        self._own = (
            *_observed(task, leaves),
            *masks,
            Feature("action", "float32", spaces[1].shape, names, _reader("actions")),
            Feature("disturbed", "bool", (1,), None, _reader("disturbed", "bool")),
            Feature("next.reward", "float32", (1,), None, _reader("rewards")),
            Feature("next.done", "bool", (1,), None, _reader("dones", "bool")),
            Feature("next.success", "bool", (1,), None, _reader("success", "bool")),
        )
        self.columns = self._own + tuple(
            Feature(key, "float32" if key == "timestamp" else "int64", (1,), None, _never)
            for key in ("timestamp", "frame_index", "episode_index", "index", "task_index")
        )

    def read(self, group: Any) -> dict[str, np.ndarray]:
        """Return the columns of a trajectory but for the indices, T rows each."""
        count = len(group["actions"])
        return {feature.key: feature.read(group)[:count] for feature in self._own}

    def to_mapping(self) -> dict[str, Any]:
        """Return the features as `info.json` has them."""
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
    """Return what the numbers of an action are, docs/control.md."""
    arm = (*(_JOINTS if mode == JOINT else _TWIST), *_FINGERS)
    prefixes = [""] if arms == 1 else [f"arm {k + 1} " for k in range(arms)]
    return (*_TRUNK, *(prefix + name for prefix in prefixes for name in arm))


def _observed(task: Task, leaves: dict[str, gym.spaces.Box]) -> list[Feature]:
    """Return the vector, and the arrays of point clouds."""
    vector = AGENT if AGENT in leaves else STATE
    fields = robot_fields(len(task.robot.mounts)) if vector == AGENT else task.state_fields
    names = tuple(f"{field.name} [{k}]" for field in fields for k in range(field.size))
    found = [Feature("observation.state", "float32", leaves[vector].shape, names, _reader(f"obs/{vector}"))]
    for path, space in leaves.items():
        if path.startswith("pointcloud/"):
            key = f"observation.{path.replace('/', '.')}"
            dtype = "uint8" if space.dtype == np.bool_ else str(space.dtype)
            found.append(Feature(key, dtype, space.shape, ("point", "channel"), _reader(f"obs/{path}", dtype)))
    return found


def _pictures(task: Task, leaves: dict[str, gym.spaces.Box]) -> tuple[tuple[Feature, ...], tuple[Feature, ...]]:
    """Return a video per camera; and pictures of its masks, white where they are, if they are three at most.

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


def instruction_of(task: str) -> str:
    """Return what a task asks for, in a sentence; a task of one's own is told by its name."""
    return _INSTRUCTIONS.get(task, task)


def camera_names(number: int) -> tuple[str, ...]:
    """Return the cameras' names; where they look to is known of the usual three."""
    return _CAMERAS if number == len(_CAMERAS) else tuple(f"camera_{k}" for k in range(number))


def _reader(path: str, dtype: str = "float32") -> Callable[[Any], np.ndarray]:
    return lambda group: group[path][()].astype(dtype)


def _colours(camera: int) -> Callable[[Any], np.ndarray]:
    start = _CHANNELS * camera
    return lambda group: group["obs/rgbd/rgb"][..., start : start + _CHANNELS]


def _masks(camera: int, masks: int) -> Callable[[Any], np.ndarray]:
    return lambda group: mask_picture(group["obs/rgbd/seg"][..., masks * camera : masks * (camera + 1)])


def mask_picture(seg: np.ndarray) -> np.ndarray:
    """Return masks (..., k), at most three, as a picture (..., 3) uint8 that is white where they are."""
    found = np.zeros((*seg.shape[:-1], _CHANNELS), dtype=np.uint8)
    found[..., : seg.shape[-1]] = seg * np.uint8(255)
    return found


def _never(group: Any) -> np.ndarray:
    raise AssertionError("indices are not read but counted")
