"""The work of a replay: a worker replays some trajectories into a part, and the parts become a training file."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.config import to_mapping
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import FileEntry, sha256_of
from artiskill.demos.file_format import TRAINING
from artiskill.demos.hdf5 import (
    MOST_FRAMES_BYTES,
    TRAJECTORY,
    new_large_file,
    new_whole_file,
    open_file,
    reading,
    writing,
)
from artiskill.demos.replay_episode import Outcome, OutcomeCounts, TrajectoryWriter, restore, simulate
from artiskill.demos.settings import settings_hash
from artiskill.demos.training_file import SIMULATE, ReplaySettings, TrainingEntry
from artiskill.envs.control import Control
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import DemoError
from artiskill.files import atomic_write, parse_json, read_bytes
from artiskill.sensors.observations.cameras import Panorama

_OUTCOMES, _SOURCE = "outcomes", "source_sha256"
_PART_TRAJECTORY = "source_"  # and its number in the demonstrations: the group of a trajectory in a part
# a row of the dataset `outcomes`; `source` is the trajectory's number in the demonstrations, `trajectory` that in
# this file, -1 where it is not kept
_OUTCOME_TYPE = np.dtype(
    [
        ("source", "<i4"),
        ("success", "<i1"),
        ("exact", "<i1"),
        ("steps", "<i4"),
        ("clipped", "<i4"),
        ("trajectory", "<i4"),
    ]
)


@dataclass(frozen=True)
class ReplayedTrajectory:
    """What a worker reports of a trajectory."""

    frames: int  # observations that it has
    success: bool  # whether it is solved
    fault: str = ""  # what ended the episode before its end, and which; else empty


@dataclass(frozen=True, eq=False)
class ReplayJob:
    """Trajectories of one object for one worker."""

    settings: ReplaySettings  # of the training files
    path: Path  # of the file of demonstrations
    source_sha256: str  # of it
    object: str  # whose they are
    given: ArticulatedObject | None  # the object, where no name leads to it
    numbers: tuple[int, ...]  # of the trajectories
    part: Path  # where to write them; beside it, in `*.json`, what it was made from and its checksum

    @property
    def label(self) -> str:
        """The job's name in errors."""
        return f"object {self.object}, trajectories from {self.numbers[0]}"

    def is_done(self) -> bool:
        """Return whether the part is there, whole, and made from these demonstrations with these settings."""
        try:
            return bool(parse_json(read_bytes(self._seal_path)) == self._seal_content())
        except (DemoError, OSError, ValueError):
            return False

    def seal(self) -> None:
        """Write down what the part was made from, and its checksum.

        Raises:
            DemoError: it cannot be written.
        """
        with writing(self._seal_path), atomic_write(self._seal_path) as temporary:
            temporary.write_text(json.dumps(self._seal_content()) + "\n", encoding="utf-8")

    def check(self) -> None:
        """Raise `DemoError` unless the part is as it was when it was sealed."""
        if not self.is_done():
            raise DemoError(
                f"{str(self.part)!r} was changed or damaged since it was written; "
                "the same command replays its trajectories again"
            )

    @property
    def _seal_path(self) -> Path:
        return self.part.with_suffix(".json")

    def _seal_content(self) -> dict[str, Any]:
        return {
            _SOURCE: self.source_sha256,
            "settings_hash": settings_hash(self.settings),
            "numbers": list(self.numbers),
            "sha256": sha256_of(self.part),
        }


def run_replay_job(job: ReplayJob, send: Callable[[ReplayedTrajectory], None]) -> None:
    """Replay a job's trajectories, and send what came of each.

    Raises:
        DemoError: the demonstrations are damaged or do not fit, or the part cannot be written.
    """
    settings = job.settings
    with DemoFile(job.path) as demos:
        obj = demos.load_object(job.given)
        env = settings.make_env(obj)
        with new_whole_file(job.part) as file:
            outcomes = []
            for number in job.numbers:
                outcome = _replay_one(file, demos, number, env, obj, settings)
                outcomes.append(outcome)
                fault = f"{job.object}, trajectory {number}: {outcome.fault}" if outcome.fault else ""
                send(ReplayedTrajectory(outcome.steps + 1, outcome.success, fault))
            file.create_dataset(_OUTCOMES, data=_outcome_table(outcomes))
    job.seal()


