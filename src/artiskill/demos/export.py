"""Training files as datasets of other libraries: `export_dataset`, Minari, and LeRobot (`lerobot.py`).

Both are written without their libraries; `minari.load_dataset` and `LeRobotDataset(name, root=...)` read them.
A Minari dataset, format of Minari 0.5, is one HDF5 file with all episodes, and `metadata.json`; what is compressed
in the training files is copied as it is.
"""

import json
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from artiskill.demos.hdf5 import new_large_file, reading, writing
from artiskill.demos.lerobot import lerobot_writer
from artiskill.demos.replay_episode import AGENT, STATE
from artiskill.demos.settings import CONTROLLER, HUMAN, LEARNER
from artiskill.demos.training_file import ReplaySettings, TrainingFile, TrainingFiles
from artiskill.envs.registration import NAMESPACE
from artiskill.errors import ConfigError, DemoError, check_name, shown
from artiskill.files import TEMPORARY_PREFIX, lock_folder, output_path

# the oldest release that reads images which are not JPEG
_MINARI_VERSION = "0.5.4"
_MEGA = 1_000_000

AddEpisode = Callable[[TrainingFile, Any], None]  # a training file, and the h5py group of a trajectory


@contextmanager
def minari_writer(folder: Path, training: TrainingFiles, name: str) -> Iterator[AddEpisode]:
    """Yield what adds an episode to a Minari dataset; the metadata are written at the end."""
    steps = number = 0
    path = folder / "data/main_data.hdf5"
    path.parent.mkdir()

    def add(source: TrainingFile, group: Any) -> None:
        nonlocal steps, number
        with reading(source.path, group.name):
            steps += _write_episode(file.create_group(f"episode_{number}"), source, group, number)
        number += 1

    with new_large_file(path, sum(entry.bytes for entry in training.manifest.files.values())) as file:
        yield add
    settings = training.settings
    observations, actions = training.spaces
    metadata = {
        "dataset_id": name,
        "minari_version": _MINARI_VERSION,
        "data_format": "hdf5",
        "jpeg_encoding": False,
        "total_episodes": number,
        "total_steps": steps,
        "dataset_size": round(path.stat().st_size / _MEGA, 1),
        "observation_space": json.dumps(_space_values(observations)),
        "action_space": json.dumps(_space_values(actions)),
        "env_spec": _env_spec(settings, sorted(entry.name for entry in training.manifest.files.values())),
        "algorithm_name": settings.source.expert.name,
        "author": ["ArtiSkill"],
        "requirements": [f"artiskill=={settings.source.versions['artiskill']}"],
        "description": _description(settings),
    }
    path.with_name("metadata.json").write_text(json.dumps(metadata) + "\n", encoding="utf-8")


def _write_episode(episode: Any, source: TrainingFile, group: Any, number: int) -> int:
    """Write an episode; return its number of steps."""
    dones, success = group["dones"][()], group["success"][()]
    group.copy("actions", episode)
    group.copy("rewards", episode)
    episode["terminations"], episode["truncations"] = success, dones & ~success
    if AGENT in group["obs"]:
        group.copy("obs", episode, name="observations")
        del episode["observations"][STATE]  # another name of `agent`
    else:
        group.copy(f"obs/{STATE}", episode, name="observations")
    infos = episode.create_group("infos")
    infos["success"] = np.concatenate(([False], success))
    infos["disturbed"] = np.concatenate(([False], group["disturbed"][()]))
    about = {"id": number, "seed": int(group.attrs["level"]), "total_steps": len(dones)}
    options = {"object": source.name, "target": str(group.attrs["target"]), "level": about["seed"]}
    episode.attrs.update(about | {f"options/{key}": value for key, value in options.items()})
    return len(dones)


def _space_values(space: gym.Space[Any]) -> dict[str, Any]:
    """Return a space of boxes as Minari's metadata has it."""
    if isinstance(space, gym.spaces.Dict):
        return {"type": "Dict", "subspaces": {key: _space_values(below) for key, below in space.items()}}
    assert isinstance(space, gym.spaces.Box)
    return {
        "type": "Box",
        "dtype": str(space.dtype),
        "shape": list(space.shape),
        "low": space.low.tolist(),
        "high": space.high.tolist(),
    }


def _env_spec(settings: ReplaySettings, objects: list[str]) -> str:
    """Return what `recover_environment` makes the environment from, JSON.

    Args:
        settings: of the training files.
        objects: names for `load_object`. An object of one's own, which no name leads to, has its id here, and
            whoever recovers the environment must pass it: `recover_environment(objects=...)`.
    """
    env = gym.make(
        f"{NAMESPACE}/{settings.source.task}-v0",
        objects="train",
        obs_mode=settings.obs_mode,
        control_mode=settings.control_mode,
        config=settings.overrides,
    )
    if settings.sampling is not None:
        env = settings.sampling.wrap(env)
    spec = env.spec
    assert spec is not None
    spec.kwargs["objects"] = objects
    return spec.to_json()


