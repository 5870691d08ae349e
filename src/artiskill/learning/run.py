"""The folder of a training run: its files, what it says of itself, and its tables. Nothing here needs torch.

| file | content |
|---|---|
| `config.yaml` | the resolved `TrainConfig` |
| `run.json` | `RunInfo`: what was trained on, and what acting needs |
| `metrics.csv` | a row of means every `log_every` steps |
| `development.csv` | a row per object and evaluation on development objects |
| `tensorboard/` | the same numbers for TensorBoard |
| `checkpoints/latest.pt` | everything that going on needs |
| `checkpoints/best.pt` | weights of the highest success on development objects |
| `set/` | the training set, if it was made here |
| `checkpoints/going-on-<step>.pkl` | of `sac` and `ppo`: replay buffer, environments and generators |
| `rounds/`, `rounds.csv` | rollouts, and what came of them |
"""

import csv
import io
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

from artiskill.config import from_mapping, to_mapping
from artiskill.errors import ArtiSkillError, MissingExtraError, PolicyError, RunError, shown
from artiskill.files import atomic_write, file_sha256, is_file, is_folder, parse_json, read_bytes, read_text
from artiskill.learning.observation import ObservationLayout
from artiskill.tasks.registry import SEEN_SECTIONS

FORMAT, VERSION = "artiskill-run", 1
CONFIG, INFO, METRICS, DEVELOPMENT = "config.yaml", "run.json", "metrics.csv", "development.csv"
TENSORBOARD, SET = "tensorboard", "set"
LATEST, BEST = Path("checkpoints/latest.pt"), Path("checkpoints/best.pt")
FROM_STATE = ("sac", "ppo")  # algorithms of reinforcement learning, whose policies see the state
KEPT = "what was saved before is kept: the same command goes on from there"


@dataclass(frozen=True)
class RunInfo:
    """What a run was trained on, and what acting needs."""

    task: str
    algorithm: str
    control_mode: str  # of the actions
    sampling: dict[str, Any]  # of the clouds, as `Sampling` has it
    sizes: dict[str, int]  # see `artiskill.learning.batch.Sizes`
    statistics: dict[str, list[float]]  # see `artiskill.learning.batch.Statistics`
    overrides: dict[str, Any]  # of the task's configuration, in the demonstrations or in training
    data: str  # digest of the training set's manifest, or of the objects of rollouts
    objects: list[str]  # ids, whose demonstrations or rollouts these are
    steps: int  # of demonstrations, or of rollouts at most
    versions: dict[str, str]  # with which the run began
    commands: dict[str, Any] = field(default_factory=dict)  # a `CommandSpace`, where commands are learned

    @property
    def observation_config(self) -> dict[str, Any]:
        """The task's sections that say what was seen, as evaluation asks of a policy."""
        return {key: value for key, value in self.overrides.items() if key.partition(".")[0] in SEEN_SECTIONS}

    @property
    def layout(self) -> ObservationLayout:
        """How its observations are stored."""
        return ObservationLayout(*(self.sizes[name] for name in ("points", "masks", "agent")))


def write_info(info: RunInfo, folder: Path) -> None:
    """Write `run.json`."""
    values = {"format": FORMAT, "version": VERSION, **to_mapping(info)}
    write_whole(folder / INFO, (json.dumps(values, indent=1) + "\n").encode())


def read_info(folder: Path) -> RunInfo:
    """Read `run.json`.

    Raises:
        RunError: there is none, or it is damaged, foreign or of another version.
    """
    path = folder / INFO
    try:
        given = parse_json(read_bytes(path))
    except (FileNotFoundError, NotADirectoryError) as error:
        raise RunError(f"{str(folder)!r} holds no training run: it has no {INFO}") from error
    except (OSError, ValueError) as error:
        raise RunError(f"{str(path)!r} is damaged: {getattr(error, 'strerror', None) or error}") from error
    if not isinstance(given, dict) or given.pop("format", None) != FORMAT:
        raise RunError(f"{str(folder)!r} holds no training run: its {INFO} is of something else")
    version = given.pop("version", None)
    if version != VERSION:
        raise RunError(
            f"{str(folder)!r} is a training run of version {shown(version)}; this version of artiskill reads "
            f"{VERSION}: use the version of artiskill that trained it, or train it anew"
        )
    try:
        return from_mapping(RunInfo, given, str(path))
    except ArtiSkillError as error:
        raise RunError(f"{str(path)!r} is damaged: {error}") from error


