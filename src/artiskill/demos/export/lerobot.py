"""LeRobotDataset v3.0: numbers and masks in Parquet, cameras as videos, episodes and statistics beside them.

Written without LeRobot, which needs torch; `LeRobotDataset(name, root=...)` reads it. Each frame is an observation
and the action taken there; the last observation of an episode, after its last action, is left out.
"""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.demos.export.folder import check_not_empty, new_folder
from artiskill.demos.export.lerobot_features import Layout
from artiskill.demos.export.lerobot_stats import add_up, stats_of
from artiskill.demos.export.lerobot_tables import EpisodeTable, FrameTable, write_tasks
from artiskill.demos.export.lerobot_videos import VideoFile
from artiskill.demos.hdf5 import reading
from artiskill.demos.training_file import TrainingFile, TrainingFiles
from artiskill.errors import ConfigError, shown

VERSION = "v3.0"
_FILES_PER_CHUNK = 1000
_DATA_MB, _VIDEO_MB = 100, 200
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_NAME = re.compile(r"(\w[-.\w]*/)*\w[-.\w]*")
# what a language-conditioned policy is told
INSTRUCTIONS = {
    "OpenCabinetDoor": "Open the marked door of the cabinet.",
    "OpenCabinetDrawer": "Open the marked drawer of the cabinet.",
    "PushChair": "Push the chair to the target and leave it standing there.",
    "MoveBucket": "Lift the bucket onto the platform without losing the ball.",
}


def export_lerobot(
    training: TrainingFiles,
    home: Path,
    name: str | None = None,
    on_trajectory: Callable[[], None] | None = None,
) -> Path:
    """Write a LeRobotDataset.

    Args:
        training: what is exported.
        home: LeRobot's folder of datasets, `HF_LEROBOT_HOME`.
        name: the dataset's id; by default of task, control mode and observation mode.
        on_trajectory: called after each.

    Returns:
        The dataset's folder.

    Raises:
        DemoError: a dataset of this name exists, the training files are damaged, or it cannot be written.
        ConfigError: a name that is no id of LeRobot, or cameras of a size that the videos cannot have.
        MissingExtraError: pyarrow or imageio-ffmpeg is not installed.
    """
    settings = training.settings
    if name is None:
        name = f"artiskill/{settings.source.task}-{settings.control_mode}-{settings.obs_mode}"
    if not _NAME.fullmatch(name):
        raise ConfigError(f"an id of LeRobot looks like artiskill/doors, not {shown(name)}")
    check_not_empty(training)
    layout = Layout(settings, training.spaces)
    path = home / name
    with new_folder(path) as folder:
        _Export(folder, layout, INSTRUCTIONS.get(settings.source.task, settings.source.task)).write(
            training, on_trajectory or (lambda: None)
        )
    return path


class _Export:
    """One export on its way."""

    def __init__(self, folder: Path, layout: Layout, instruction: str) -> None:
        self._folder, self._layout, self._instruction = folder, layout, instruction
        self._frames = FrameTable(folder, DATA_PATH, layout.columns, _DATA_MB)
        self._episodes = EpisodeTable(folder)
        self._videos = {
            feature.key: VideoFile(folder, VIDEO_PATH, feature, layout.frames_per_s) for feature in layout.videos
        }
        self._count = self._total = 0

    def write(self, training: TrainingFiles, tell: Callable[[], None]) -> None:
        """Everything."""
        try:
            for source in training.files(check=True):
                for group in source.groups:
                    self._episode(source, group)
                    tell()
            for video in self._videos.values():
                video.finish()
        finally:
            self._frames.close()
            for video in self._videos.values():
                video.close()
        self._episodes.write()
        write_tasks(self._folder, self._instruction)
        self._write_json("meta/info.json", self._info())
        self._write_json("meta/stats.json", add_up(self._episodes.stats))

    def _episode(self, source: TrainingFile, group: Any) -> None:
        with reading(source.path, group.name):
            columns = self._layout.read(group)
        count = len(columns["action"])
        row: dict[str, Any] = {
            "episode_index": self._count,
            "tasks": [self._instruction],
            "length": count,
            "dataset_from_index": self._total,
            "dataset_to_index": self._total + count,
            "object": source.object,
            "target": str(group.attrs["target"]),
            "level": int(group.attrs["level"]),
        }
        columns |= {
            "timestamp": (np.arange(count) / self._layout.frames_per_s).astype(np.float32),
            "frame_index": np.arange(count),
            "episode_index": np.full(count, self._count),
            "index": np.arange(self._total, self._total + count),
            "task_index": np.zeros(count, dtype=np.int64),
        }
        stats = {key: stats_of(values) for key, values in columns.items()}
        chunk, file = divmod(self._frames.add(columns), _FILES_PER_CHUNK)
        row |= {"data/chunk_index": chunk, "data/file_index": file}
        for feature in self._layout.videos:
            with reading(source.path, group.name):
                pictures = feature.read(group)[:count]
            row |= self._videos[feature.key].add(pictures)
            stats[feature.key] = stats_of(pictures)
        self._episodes.add(row, stats)
        self._count, self._total = self._count + 1, self._total + count

    def _info(self) -> dict[str, Any]:
        layout = self._layout
        return {
            "codebase_version": VERSION,
            "robot_type": f"artiskill_{layout.robot}",
            "total_episodes": self._count,
            "total_frames": self._total,
            "total_tasks": 1,
            "chunks_size": _FILES_PER_CHUNK,
            "data_files_size_in_mb": _DATA_MB,
            "video_files_size_in_mb": _VIDEO_MB,
            "fps": layout.frames_per_s,
            "splits": {"train": f"0:{self._count}"},
            "data_path": DATA_PATH,
            "video_path": VIDEO_PATH if layout.videos else None,
            "features": layout.to_mapping(),
        }

    def _write_json(self, name: str, content: Any) -> None:
        path = self._folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
