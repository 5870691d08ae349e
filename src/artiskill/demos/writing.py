"""Writing the file of an object: header, attempts, trajectories."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.demos.attempts import Attempt
from artiskill.demos.columns import Columns
from artiskill.demos.hdf5 import new_whole_file, write_compressed
from artiskill.demos.header import Header, TargetCount, object_facts
from artiskill.demos.recording import ARRAYS
from artiskill.demos.settings import Settings
from artiskill.errors import DemoError

ATTEMPTS = "attempts"
# a row of the dataset `attempts`; `target` counts the header's targets, `trajectory` is -1 where none is stored
ATTEMPT_TYPE = np.dtype(
    [("target", "<i4"), ("level", "<i4"), ("success", "<i1"), ("steps", "<i4"), ("trajectory", "<i4")]
)
# random bits: no use compressing them
_UNCOMPRESSED = ("digests",)


def make_header(
    obj: ArticulatedObject,
    settings: Settings,
    targets: Sequence[TargetCount],
    flag_names: Sequence[str],
    attempts: Sequence[Attempt],
) -> Header:
    """The header of a file with these attempts.

    Raises:
        DemoError: they are not of one kind.
    """
    recordings = [attempt.recording for attempt in attempts if attempt.recording is not None]
    layouts = {(one.state_columns, one.key_frame_columns) for one in recordings}
    if len(layouts) > 1:
        raise DemoError(f"trajectories of {obj.id!r} differ in what they consist of; collect them anew")
    states, frames = layouts.pop() if layouts else (Columns(), Columns())
    return Header(
        object=obj.id,
        content_hash=obj.content_hash,
        facts=object_facts(obj),
        settings=settings,
        targets=tuple(targets),
        flag_names=tuple(flag_names),
        state_columns=states,
        key_frame_columns=frames,
    )


def write_object_file(path: Path, header: Header, attempts: Sequence[Attempt]) -> None:
    """Write the file; it appears whole, and on the disk, or not at all.

    Args:
        path: of the file.
        header: see `make_header`.
        attempts: that count, by target and level; those with a recording become trajectories.

    Raises:
        DemoError: it cannot be written.
    """
    with new_whole_file(path) as file:
        _fill(file, header, attempts)


def _fill(file: Any, header: Header, attempts: Sequence[Attempt]) -> None:
    file.attrs.update(header.to_attributes())
    file.create_dataset(ATTEMPTS, data=_table(header, attempts))
    compression = header.settings.store.compression
    number = 0
    for attempt in attempts:
        if attempt.recording is None:
            continue
        group = file.create_group(f"traj_{number}")
        group.attrs.update({"target": attempt.target, "level": attempt.level, "success": attempt.success})
        for name in ARRAYS:
            values = getattr(attempt.recording, name)
            write_compressed(group, name, values, 0 if name in _UNCOMPRESSED else compression)
        number += 1


def _table(header: Header, attempts: Sequence[Attempt]) -> np.ndarray:
    names = [count.target for count in header.targets]
    table = np.zeros(len(attempts), dtype=ATTEMPT_TYPE)
    number = 0
    for row, attempt in zip(table, attempts, strict=True):
        stored = attempt.recording is not None
        kept = number if stored else -1
        row["target"], row["level"] = names.index(attempt.target), attempt.level
        row["success"], row["steps"], row["trajectory"] = attempt.success, attempt.steps, kept
        number += stored
    return table
