"""What a folder of demonstrations holds, in numbers."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.config import to_mapping
from artiskill.demos.coverage import BIN_M, JOINT_BINS, REACH_M, Visits
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import Demos
from artiskill.demos.hdf5 import reading
from artiskill.demos.header import TargetCount
from artiskill.demos.settings import Settings


@dataclass(frozen=True)
class ObjectStats:
    """Numbers of one object.

    Attributes:
        object: id.
        wanted: successful trajectories that were asked for.
        trajectories: that are stored, kept failures included.
        attempts: that the expert made.
        successes: of them.
        success_rate: their ratio; 0 without attempts.
        gave_up: targets that were given up.
        shortest: of the stored trajectories, steps; 0 where there are none, as the next ones.
        mean_length: likewise.
        longest: likewise.
        bytes_per_trajectory: of the file.
        base_coverage: see `coverage.Visits`.
        object_coverage: likewise.
        targets: counts of each.
    """

    object: str
    wanted: int
    trajectories: int
    attempts: int
    successes: int
    success_rate: float
    gave_up: tuple[str, ...]
    shortest: int
    mean_length: float
    longest: int
    bytes_per_trajectory: float
    base_coverage: float
    object_coverage: float
    targets: tuple[TargetCount, ...]


@dataclass(frozen=True)
class Stats:
    """Numbers of a folder.

    Attributes:
        settings: of its files.
        objects: one by one.
    """

    settings: Settings
    objects: tuple[ObjectStats, ...]

    @property
    def trajectories(self) -> int:
        """In all."""
        return sum(one.trajectories for one in self.objects)

    @property
    def success_rate(self) -> float:
        """Of the expert, over all attempts."""
        attempts = sum(one.attempts for one in self.objects)
        return sum(one.successes for one in self.objects) / attempts if attempts else 0.0

    @property
    def bytes_per_trajectory(self) -> float:
        """Of all files."""
        size = sum(one.bytes_per_trajectory * one.trajectories for one in self.objects)
        return size / self.trajectories if self.trajectories else 0.0

    @property
    def mean_length(self) -> float:
        """Steps of a trajectory."""
        steps = sum(one.mean_length * one.trajectories for one in self.objects)
        return steps / self.trajectories if self.trajectories else 0.0

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return {
            "task": self.settings.task,
            "control_mode": self.settings.control_mode,
            "trajectories": self.trajectories,
            "success_rate": self.success_rate,
            "mean_length": self.mean_length,
            "bytes_per_trajectory": self.bytes_per_trajectory,
            "coverage": {"bin_m": BIN_M, "reach_m": REACH_M, "joint_bins": JOINT_BINS},
            "objects": [to_mapping(one) for one in self.objects],
        }


def folder_stats(folder: Path | str, on_object: Callable[[], None] | None = None) -> Stats:
    """Read every file of a folder.

    Raises:
        DemoError: the folder holds no demonstrations, or a file is damaged.
    """
    demos = Demos(folder)
    found = []
    for file in demos.files():
        with reading(file.path, "what is counted"):
            found.append(_object_stats(file))
        if on_object is not None:
            on_object()
    return Stats(demos.manifest.settings, tuple(found))


def _object_stats(file: DemoFile) -> ObjectStats:
    header, attempts = file.header, file.attempts
    stored = attempts[attempts["trajectory"] >= 0]
    visits = _visits(file, stored)
    successes, lengths = int(attempts["success"].sum()), stored["steps"]
    return ObjectStats(
        object=header.object,
        wanted=sum(count.wanted for count in header.targets),
        trajectories=len(file),
        attempts=len(attempts),
        successes=successes,
        success_rate=successes / len(attempts) if len(attempts) else 0.0,
        gave_up=tuple(count.target for count in header.targets if count.gave_up),
        shortest=int(lengths.min(initial=np.iinfo(np.int32).max)) if len(lengths) else 0,
        mean_length=float(lengths.mean()) if len(lengths) else 0.0,
        longest=int(lengths.max(initial=0)),
        bytes_per_trajectory=file.path.stat().st_size / len(file) if len(file) else 0.0,
        base_coverage=visits.base,
        object_coverage=visits.object,
        targets=header.targets,
    )


def _visits(file: DemoFile, stored: np.ndarray) -> Visits:
    header = file.header
    joints = {joint["link"]: (k, tuple(joint["limits"])) for k, joint in enumerate(header.facts["joints"])}
    visits = Visits(is_fixed=header.facts["category"] == "cabinet")
    for row in stored:
        target = header.targets[row["target"]].target
        joint, limits = joints.get(target, (0, (0.0, 1.0)))
        states = header.state_columns.split(file.array(int(row["trajectory"]), "states"))
        visits.add(states, target, joint, limits)
    return visits
