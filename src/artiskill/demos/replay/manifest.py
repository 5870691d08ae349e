"""`manifest.json` of a folder of training files: how they were made, and what came of the trajectories."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from artiskill.demos.json_files import read_json, write_json
from artiskill.demos.manifest import sha256_of
from artiskill.demos.replay.episodes import OutcomeCounts
from artiskill.demos.replay.settings import ReplaySettings
from artiskill.errors import DemoError

FORMAT, SCHEMA_VERSION = "artiskill-training", 2
WHAT = "training files"


@dataclass(frozen=True)
class TrainingEntry:
    """One file of the folder.

    Attributes:
        object: whose trajectories it holds.
        name: of the object, as `load_object` takes it.
        content_hash: of the object.
        source_sha256: of the file of demonstrations.
        sha256: of the file.
        bytes: of the file.
        trajectories: that it holds.
        frames: observations in all.
        counts: what came of the trajectories that were replayed.
    """

    object: str
    name: str
    content_hash: str
    source_sha256: str
    sha256: str
    bytes: int
    trajectories: int
    frames: int
    counts: OutcomeCounts


@dataclass(frozen=True)
class TrainingManifest:
    """What a folder holds.

    Attributes:
        settings: of all its files.
        files: by name.
    """

    settings: ReplaySettings
    files: dict[str, TrainingEntry] = field(default_factory=dict)

    def with_file(self, name: str, entry: TrainingEntry) -> "TrainingManifest":
        """With one more file; they are in the order of their names."""
        return replace(self, files=dict(sorted((self.files | {name: entry}).items())))


def read_training_manifest(folder: Path) -> TrainingManifest:
    """The manifest of a folder of training files.

    Raises:
        DemoError: it has none, or one that is damaged, foreign or of another version.
    """
    return read_json(TrainingManifest, folder, FORMAT, SCHEMA_VERSION, WHAT)


def write_training_manifest(manifest: TrainingManifest, folder: Path) -> None:
    """Write it; it is replaced whole or stays as it was.

    Raises:
        DemoError: it cannot be written.
    """
    write_json(manifest, folder, FORMAT, SCHEMA_VERSION)


def check_training_file(folder: Path, name: str, entry: TrainingEntry) -> None:
    """Compare a file with its entry.

    Raises:
        DemoError: it is missing, or another one.
    """
    if sha256_of(folder / name) != entry.sha256:
        raise DemoError(f"{str(folder / name)!r} was changed or damaged: remove it and replay again")