def _replay_one(
    file: Any,
    demos: DemoFile,
    number: int,
    env: ManipulationEnv,
    obj: ArticulatedObject,
    settings: ReplaySettings,
) -> Outcome:
    trajectory = demos.trajectory(number)
    source = Control(env.task.robot, settings.source.control_mode)
    group = file.create_group(f"{_PART_TRAJECTORY}{number}")
    writer = TrajectoryWriter(group, env.observation_space, settings.compression)
    play = simulate if settings.way == SIMULATE else restore
    outcome = play(number, trajectory, env, obj, source, writer)
    is_wanted = outcome.success or settings.keep_failures
    if not (is_wanted and outcome.steps):  # one that diverges at once has no step to learn from
        del file[group.name]  # what it took in the file is not copied to the next one
        return outcome
    about = {
        "target": trajectory.target,
        "level": trajectory.level,
        "success": outcome.success,
        "exact": outcome.exact,
        "source": number,
    }
    writer.close(env.control.size, **about)
    return replace(outcome, kept=True)


def _outcome_table(outcomes: list[Outcome]) -> np.ndarray:
    table = np.zeros(len(outcomes), dtype=_OUTCOME_TYPE)
    kept = 0
    for row, outcome in zip(table, outcomes, strict=True):
        for name in ("source", "success", "exact", "steps", "clipped"):
            row[name] = getattr(outcome, name)
        row["trajectory"] = kept if outcome.kept else -1
        kept += outcome.kept
    return table


def _read_outcomes(file: Any, path: Path) -> list[Outcome]:
    with reading(path, _OUTCOMES):
        return [
            Outcome(
                source=int(row["source"]),
                success=bool(row["success"]),
                exact=bool(row["exact"]),
                steps=int(row["steps"]),
                clipped=int(row["clipped"]),
                kept=int(row["trajectory"]) >= 0,
            )
            for row in file[_OUTCOMES][()]
        ]


def merge_parts(
    path: Path, jobs: Sequence[ReplayJob], source: FileEntry, object_name: str, settings: ReplaySettings
) -> TrainingEntry:
    """Write the training file of an object; what is compressed is copied as it is.

    Args:
        path: of the file.
        jobs: all of the object, done, in order.
        source: of the demonstrations.
        object_name: as `load_object` takes it.
        settings: of the training files.

    Raises:
        DemoError: a part is damaged, or the file cannot be written.
    """
    outcomes: list[Outcome] = []
    for job in jobs:
        job.check()
    with new_large_file(path, sum(job.part.stat().st_size for job in jobs)) as file:
        for job in jobs:
            with open_file(job.part, MOST_FRAMES_BYTES) as part:
                for outcome in _read_outcomes(part, job.part):
                    if outcome.kept:
                        kept = sum(one.kept for one in outcomes)
                        part.copy(f"{_PART_TRAJECTORY}{outcome.source}", file, name=f"{TRAJECTORY}{kept}")
                    outcomes.append(outcome)
        file.create_dataset(_OUTCOMES, data=_outcome_table(outcomes))
        file.attrs.update(_attributes(settings, source, object_name))
    return TrainingEntry(
        object=source.object,
        name=object_name,
        content_hash=source.content_hash,
        source_sha256=source.sha256,
        sha256=sha256_of(path),
        bytes=path.stat().st_size,
        trajectories=sum(one.kept for one in outcomes),
        frames=sum(one.steps + 1 for one in outcomes if one.kept),
        counts=OutcomeCounts.of(outcomes),
    )


def _attributes(settings: ReplaySettings, source: FileEntry, object_name: str) -> dict[str, Any]:
    found: dict[str, Any] = {
        "format": TRAINING.name,
        "schema_version": TRAINING.version,
        "object": source.object,
        "name": object_name,
        "content_hash": source.content_hash,
        _SOURCE: source.sha256,
        "settings": json.dumps(to_mapping(settings)),
    }
    if settings.obs_mode == "rgbd":  # what it takes to project, the same in every frame: docs/observations.md
        panorama = Panorama(settings.make_task().cameras)
        matrices = panorama.parameters(panorama.views(0.0, 0.0, 0.0))
        found |= {name: matrices[name] for name in ("intrinsics", "robot_to_camera")}
    return found