def _description(settings: ReplaySettings) -> str:
    outcome = "tried, and not always solved," if settings.keep_failures else "solved"
    who = {CONTROLLER: "scripted experts", HUMAN: "people", LEARNER: "trained agents"}[settings.source.expert.kind]
    return (
        f"{settings.source.task} {outcome} by {who}, {settings.control_mode} control, "
        f"{settings.obs_mode} observations"
    )


@dataclass(frozen=True)
class DatasetFormat:
    """A library's format of datasets."""

    library: str  # its name
    legal_name: re.Pattern[str]  # what the id of a dataset looks like
    example: str  # an id
    default_name: str  # of task, control mode and observation mode
    # opens a new dataset in a folder, with an id, and yields what adds an episode to it
    writer: Callable[[Path, TrainingFiles, str], AbstractContextManager[AddEpisode]]

    def name_for(self, settings: ReplaySettings) -> str:
        """Return the default id of a dataset."""
        modes = {"control_mode": settings.control_mode, "obs_mode": settings.obs_mode}
        return self.default_name.format(task=settings.source.task, **modes)


DATASET_FORMATS = {
    "minari": DatasetFormat(
        library="Minari",
        legal_name=re.compile(r"([-_\w]+/)*[-_\w]+-v\d+"),
        example="artiskill/doors-v0",
        default_name="artiskill/{task}/{control_mode}-{obs_mode}-v0",
        writer=minari_writer,
    ),
    "lerobot": DatasetFormat(
        library="LeRobot",
        legal_name=re.compile(r"(\w[-.\w]*/)*\w[-.\w]*"),
        example="artiskill/doors",
        default_name="artiskill/{task}-{control_mode}-{obs_mode}",
        writer=lerobot_writer,
    ),
}


def export_dataset(
    training: TrainingFiles,
    home: Path,
    format: str,  # noqa: A002 - as the option is called
    name: str | None = None,
    on_trajectory: Callable[[], None] | None = None,
) -> Path:
    """Write training files as a dataset of another library.

    Args:
        training: what is exported.
        home: the library's folder of datasets: `MINARI_DATASETS_PATH`, `HF_LEROBOT_HOME`.
        format: one of `DATASET_FORMATS`.
        name: the dataset's id; by default of task, control mode and observation mode.
        on_trajectory: called after each.

    Returns:
        The dataset's folder.

    Raises:
        UnknownNameError: no such format.
        ConfigError: a name that is no id of the library, or cameras of a size that videos cannot have.
        DemoError: a dataset of this name exists, the training files are damaged, or it cannot be written.
        MissingExtraError: what the format needs is not installed.
    """
    check_name("format", format, DATASET_FORMATS)
    made = DATASET_FORMATS[format]
    name = made.name_for(training.settings) if name is None else name
    if not made.legal_name.fullmatch(name):
        raise ConfigError(f"an id of {made.library} looks like {made.example}, not {shown(name)}")
    if not len(training):
        raise DemoError(f"{str(training.folder)!r} holds no trajectories")
    path = home / name
    with _new_folder(path) as folder, made.writer(folder, training, name) as add:
        for source in training.files(check=True):
            for group in source.groups:
                add(source, group)
                if on_trajectory is not None:
                    on_trajectory()
    return path


@contextmanager
def _new_folder(path: Path) -> Iterator[Path]:
    """Yield a temporary folder beside a path; it gets the path's name at the end, if all went well.

    What an export under this name that was killed has left is removed.

    Raises:
        DemoError: the path exists, or cannot be written to.
        ConfigError: another process exports under this name.
    """
    path = output_path(path)
    with writing(path):
        _check_is_free(path)
    place = path.parent / f"{TEMPORARY_PREFIX}{path.name}"
    temporary = place / "dataset"
    try:
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
        with lock_folder(place, "export"), writing(path):
            _check_is_free(path)
            try:
                shutil.rmtree(temporary, ignore_errors=True)
                temporary.mkdir()
                yield temporary
                temporary.rename(path)
            finally:
                shutil.rmtree(temporary, ignore_errors=True)
    finally:
        with suppress(OSError):  # not empty: another process is at it
            place.rmdir()


def _check_is_free(path: Path) -> None:
    if path.exists():
        raise DemoError(f"{str(path)!r} exists: remove it, or choose another folder or name")
