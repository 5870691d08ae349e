import dataclasses
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.demos.collect import collect
from artiskill.demos.demos import load_demo_pack, read_manifest
from artiskill.demos.export import export_dataset
from artiskill.demos.hdf5 import load_h5py
from artiskill.demos.replay import replay
from artiskill.demos.training_file import ReplaySettings, TrainingFile, TrainingFiles, make_sampling
from artiskill.errors import ConfigError, DemoError
from artiskill.files import lock_folder
from artiskill.versions import versions

TASK = "OpenCabinetDrawer"


def training_files(folder: Path, obs_mode: str, count: int = 2) -> TrainingFiles:
    """Small training files of the first object of the demo pack."""
    pack = load_demo_pack(TASK)
    settings = ReplaySettings(
        source=pack.manifest.settings,
        obs_mode=obs_mode,
        control_mode="joint",
        way="restore",
        sampling=make_sampling(30) if obs_mode == "pointcloud" else None,
        seen={} if obs_mode == "state" else {"cameras.width": 32, "cameras.height": 34},
        count=count,
        keep_failures=False,
        compression=1,
        versions=versions(),
    )
    replay(pack.folder, folder, settings, objects=pack.objects[:1])
    return TrainingFiles(folder)


@pytest.mark.parametrize("obs_mode", ["state", "pointcloud", "rgbd"])
def test_export_reads_it(obs_mode: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    minari = pytest.importorskip("minari")
    training, home = training_files(tmp_path / "t", obs_mode), tmp_path / "home"
    name = f"artiskill/{TASK}/joint-{obs_mode}-v0"
    assert export_dataset(training, home, "minari") == home / name
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(home))
    assert list(minari.list_local_datasets()) == [name]
    dataset = minari.load_dataset(name)
    env = dataset.recover_environment()
    assert (dataset.observation_space, dataset.action_space) == (env.observation_space, env.action_space)
    with TrainingFile(training.folder / next(iter(training.manifest.files))) as file:
        assert dataset.total_episodes == len(file) == 2
        assert dataset.total_steps == sum(len(file.array(k, "actions")) for k in range(2))
        about = list(dataset.storage.get_episode_metadata(range(2)))
        for number, episode in enumerate(dataset.iterate_episodes()):
            group = file.groups[number]
            np.testing.assert_array_equal(episode.actions, group["actions"])
            np.testing.assert_array_equal(episode.rewards, group["rewards"])
            np.testing.assert_array_equal(episode.terminations, group["success"])
            assert not episode.truncations.any()
            assert episode.infos["disturbed"].tolist() == [False, *group["disturbed"]]
            assert episode.infos["success"].tolist() == [False, *group["success"]]
            observation, info = env.reset(seed=about[number]["seed"], options=about[number]["options"])
            assert info["target"] == group.attrs["target"]
            check_equal(observation, first_of(episode.observations))
            assert dataset.observation_space.contains(first_of(episode.observations))


def first_of(observations):  # type: ignore[no-untyped-def]
    if isinstance(observations, dict):
        return {key: first_of(below) for key, below in observations.items()}
    return observations[0]


def check_equal(one, other) -> None:  # type: ignore[no-untyped-def]
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            check_equal(one[key], other[key])
    else:
        np.testing.assert_array_equal(one, other)


def test_what_is_written(tmp_path: Path) -> None:
    training = training_files(tmp_path / "t", "state", 1)
    told: list[int] = []
    path = export_dataset(training, tmp_path, "minari", "mine/drawers-v3", lambda: told.append(1))
    assert told == [1]
    metadata = json.loads((path / "data/metadata.json").read_text())
    assert metadata["dataset_id"] == "mine/drawers-v3"
    assert (metadata["total_episodes"], metadata["jpeg_encoding"]) == (1, False)
    assert json.loads(metadata["observation_space"])["type"] == "Box"
    assert json.loads(metadata["env_spec"])["kwargs"]["objects"] == list(load_demo_pack(TASK).objects[:1])
    assert sorted(p.name for p in path.parent.iterdir()) == ["drawers-v3"]  # nothing temporary is left


def test_imported_objects_are_named_so_that_they_are_found(plan: Any, tmp_path: Path) -> None:
    """PartNet-Mobility's 40147 has this id; what leads to it is `partnet:40147`."""
    made = load_object("cabinet-0002")
    imported = dataclasses.replace(made, id="40147", metadata=dict(made.metadata) | {"partnet_id": "40147"})
    collect(plan(objects=[imported], per_object=1), tmp_path / "demos")
    settings = dataclasses.replace(
        training_files(tmp_path / "other", "state", 1).settings, source=read_manifest(tmp_path / "demos").settings
    )
    replay(tmp_path / "demos", tmp_path / "t", settings, objects=[imported])
    path = export_dataset(TrainingFiles(tmp_path / "t"), tmp_path, "minari", "x-v0")
    metadata = json.loads((path / "data/metadata.json").read_text())
    assert json.loads(metadata["env_spec"])["kwargs"]["objects"] == ["partnet:40147"]
    with load_h5py().File(path / "data/main_data.hdf5", "r") as file:
        assert file["episode_0"].attrs["options/object"] == "partnet:40147"


def test_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    training = training_files(tmp_path / "t", "state", 1)
    monkeypatch.setattr("shutil.disk_usage", lambda path: SimpleNamespace(free=1_000_000))
    with pytest.raises(DemoError, match="No space left on device: 4 MB may be needed, 1 MB are free"):
        export_dataset(training, tmp_path, "minari", "x-v0")
    assert not list(tmp_path.glob("*x-v0*"))


def test_what_a_killed_export_left_is_removed(tmp_path: Path) -> None:
    training = training_files(tmp_path / "t", "state", 1)
    left = tmp_path / "home/mine/.part-x-v0"
    (left / "dataset/data").mkdir(parents=True)
    (left / "dataset/data/main_data.hdf5").write_bytes(b"half")
    with lock_folder(left, "export"), pytest.raises(ConfigError, match=r"another export .* is already writing to"):
        export_dataset(training, tmp_path / "home", "minari", "mine/x-v0")
    assert (left / "dataset/data/main_data.hdf5").exists()  # it is somebody else's now
    path = export_dataset(training, tmp_path / "home", "minari", "mine/x-v0")
    assert [entry.name for entry in path.parent.iterdir()] == ["x-v0"]
    assert sorted(entry.name for entry in (path / "data").iterdir()) == ["main_data.hdf5", "metadata.json"]


def test_bad_input(tmp_path: Path) -> None:
    training = training_files(tmp_path / "t", "state", 1)
    with pytest.raises(ConfigError, match=r"looks like artiskill/doors-v0, not '../x'"):
        export_dataset(training, tmp_path, "minari", "../x")
    export_dataset(training, tmp_path, "minari", "x-v0")
    with pytest.raises(DemoError, match="exists: remove it, or choose another"):
        export_dataset(training, tmp_path, "minari", "x-v0")
    with pytest.raises(DemoError, match="cannot write"):
        export_dataset(training, tmp_path / "t/manifest.json", "minari", "x-v0")
    with pytest.raises(DemoError, match="holds no training files of artiskill"):
        TrainingFiles(load_demo_pack(TASK).folder)
    path = next(training.folder.glob("*.h5"))
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(DemoError, match="was changed or damaged: remove it and replay again"):
        export_dataset(training, tmp_path, "minari", "y-v0")
    assert not list(tmp_path.glob("y-v0*"))
    path.unlink()
    with pytest.raises(DemoError, match="is missing: the manifest lists it"):
        TrainingFiles(training.folder)
