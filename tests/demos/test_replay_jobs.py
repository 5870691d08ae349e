"""What replaying says of its trajectories: which are the recorded ones, which diverged, which are chosen."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.demos.test_replay import STATE, relist, settings_for

from artiskill.cli.main import main
from artiskill.demos.export import export_dataset
from artiskill.demos.file_format import ATTEMPT_TYPE
from artiskill.demos.hdf5 import load_h5py
from artiskill.demos.replay import choose, replay
from artiskill.demos.replay_jobs import ReplayedTrajectory
from artiskill.demos.training_file import TrainingFile, TrainingFiles
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import DivergedError

NAME = "cabinet-0002.h5"
PLAYED = STATE | {"way": "simulate"}


@pytest.mark.parametrize("name", ["digests", "rewards", "flags"])
def test_one_number_that_differs_is_not_bit_exact(
    name: str, own_drawers: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with load_h5py().File(own_drawers / NAME, "r+") as file:
        values = file[f"traj_1/{name}"][()]
        if name == "flags":
            values[7, 0] ^= True
        elif name == "rewards":
            values[7] = np.nextafter(values[7], 9)
        else:
            values[-1] ^= np.uint64(1)
        file[f"traj_1/{name}"][...] = values
    relist(own_drawers)
    command = ["demos", "replay", str(own_drawers), "--out", str(tmp_path / "t"), "--obs-mode", "state"]
    assert main([*command, "--objects", "cabinet-0002", "--workers", "1"]) == 0
    assert "\n1 of 3 trajectories came out otherwise than recorded; those that are" in capsys.readouterr().out
    with TrainingFile(tmp_path / "t" / NAME) as training:
        assert [bool(group.attrs["exact"]) for group in training.groups] == [True, False, True]
        assert all(group.attrs["success"] for group in training.groups)


def test_a_divergence_ends_one_trajectory_only(
    drawers: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps, step_of = [0], ManipulationEnv.step

    def step(env: ManipulationEnv, action: Any) -> Any:
        steps[0] += 1
        if steps[0] == 13:
            raise DivergedError({0: ("cabinet-0002", ["BADQACC"])})
        return step_of(env, action)

    monkeypatch.setattr(ManipulationEnv, "step", step)
    news: list[ReplayedTrajectory] = []
    settings = settings_for(drawers, **PLAYED, keep_failures=True)
    manifest = replay(drawers, tmp_path / "t", settings, objects=["cabinet-0002"], on_replayed=news.append)
    (entry,) = manifest.files.values()
    assert (entry.counts.replayed, entry.counts.solved, entry.counts.exact) == (3, 2, 2)
    assert [one.success for one in news] == [False, True, True]
    assert news[0].fault.startswith("cabinet-0002, trajectory 0: the physics of cabinet-0002 diverged")
    assert not news[1].fault
    with TrainingFile(tmp_path / "t" / NAME) as file:  # the last step of every trajectory ends its episode
        for number in range(3):
            dones = file.array(number, "dones")
            assert np.flatnonzero(dones).tolist() == [len(dones) - 1]
        assert not file.array(0, "success").any()
        assert len(file.array(0, "dones")) == 12
        assert len(file.array(0, "obs/state")) == 13
    path = export_dataset(TrainingFiles(tmp_path / "t"), tmp_path, "minari", "x-v0")
    with load_h5py().File(path / "data/main_data.hdf5", "r") as data:
        assert data["episode_0/truncations"][()].tolist() == [False] * 11 + [True]
        assert not data["episode_1/truncations"][()].any()
    metadata = json.loads((path / "data/metadata.json").read_text())
    assert metadata["description"].startswith("OpenCabinetDrawer tried, and not always solved, by scripted")


def test_what_diverges_at_once_is_not_kept(drawers: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def step(env: ManipulationEnv, action: Any) -> Any:
        raise DivergedError({0: ("cabinet-0002", ["BADQACC"])})

    monkeypatch.setattr(ManipulationEnv, "step", step)
    settings = settings_for(drawers, **PLAYED, keep_failures=True)
    (entry,) = replay(drawers, tmp_path / "t", settings, objects=["cabinet-0002"]).files.values()
    assert (entry.counts.replayed, entry.trajectories) == (3, 0)


def test_a_count_is_of_successes_unless_failures_are_kept() -> None:
    rows = [(0, 5, 0, 9, 0), (0, 7, 1, 9, 1), (0, 9, 1, 9, 2), (1, 6, 0, 9, 3), (1, 8, 1, 9, 4)]
    file: Any = SimpleNamespace(attempts=np.array(rows, ATTEMPT_TYPE))
    assert [choose(file, count) for count in (1, 2, 3, 9)] == [(1,), (1, 4), (1, 2, 4), (1, 2, 4)]
    assert [choose(file, count, keep_failures=True) for count in (2, 9)] == [(0, 3), (0, 1, 2, 3, 4)]


def test_other_versions_are_told(own_drawers: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with load_h5py().File(own_drawers / NAME, "r+") as file:
        file.attrs["settings"] = file.attrs["settings"].replace('"numpy": "', '"numpy": "0.')
    manifest = own_drawers / "manifest.json"
    manifest.write_text(manifest.read_text().replace('"numpy": "', '"numpy": "0.'))
    relist(own_drawers)
    for way, is_told in (("--simulate", True), ("--restore", False)):
        command = ["demos", "replay", str(own_drawers), "--out", str(tmp_path / way), "--obs-mode", "state", way]
        assert main([*command, "--objects", "cabinet-0002", "--workers", "1"]) == 0
        line = "was collected with other versions, which may give other bits: numpy"
        assert (line in capsys.readouterr().out) == is_told
