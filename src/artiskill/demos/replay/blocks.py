"""Trajectories of one object that a worker replays at a stretch, into a file of their own."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.hdf5 import new_whole_file, reading, writing
from artiskill.demos.manifest import sha256_of
from artiskill.demos.replay.episodes import Outcome, restore, simulate
from artiskill.demos.replay.layout import TrajectoryWriter
from artiskill.demos.replay.settings import SIMULATE, ReplaySettings
from artiskill.demos.settings import settings_hash
from artiskill.envs.control import Control
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import DemoError
from artiskill.files import atomic_write, parse_json, read_bytes

OUTCOMES, SOURCE = "outcomes", "source_sha256"
# a row of the dataset `outcomes`; `source` is the trajectory's number in the demonstrations, `trajectory` that in
# this file, -1 where it is not kept
OUTCOME_TYPE = np.dtype(
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
class Replayed:
    """News: one more trajectory.

    Attributes:
        frames: observations that it has.
        success: whether it is solved.
        fault: what ended it, where that was not the episode's end, and of what; else empty.
    """

    frames: int
    success: bool
    fault: str = ""


@dataclass(frozen=True, eq=False)
class Block:
    """Work for one worker.

    Attributes:
        settings: of the training files.
        path: of the file of demonstrations.
        source_sha256: of it.
        object: whose they are.
        given: the object, where no name leads to it.
        numbers: of the trajectories.
        part: where to write them; beside it, in `*.json`, what it was made from and its checksum.
    """

    settings: ReplaySettings
    path: Path
    source_sha256: str
    object: str
    given: ArticulatedObject | None
    numbers: tuple[int, ...]
    part: Path

    @property
    def label(self) -> str:
        """As errors call it."""
        return f"object {self.object}, trajectories from {self.numbers[0]}"

    def is_done(self) -> bool:
        """Whether its file is there, whole, and made from the same demonstrations with the same settings."""
        try:
            return bool(parse_json(read_bytes(self._seal_path)) == self._seal_content())
        except (DemoError, OSError, ValueError):
            return False

    def seal(self) -> None:
        """Write down what the file was made from, and its checksum.

        Raises:
            DemoError: it cannot be written.
        """
        with writing(self._seal_path), atomic_write(self._seal_path) as temporary:
            temporary.write_text(json.dumps(self._seal_content()) + "\n", encoding="utf-8")

    def check(self) -> None:
        """See whether the file is as it was when it was sealed.

        Raises:
            DemoError: it is not; it is replayed again next time.
        """
        if not self.is_done():
            raise DemoError(
                f"{str(self.part)!r} was changed or damaged since it was written; "
                "the same command replays its trajectories again"
            )

    @property
    def _seal_path(self) -> Path:
        return self.part.with_suffix(".json")

    def _seal_content(self) -> dict[str, Any]:
        """What the file as it is now is made from, and its checksum."""
        return {
            SOURCE: self.source_sha256,
            "settings_hash": settings_hash(self.settings),
            "numbers": list(self.numbers),
            "sha256": sha256_of(self.part),
        }


def run_block(block: Block, tell: Callable[[Replayed], None]) -> None:
    """Replay a block's trajectories, and tell of each.

    Raises:
        DemoError: the demonstrations are damaged or do not fit, or the part cannot be written.
    """
    settings = block.settings
    with DemoFile(block.path) as demos:
        obj = demos.load_object(block.given)
        env = settings.make_env(obj)
        source = Control(env.task.robot, settings.source.control_mode)
        with new_whole_file(block.part) as file:
            outcomes = []
            for number in block.numbers:
                outcome = _replay_one(file, demos, number, env, obj, source, settings)
                outcomes.append(outcome)
                fault = f"{block.object}, trajectory {number}: {outcome.fault}" if outcome.fault else ""
                tell(Replayed(outcome.steps + 1, outcome.success, fault))
            file.create_dataset(OUTCOMES, data=outcome_table(outcomes))
    block.seal()


def outcome_table(outcomes: list[Outcome]) -> np.ndarray:
    """The rows of `outcomes`."""
    table = np.zeros(len(outcomes), dtype=OUTCOME_TYPE)
    kept = 0
    for row, outcome in zip(table, outcomes, strict=True):
        for name in ("source", "success", "exact", "steps", "clipped"):
            row[name] = getattr(outcome, name)
        row["trajectory"] = kept if outcome.kept else -1
        kept += outcome.kept
    return table


def read_outcomes(file: Any, path: Path) -> list[Outcome]:
    """What `outcome_table` wrote.

    Raises:
        DemoError: it is damaged.
    """
    with reading(path, OUTCOMES):
        return [
            Outcome(
                source=int(row["source"]),
                success=bool(row["success"]),
                exact=bool(row["exact"]),
                steps=int(row["steps"]),
                clipped=int(row["clipped"]),
                kept=int(row["trajectory"]) >= 0,
            )
            for row in file[OUTCOMES][()]
        ]


def _replay_one(
    file: Any,
    demos: DemoFile,
    number: int,
    env: ManipulationEnv,
    obj: ArticulatedObject,
    source: Control,
    settings: ReplaySettings,
) -> Outcome:
    trajectory = demos.trajectory(number)
    group = file.create_group(f"source_{number}")
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
