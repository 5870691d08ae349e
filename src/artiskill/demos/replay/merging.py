"""The training file of an object, out of the files that its blocks were replayed into."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from artiskill.config import to_mapping
from artiskill.demos.hdf5 import new_large_file, open_file
from artiskill.demos.hdf5_content import MOST_FRAMES_BYTES
from artiskill.demos.manifest import FileEntry, sha256_of
from artiskill.demos.replay.blocks import OUTCOMES, SOURCE, Block, outcome_table, read_outcomes
from artiskill.demos.replay.episodes import Outcome, OutcomeCounts
from artiskill.demos.replay.manifest import FORMAT, SCHEMA_VERSION, TrainingEntry
from artiskill.demos.replay.settings import ReplaySettings
from artiskill.sensors.observations.cameras import Panorama


def merge(
    path: Path, blocks: Sequence[Block], source: FileEntry, object_name: str, settings: ReplaySettings
) -> TrainingEntry:
    """Write the file; what is compressed is copied as it is.

    Args:
        path: of the file.
        blocks: replayed, in order.
        source: of the demonstrations.
        object_name: as `load_object` takes it.
        settings: of the training files.

    Raises:
        DemoError: a block's file is damaged, or the file cannot be written.
    """
    outcomes: list[Outcome] = []
    frames = kept = 0
    for block in blocks:
        block.check()
    with new_large_file(path, sum(block.part.stat().st_size for block in blocks)) as file:
        for block in blocks:
            with open_file(block.part, MOST_FRAMES_BYTES) as part:
                for outcome in read_outcomes(part, block.part):
                    outcomes.append(outcome)
                    if outcome.kept:
                        part.copy(f"source_{outcome.source}", file, name=f"traj_{kept}")
                        kept, frames = kept + 1, frames + outcome.steps + 1
        file.create_dataset(OUTCOMES, data=outcome_table(outcomes))
        file.attrs.update(
            {
                "format": FORMAT,
                "schema_version": SCHEMA_VERSION,
                "object": source.object,
                "name": object_name,
                "content_hash": source.content_hash,
                SOURCE: source.sha256,
                "settings": json.dumps(to_mapping(settings)),
            }
            | _camera_matrices(settings)
        )
    return TrainingEntry(
        object=source.object,
        name=object_name,
        content_hash=source.content_hash,
        source_sha256=source.sha256,
        sha256=sha256_of(path),
        bytes=path.stat().st_size,
        trajectories=kept,
        frames=frames,
        counts=OutcomeCounts.of(outcomes),
    )


def _camera_matrices(settings: ReplaySettings) -> dict[str, np.ndarray]:
    """What it takes to project with images, the same in every frame: docs/observations.md."""
    if settings.obs_mode != "rgbd":
        return {}
    panorama = Panorama(settings.make_task().cameras)
    found = panorama.parameters(panorama.rays(0.0, 0.0, 0.0))
    return {name: found[name] for name in ("intrinsics", "robot_to_camera")}