def weights_file(run: Path | str) -> Path:
    """Return the file of a run's weights: of its best checkpoint, else of its latest.

    Args:
        run: the run's folder, or one of its checkpoints.

    Raises:
        PolicyError: there is no such file.
    """
    run = Path(run)
    if is_file(run):
        return run
    if run.suffix and not is_folder(run):
        raise PolicyError(f"there is no file {str(run)!r}")
    for name in (BEST, LATEST):
        if is_file(run / name):
            return run / name
    if is_file(run / INFO):
        raise PolicyError(f"{str(run)!r} is a training run without a checkpoint yet: train it for longer")
    if not is_folder(run):
        raise PolicyError(f"there is no folder {str(run)!r}")
    raise PolicyError(f"{str(run)!r} is a folder, but of no training run: it has no {INFO}")


def run_folder(run: Path | str) -> Path:
    """Return the folder of a run that is given by its folder, or by one of its checkpoints."""
    run = Path(run)
    return run.absolute().parent.parent if is_file(run) else run


def weights_digest(run: Path | str) -> str:
    """Return the SHA-256 of a run's weights, see `weights_file`.

    Raises:
        PolicyError: there are none, or they cannot be read.
    """
    path = weights_file(run)
    try:
        return file_sha256(path)
    except OSError as error:
        raise PolicyError(f"cannot read {str(path)!r}: {error.strerror}") from error


def load_run(run: Path | str) -> Any:
    """Return the policy of a run, which acts by torch; see `artiskill.learning.policy`.

    Raises:
        PolicyError: there is no run, or it is damaged or of another version.
        MissingExtraError: torch is not installed.
    """
    weights_file(run)
    check_torch("a trained policy")
    try:
        kind = "StatePolicy" if read_info(run_folder(run)).algorithm in FROM_STATE else "RunPolicy"
        return getattr(import_module("artiskill.learning.policy"), kind)(run)
    except RunError as error:
        raise PolicyError(str(error)) from error


def check_torch(feature: str) -> None:
    """Raise `MissingExtraError` unless torch is installed."""
    try:
        import torch  # noqa: F401
    except ImportError as error:
        if error.name != "torch":
            raise
        raise MissingExtraError(feature, "learn") from error


def write_whole(path: Path, content: bytes | Callable[[BinaryIO], object]) -> None:
    """Write a file that is on the disk before it has its name: bytes, or what a function writes into it.

    Raises:
        OSError: it cannot be written; an earlier one is as it was.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        if isinstance(content, bytes):
            file.write(content)
        else:
            content(file)
        file.flush()
        os.fsync(file.fileno())


class Table:
    """A CSV file that grows row by row; a row with new columns has the file written anew.

    Args:
        path: of the file.
        until: rows of later steps are dropped, which a run wrote after its last checkpoint.

    Attributes:
        rows: all, as text.

    Raises:
        RunError: the file is damaged.
    """

    def __init__(self, path: Path, until: int) -> None:
        self._path = path
        try:
            text = read_text(path)
            whole = text[: text.rfind("\n") + 1]  # a killed run may leave half a row
            found = list(csv.DictReader(io.StringIO(whole, newline="")))
            self.rows: list[dict[str, Any]] = [row for row in found if int(row["step"]) <= until]
        except FileNotFoundError:
            self.rows = []
            return
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise RunError(f"{str(path)!r} is damaged ({error}): remove it to go on without") from error
        self._write_all()

    def add(self, row: Mapping[str, Any]) -> None:
        """Add a row; it has a `step`.

        Raises:
            OSError: it cannot be written.
        """
        is_known = bool(self.rows) and row.keys() <= self.rows[0].keys()
        self.rows.append({**dict.fromkeys(self.rows[0] if self.rows else (), ""), **row})
        if not is_known:
            self._write_all()
            return
        with self._path.open("a", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerow(self.rows[-1].values())

    def _write_all(self) -> None:
        columns = list(dict.fromkeys(key for row in self.rows for key in row))
        self.rows = [{key: row.get(key, "") for key in columns} for row in self.rows]
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(columns or ["step"])
        writer.writerows(row.values() for row in self.rows)
        write_whole(self._path, text.getvalue().encode())
