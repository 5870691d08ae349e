"""The file of an object's demonstrations, schema version 2: header, table of attempts, trajectories."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import read_catalog
from artiskill.assets.names import PARTNET
from artiskill.config import from_mapping, to_mapping
from artiskill.demos.demonstrator import DemoAttempt
from artiskill.demos.hdf5 import TRAJECTORY, new_whole_file, write_compressed
from artiskill.demos.recording import ARRAYS, Columns
from artiskill.demos.settings import Settings
from artiskill.errors import DemoError
from artiskill.files import parse_json

ATTEMPTS = "attempts"
# a row of the dataset `attempts`; `target` counts the header's targets, `trajectory` is -1 where none is stored
ATTEMPT_TYPE = np.dtype(
    [("target", "<i4"), ("level", "<i4"), ("success", "<i1"), ("steps", "<i4"), ("trajectory", "<i4")]
)
# random bits: no use compressing them
_UNCOMPRESSED = ("digests",)


@dataclass(frozen=True)
class FileFormat:
    """A format of files, and of the manifest of a folder of them."""

    name: str  # of the format
    version: int  # of its schema
    holds: str  # what its files hold, for errors
    command: str  # that makes them
    readers: tuple[str, str]  # what opens a folder, and what opens a file
    advice: str = ""  # how a lost or damaged manifest is made anew, where that is possible

    def check(self, name: object, version: object, path: Path) -> None:
        """Raise `DemoError` unless a file or manifest is of this format and version."""
        if name != self.name:
            others = {other.name: other.readers for other in (DEMONSTRATIONS, TRAINING)}
            readers = others.get(str(name))
            hint = f": {readers[path.suffix != '.json']} reads what it holds" if readers else ""
            raise DemoError(f"{str(path)!r} holds no {self.holds} of artiskill{hint}")
        if version != self.version:
            raise DemoError(
                f"{str(path)!r} has schema version {version}; this version of artiskill reads {self.version}: "
                "use the version of artiskill that wrote it, or make it anew"
            )


DEMONSTRATIONS = FileFormat(
    name="artiskill-demonstrations",
    version=2,
    holds="demonstrations",
    command="collect",
    readers=("Demos", "DemoFile"),
    advice="; where it was lost or damaged, remove what is left of manifest.json and collect with the options of "
    "before: it is made anew from the files",
)
TRAINING = FileFormat(
    name="artiskill-training",
    version=2,
    holds="training files",
    command="replay",
    readers=("TrainingFiles", "TrainingFile"),
)


@dataclass(frozen=True)
class TargetCount:
    """What came of one target."""

    target: str  # link
    wanted: int  # successful trajectories
    successes: int  # that there are
    attempts: int  # that they took
    gave_up: bool  # whether fewer are there because too many attempts failed
    # what ended attempts before their end, `LinAlgError` say, and how many of them
    faults: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Header:
    """All of a file but its attempts and trajectories."""

    object: str  # id
    content_hash: str  # of the object
    # name for `load_object`, category, joints in the order of `object_qpos`; in the catalogue also seed, split and
    # family
    facts: dict[str, Any]
    settings: Settings  # of the collection
    targets: tuple[TargetCount, ...]  # what came of each
    flag_names: tuple[str, ...]  # of the columns of `flags`
    state_columns: Columns  # of `states`
    key_frame_columns: Columns  # of `key_frames`

    def to_attributes(self) -> dict[str, Any]:
        """Return the attributes of the file's root: texts, those of nested values JSON."""
        return {
            "format": DEMONSTRATIONS.name,
            "schema_version": DEMONSTRATIONS.version,
            "object": self.object,
            "content_hash": self.content_hash,
            "facts": json.dumps(self.facts),
            "settings": json.dumps(to_mapping(self.settings)),
            "targets": json.dumps(to_mapping(self.targets)),
            "flag_names": json.dumps(self.flag_names),
            "state_columns": json.dumps(self.state_columns.to_list()),
            "key_frame_columns": json.dumps(self.key_frame_columns.to_list()),
        }

    @classmethod
    def from_attributes(cls, given: Mapping[str, Any], path: Path) -> "Header":
        """Return the header with these `to_attributes`.

        Raises:
            DemoError: no file of ours, or one of another version.
            ValueError: an attribute is damaged.
        """
        DEMONSTRATIONS.check(given.get("format"), given.get("schema_version"), path)
        names = ("facts", "settings", "targets", "flag_names", "state_columns", "key_frame_columns")
        found = {name: parse_json(given[name]) for name in names}
        if not isinstance(found["facts"], dict) or not isinstance(found["facts"]["name"], str):
            raise ValueError("its facts are no mapping with a name")
        return cls(
            object=str(given["object"]),
            content_hash=str(given["content_hash"]),
            facts=found["facts"],
            settings=from_mapping(Settings, found["settings"], str(path)),
            targets=tuple(from_mapping(TargetCount, one, str(path)) for one in found["targets"]),
            flag_names=tuple(found["flag_names"]),
            state_columns=Columns.from_list(found["state_columns"]),
            key_frame_columns=Columns.from_list(found["key_frame_columns"]),
        )


