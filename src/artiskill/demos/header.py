"""What a file of demonstrations says about itself: the schema, version 2."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import read_catalog
from artiskill.assets.names import PARTNET
from artiskill.config import from_mapping, to_mapping
from artiskill.demos.columns import Columns
from artiskill.demos.settings import Settings
from artiskill.errors import DemoError
from artiskill.files import parse_json

FORMAT = "artiskill-demonstrations"
SCHEMA_VERSION = 2
# what opens a folder, and a file, of each format of ours
_READERS = {FORMAT: ("Demos", "DemoFile"), "artiskill-training": ("TrainingFiles", "TrainingFile")}


@dataclass(frozen=True)
class TargetCount:
    """What came of one target.

    Attributes:
        target: link.
        wanted: successful trajectories.
        successes: that there are.
        attempts: that they took.
        gave_up: whether fewer are there because too many attempts failed.
        faults: what ended attempts before their end, `LinAlgError` say, and how many of them.
    """

    target: str
    wanted: int
    successes: int
    attempts: int
    gave_up: bool
    faults: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Header:
    """All of a file but its trajectories.

    Attributes:
        object: id.
        content_hash: of the object.
        facts: name for `load_object`, category, joints in the order of `object_qpos`; in the catalogue also seed,
            split and family.
        settings: of the collection.
        targets: what came of each.
        flag_names: of the columns of `flags`.
        state_columns: of `states`.
        key_frame_columns: of `key_frames`.
    """

    object: str
    content_hash: str
    facts: dict[str, Any]
    settings: Settings
    targets: tuple[TargetCount, ...]
    flag_names: tuple[str, ...]
    state_columns: Columns
    key_frame_columns: Columns

    def to_attributes(self) -> dict[str, Any]:
        """Attributes of the file's root: texts, those of nested values JSON."""
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
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
        """What `to_attributes` gave.

        Raises:
            DemoError: no file of ours, or one of another version.
        """
        check_format(given.get("format"), given.get("schema_version"), path)
        found = {
            name: parse_json(given[name])
            for name in ("facts", "settings", "targets", "flag_names", "state_columns", "key_frame_columns")
        }
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


def check_format(
    given: object, version: Any, path: Path, wanted: str = FORMAT, legal: int = SCHEMA_VERSION, what: str = ""
) -> None:
    """See whether a file is one of ours, of this version.

    Args:
        given: its format.
        version: of its schema.
        path: for the error.
        wanted: the format.
        legal: version of the schema.
        what: files of the format hold; by default demonstrations.

    Raises:
        DemoError: it is not.
    """
    if given != wanted:
        readers = _READERS.get(str(given))
        hint = f": {readers[path.suffix != '.json']} reads what it holds" if readers else ""
        raise DemoError(f"{str(path)!r} holds no {what or 'demonstrations'} of artiskill{hint}")
    if version != legal:
        raise DemoError(
            f"{str(path)!r} has schema version {version}; this version of artiskill reads {legal}: "
            "use the version of artiskill that wrote it, or make it anew"
        )


def object_facts(obj: ArticulatedObject) -> dict[str, Any]:
    """What readers may want to know about an object without having it."""
    number = obj.metadata.get("partnet_id")
    facts: dict[str, Any] = {
        "category": obj.category,
        "name": f"{PARTNET}:{number}" if number else obj.id,
        "joints": [
            {"link": obj.links[k].name, "kind": joint.kind, "limits": [_finite(x) for x in joint.limits]}
            for k, joint in zip(obj.jointed_links, obj.joints, strict=True)
        ],
    }
    listed = read_catalog().get(obj.id)
    if listed is not None:
        facts |= {"seed": listed[1].seed, "split": listed[1].split, "family": listed[1].family}
    return facts


def _finite(value: float) -> float | None:
    """A limit as JSON has it; None for none."""
    return float(value) if math.isfinite(value) else None
