"""Minari datasets: one HDF5 file with all episodes, and `metadata.json`; format of Minari 0.5.

Written without Minari: what the training files have compressed is copied as it is. `minari.load_dataset` reads it.
"""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from artiskill.demos.export.folder import check_not_empty, new_folder
from artiskill.demos.hdf5 import new_large_file, reading
from artiskill.demos.replay_episode import AGENT, STATE
from artiskill.demos.training_file import ReplaySettings, TrainingFile, TrainingFiles
from artiskill.envs.registration import NAMESPACE
from artiskill.envs.wrappers import PointCloudDownsample
from artiskill.errors import ConfigError, shown

# the oldest release that reads images which are not JPEG
_VERSION = "0.5.4"
_NAME = re.compile(r"([-_\w]+/)*[-_\w]+-v\d+")
_MEGA = 1_000_000


def export_minari(
    training: TrainingFiles,
    home: Path,
    name: str | None = None,
    on_trajectory: Callable[[], None] | None = None,
) -> Path:
    """Write a Minari dataset.

    Args:
        training: what is exported.
        home: Minari's folder of datasets, `MINARI_DATASETS_PATH`.
        name: the dataset's id; by default of task, control mode and observation mode.
        on_trajectory: called after each.

    Returns:
        The dataset's folder.

    Raises:
        ConfigError: a name that is no id of Minari.
        DemoError: a dataset of this name exists, the training files are damaged, or it cannot be written.
    """
    settings = training.settings
    source = settings.source
    if name is None:
        name = f"artiskill/{source.task}/{settings.control_mode}-{settings.obs_mode}-v0"
    if not _NAME.fullmatch(name):
        raise ConfigError(f"an id of Minari looks like artiskill/doors-v0, not {shown(name)}")
    check_not_empty(training)
    path = home / name
    with new_folder(path) as folder:
        data = folder / "data"
        data.mkdir()
        room = sum(entry.bytes for entry in training.manifest.files.values())
        with new_large_file(data / "main_data.hdf5", room) as file:
            steps = _write_episodes(file, training, on_trajectory or (lambda: None))
        observations, actions = training.spaces
        size = (data / "main_data.hdf5").stat().st_size
        metadata = {
            "dataset_id": name,
            "minari_version": _VERSION,
            "data_format": "hdf5",
            "jpeg_encoding": False,
            "total_episodes": len(training),
            "total_steps": steps,
            "dataset_size": round(size / _MEGA, 1),
            "observation_space": json.dumps(space_values(observations)),
            "action_space": json.dumps(space_values(actions)),
            "env_spec": env_spec(settings, sorted(entry.name for entry in training.manifest.files.values())),
            "algorithm_name": source.expert.name,
            "author": ["ArtiSkill"],
            "requirements": [f"artiskill=={source.versions['artiskill']}"],
            "description": _description(settings),
        }
        (data / "metadata.json").write_text(json.dumps(metadata) + "\n", encoding="utf-8")
    return path


def _description(settings: ReplaySettings) -> str:
    """One line."""
    outcome = "tried, and not always solved," if settings.keep_failures else "solved"
    return (
        f"{settings.source.task} {outcome} by scripted experts, {settings.control_mode} control, "
        f"{settings.obs_mode} observations"
    )


def env_spec(settings: ReplaySettings, objects: list[str]) -> str:
    """What `recover_environment` makes the environment from, JSON.

    Args:
        settings: of the training files.
        objects: names for `load_object`. One's own object, which no name leads to, has its id here, and whoever
            recovers the environment must pass it himself: `recover_environment(objects=...)`.
    """
    env = gym.make(
        f"{NAMESPACE}/{settings.source.task}-v0",
        objects="train",
        obs_mode=settings.obs_mode,
        control_mode=settings.control_mode,
        config=settings.overrides,
    )
    sampling = settings.sampling
    if sampling is not None:
        env = PointCloudDownsample(
            env, sampling.method, sampling.num_points, sampling.frame, **sampling.all_settings
        )
    spec = env.spec
    assert spec is not None
    spec.kwargs["objects"] = objects
    return spec.to_json()


def space_values(space: gym.Space[Any]) -> dict[str, Any]:
    """A space of boxes as Minari's metadata has it."""
    if isinstance(space, gym.spaces.Dict):
        return {"type": "Dict", "subspaces": {key: space_values(below) for key, below in space.items()}}
    assert isinstance(space, gym.spaces.Box)
    return {
        "type": "Box",
        "dtype": str(space.dtype),
        "shape": list(space.shape),
        "low": space.low.tolist(),
        "high": space.high.tolist(),
    }


def _write_episodes(file: Any, training: TrainingFiles, tell: Callable[[], None]) -> int:
    """All episodes, in the order of the files; how many steps they have."""
    steps = number = 0
    for source in training.files(check=True):
        for group in source.groups:
            with reading(source.path, group.name):
                steps += _write_episode(file.create_group(f"episode_{number}"), source, group, number)
            number += 1
            tell()
    return steps


def _write_episode(episode: Any, source: TrainingFile, group: Any, number: int) -> int:
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