def make_header(
    obj: ArticulatedObject,
    settings: Settings,
    targets: Sequence[TargetCount],
    flag_names: Sequence[str],
    attempts: Sequence[DemoAttempt],
) -> Header:
    """Return the header of a file with these attempts.

    Raises:
        DemoError: their recordings differ in their arrays.
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


def object_facts(obj: ArticulatedObject) -> dict[str, Any]:
    """Return what readers may want to know about an object without having it."""
    number = obj.metadata.get("partnet_id")
    facts: dict[str, Any] = {
        "category": obj.category,
        "name": f"{PARTNET}:{number}" if number else obj.id,
        "joints": [
            {
                "link": obj.links[k].name,
                "kind": joint.kind,
                "limits": [float(limit) if math.isfinite(limit) else None for limit in joint.limits],
            }
            for k, joint in zip(obj.jointed_links, obj.joints, strict=True)
        ],
    }
    listed = read_catalog().get(obj.id)
    if listed is not None:
        facts |= {"seed": listed[1].seed, "split": listed[1].split, "family": listed[1].family}
    return facts


def write_object_file(path: Path, header: Header, attempts: Sequence[DemoAttempt]) -> None:
    """Write the file of an object; it appears whole, and on the disk, or not at all.

    Args:
        path: of the file.
        header: see `make_header`.
        attempts: that count, by target and level; those with a recording become trajectories.

    Raises:
        DemoError: it cannot be written.
    """
    kept = [attempt for attempt in attempts if attempt.recording is not None]
    compression = header.settings.store.compression
    with new_whole_file(path) as file:
        file.attrs.update(header.to_attributes())
        file.create_dataset(ATTEMPTS, data=_attempt_table(header, attempts))
        for number, attempt in enumerate(kept):
            group = file.create_group(f"{TRAJECTORY}{number}")
            group.attrs.update({"target": attempt.target, "level": attempt.level, "success": attempt.success})
            for name in ARRAYS:
                values = getattr(attempt.recording, name)
                write_compressed(group, name, values, 0 if name in _UNCOMPRESSED else compression)


def _attempt_table(header: Header, attempts: Sequence[DemoAttempt]) -> np.ndarray:
    targets = [count.target for count in header.targets]
    table = np.zeros(len(attempts), dtype=ATTEMPT_TYPE)
    number = 0
    for row, attempt in zip(table, attempts, strict=True):
        is_kept = attempt.recording is not None
        row["target"], row["level"] = targets.index(attempt.target), attempt.level
        row["success"], row["steps"] = attempt.success, attempt.steps
        row["trajectory"] = number if is_kept else -1
        number += is_kept
    return table
