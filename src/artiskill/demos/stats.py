"""What a folder of demonstrations holds, in numbers: successes, lengths, sizes, and how much it covers."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.config import to_mapping
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import Demos
from artiskill.demos.file_format import TargetCount
from artiskill.demos.hdf5 import reading
from artiskill.demos.settings import Settings
from artiskill.geometry.rotations import quat_to_matrix

# The base's position on the floor in the frame of the object's root, and a free object's in the world, whose
# origin is where it shall go: squares of this size, out to this distance along each axis.
BIN_M = 0.25
REACH_M = 2.5
# The target joint's share of its range, closed to fully open.
JOINT_BINS = 20


@dataclass(frozen=True)
class ObjectStats:
    """Numbers of one object."""

    object: str  # id
    wanted: int  # successful trajectories that were asked for
    trajectories: int  # that are stored, kept failures included
    attempts: int  # that the expert made
    successes: int  # of them
    success_rate: float  # their ratio; 0 without attempts
    gave_up: tuple[str, ...]  # targets that were given up
    shortest: int  # steps of the stored trajectories; this and the next two are 0 where there are none
    mean_length: float
    longest: int
    bytes_per_trajectory: float  # of the file
    base_coverage: float  # see `Coverage`
    object_coverage: float  # see `Coverage`
    targets: tuple[TargetCount, ...]  # counts of each


@dataclass(frozen=True)
class Stats:
    """Numbers of a folder."""

    settings: Settings  # of its files
    objects: tuple[ObjectStats, ...]  # one by one

    @property
    def trajectories(self) -> int:
        """Number of trajectories."""
        return sum(one.trajectories for one in self.objects)

    @property
    def success_rate(self) -> float:
        """Success rate of the expert, over all attempts."""
        attempts = sum(one.attempts for one in self.objects)
        return sum(one.successes for one in self.objects) / attempts if attempts else 0.0

    @property
    def bytes_per_trajectory(self) -> float:
        """Mean size of a trajectory."""
        size = sum(one.bytes_per_trajectory * one.trajectories for one in self.objects)
        return size / self.trajectories if self.trajectories else 0.0

    @property
    def mean_length(self) -> float:
        """Mean steps of a trajectory."""
        steps = sum(one.mean_length * one.trajectories for one in self.objects)
        return steps / self.trajectories if self.trajectories else 0.0

    def to_mapping(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
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
    coverage = _coverage(file, stored)
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
        base_coverage=coverage.base,
        object_coverage=coverage.object,
        targets=header.targets,
    )


def _coverage(file: DemoFile, stored: np.ndarray) -> "Coverage":
    header = file.header
    joints = {joint["link"]: (k, tuple(joint["limits"])) for k, joint in enumerate(header.facts["joints"])}
    coverage = Coverage(is_fixed=header.facts["category"] == "cabinet")
    for row in stored:
        target = header.targets[row["target"]].target
        joint, limits = joints.get(target, (0, (0.0, 1.0)))
        states = header.state_columns.split(file.array(int(row["trajectory"]), "states"))
        coverage.add(states, target, joint, limits)
    return coverage


class Coverage:
    """How much of what could be visited was: shares of bins, comparable from folder to folder.

    Args:
        is_fixed: whether only the object's joints can move.
    """

    def __init__(self, is_fixed: bool) -> None:
        side = round(2 * REACH_M / BIN_M)
        self._is_fixed = is_fixed
        self._base = np.zeros((side, side), dtype=bool)
        self._object: dict[str, np.ndarray] = {}
        self._floor = np.zeros((side, side), dtype=bool)

    def add(self, states: dict[str, np.ndarray], target: str, joint: int, limits: tuple[float, float]) -> None:
        """Add a trajectory.

        Args:
            states: as `Trajectory.states`.
            target: link.
            joint: its joint's number; ignored for an object that is free to move.
            limits: of this joint.
        """
        base, root = states["robot_qpos"][:, :2], states["root_position_w"][:, :2]
        turn = quat_to_matrix(states["root_quaternion_w"].astype(np.float64))[:, :2, :2]
        _mark(self._base, np.einsum("tji,tj->ti", turn, base - root))
        if not self._is_fixed:
            _mark(self._floor, root)
            return
        bins = self._object.setdefault(target, np.zeros(JOINT_BINS, dtype=bool))
        share = (states["object_qpos"][:, joint] - limits[0]) / (limits[1] - limits[0])
        bins[np.clip((share * JOINT_BINS).astype(int), 0, JOINT_BINS - 1)] = True

    @property
    def base(self) -> float:
        """Share of the squares around the object that the robot's base was in."""
        return float(self._base.mean())

    @property
    def object(self) -> float:
        """Share of the target joints' ranges, or of the squares of the floor, that the object was in."""
        if not self._is_fixed:
            return float(self._floor.mean())
        return float(np.mean([bins.mean() for bins in self._object.values()])) if self._object else 0.0


def _mark(bins: np.ndarray, points: np.ndarray) -> None:
    """Mark the squares of (T, 2) points; those beyond `REACH_M` are left out."""
    cells = np.floor((points + REACH_M) / BIN_M).astype(int)
    inside = ((cells >= 0) & (cells < len(bins))).all(axis=1)
    bins[cells[inside, 0], cells[inside, 1]] = True
