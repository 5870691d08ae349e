"""Folders of training files so small that their sets can be checked by hand; nothing is simulated."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.config import to_mapping
from artiskill.demos.demos import load_demo_pack, sha256_of, write_manifest
from artiskill.demos.file_format import TRAINING
from artiskill.demos.hdf5 import load_h5py
from artiskill.demos.replay_episode import OutcomeCounts
from artiskill.demos.training_file import ReplaySettings, Sampling, TrainingEntry, TrainingManifest

SAMPLING = Sampling(4, "uniform", "robot")
MASKS, AGENT, ACTION = 2, 3, 2


@dataclass(frozen=True)
class Episode:
    """One trajectory of a training file."""

    target: str
    steps: int = 3
    success: bool = True
    disturbed: tuple[int, ...] = ()  # steps
    level: int = 0

    def arrays(self, rng: np.random.Generator, points: int) -> dict[str, np.ndarray]:
        """Random observations, the last point of each padding; actions count the steps."""
        frames = self.steps + 1
        real = np.arange(points) < max(points - 1, 1)
        last = np.arange(self.steps) == self.steps - 1
        return {
            "obs/pointcloud/xyz": rng.uniform(0.1, 1, (frames, points, 3)).astype(np.float32) * real[:, None],
            "obs/pointcloud/rgb": rng.integers(0, 256, (frames, points, 3), dtype=np.uint8),
            "obs/pointcloud/seg": rng.random((frames, points, MASKS)) < 0.5,
            "obs/agent": rng.normal(size=(frames, AGENT)).astype(np.float32),
            "actions": (np.arange(self.steps)[:, None] / [10, 100]).astype(np.float32),
            "disturbed": np.isin(np.arange(self.steps), self.disturbed),
            "rewards": -np.arange(self.steps, 0, -1, dtype=np.float64),
            "dones": last,
            "success": last & self.success,
        }


FILES: dict[str, Sequence[Episode]] = {
    "cabinet-0002": [
        Episode("link_0", steps=3, level=5),
        Episode("link_0", steps=2, disturbed=(0,), level=6),
        Episode("link_0", steps=4, success=False),
    ],
    "cabinet-0020": [Episode("link_1", steps=5, disturbed=(1, 2)), Episode("link_0", steps=1)],
}


def settings(**changes: Any) -> ReplaySettings:
    """Of the demonstration pack's drawers."""
    values = ReplaySettings(
        source=load_demo_pack("OpenCabinetDrawer").manifest.settings,
        obs_mode="pointcloud",
        control_mode="joint",
        way="simulate",
        sampling=SAMPLING,
        seen={},
        count=None,
        keep_failures=True,
        compression=0,
        versions={},
    )
    return replace(values, **changes)


def write_files(
    folder: Path, files: dict[str, Sequence[Episode]] = FILES, made: ReplaySettings | None = None, seed: int = 0
) -> Path:
    """Write a folder of training files."""
    made = made or settings()
    points = 8 if made.sampling is None else made.sampling.num_points
    folder.mkdir(parents=True)
    manifest, rng = TrainingManifest(made), np.random.default_rng(seed)
    for name, episodes in files.items():
        path = folder / f"{name}.h5"
        with load_h5py().File(path, "w") as file:
            about = {"object": name, "name": name, "settings": made_text(made)}
            file.attrs.update({"format": TRAINING.name, "schema_version": TRAINING.version, **about})
            for number, episode in enumerate(episodes):
                group = file.create_group(f"traj_{number}")
                group.attrs.update({"target": episode.target, "level": episode.level, "success": episode.success})
                for array, values in episode.arrays(rng, points).items():
                    group[array] = values
        manifest = manifest.with_file(path.name, _entry(path, name, episodes))
    write_manifest(manifest, folder)
    return folder


def made_text(made: ReplaySettings) -> str:
    """Settings as a file has them."""
    import json

    return json.dumps(to_mapping(made))


def _entry(path: Path, name: str, episodes: Sequence[Episode]) -> TrainingEntry:
    frames = sum(episode.steps + 1 for episode in episodes)
    counts = OutcomeCounts(len(episodes), sum(e.success for e in episodes), 0, frames - len(episodes), 0)
    return TrainingEntry(name, name, "", "", sha256_of(path), path.stat().st_size, len(episodes), frames, counts)


def change_file(folder: Path, name: str, change: Any) -> None:
    """Let `change` change an open file, and sign it again."""
    from artiskill.demos.training_file import TrainingFiles

    manifest = TrainingFiles(folder).manifest
    path = folder / f"{name}.h5"
    with load_h5py().File(path, "r+") as file:
        change(file)
    entry = replace(manifest.files[path.name], sha256=sha256_of(path), bytes=path.stat().st_size)
    write_manifest(manifest.with_file(path.name, entry), folder)
