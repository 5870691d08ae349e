"""Reading training files, whole ones and such as somebody has changed and signed again."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.demos.test_replay import SMALL, STATE, settings_for

from artiskill.cli.main import main
from artiskill.demos.demos import sha256_of
from artiskill.demos.export import export_dataset
from artiskill.demos.hdf5 import load_h5py
from artiskill.demos.replay import replay
from artiskill.demos.training_file import TrainingFile, TrainingFiles
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import DemoError, UnknownNameError

from .conftest import put

NAME = "cabinet-0002.h5"


@pytest.fixture(scope="module")
def whole(drawers: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("training") / "state"
    replay(drawers, folder, settings_for(drawers, **STATE), objects=["cabinet-0002"])
    return folder


@pytest.fixture
def training(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "training"))


def nothing(group: Any) -> None:
    for name in ("actions", "disturbed", "rewards", "dones", "success"):
        put(name, lambda values: values[:0])(group)


def wrong(values: np.ndarray) -> np.ndarray:
    values[3] = np.nan
    return values


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("actions", lambda values: values[:5]), r"disturbed are bool \(\d+,\), not bool \(5,\)"),
        (
            put("actions", lambda values: values[:, :-1]),
            r"actions are float32 \(\d+, 12\), not float32 \(\d+, 13\)",
        ),
        (put("actions", wrong), "actions have numbers that are not finite"),
        (put("rewards", lambda values: values[:5]), r"rewards are float64 \(5,\), not"),
        (put("dones", lambda values: values.astype(np.int64)), r"dones are int64 .*, not bool"),
        (put("obs/state", lambda values: values[:5]), r"obs/state are float32 \(5, \d+\), not"),
        (put("obs/state", lambda values: values[:, :3]), r"obs/state are float32 \(\d+, 3\), not"),
        (nothing, "it has no steps"),
        (lambda group: group.__delitem__("actions"), "'actions' doesn't exist"),
        (lambda group: group.attrs.__delitem__("level"), "'level'"),
        (lambda group: group.attrs.__setitem__("level", "abc"), "a level is an integer from 0 to .*, not 'abc'"),
        (lambda group: group.attrs.__setitem__("target", 3), "its target is "),
    ],
)
def test_exports_refuse_what_does_not_fit(
    training: Path, tmp_path: Path, change: Callable[[Any], None], message: str
) -> None:
    with load_h5py().File(training / NAME, "r+") as file:
        change(file["traj_1"])
    manifest = json.loads((training / "manifest.json").read_text())
    manifest["files"][NAME]["sha256"] = sha256_of(training / NAME)
    (training / "manifest.json").write_text(json.dumps(manifest))
    for name in ("minari", "lerobot"):
        with pytest.raises(DemoError, match=rf"{NAME}' is damaged: cannot read trajectory 1 \(.*{message}"):
            export_dataset(TrainingFiles(training), tmp_path / "home", name, "x-v0")
    assert not list((tmp_path / "home").iterdir())


def test_arrays_by_name(whole: Path) -> None:
    with TrainingFile(whole / NAME) as file:
        assert file.array(np.int64(2), "obs/state").dtype == np.float32
        for name, near in (("obs/stat", "obs/state"), ("action", "actions")):
            with pytest.raises(UnknownNameError, match=rf"unknown array '{name}'; did you mean '{near}'"):
                file.array(0, name)
        with pytest.raises(UnknownNameError, match=r"unknown array 'obs'; .*obs/state, rewards, success"):
            file.array(0, "obs")
        with pytest.raises(IndexError, match="has the trajectories 0 to 2, not 3"):
            file.array(3, "actions")
        for bad in ("0", 1.0, None):
            with pytest.raises(TypeError, match="must be a whole number"):
                file.array(bad, "actions")  # type: ignore[arg-type]


def test_files_with_images_have_the_cameras_matrices(drawers: Path, tmp_path: Path) -> None:
    settings = settings_for(drawers, **(STATE | {"obs_mode": "rgbd", "seen": SMALL, "count": 1}))
    replay(drawers, tmp_path, settings, objects=["cabinet-0002"])
    env = ManipulationEnv("OpenCabinetDrawer", "cabinet-0002", obs_mode="rgbd", config=SMALL)
    _, info = env.reset(seed=0)
    with load_h5py().File(tmp_path / NAME) as file:
        for name in ("intrinsics", "robot_to_camera"):
            np.testing.assert_array_equal(file.attrs[name], info["cameras"][name])


def test_a_half_replayed_folder_is_called_so(
    training: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (training / ".unfinished" / "cabinet-0026").mkdir(parents=True)
    (training / ".unfinished" / "cabinet-0002").mkdir()  # killed after its file was written
    assert main(["demos", "export", str(training), "--format", "minari", "--out", str(tmp_path / "home")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("3 trajectories: ")
    assert lines[1] == f"{training} is not finished: 1 object is still to be replayed, and not counted here"
