# ruff: noqa: E402
import contextlib
import json
import re
import shutil
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch")

from tests.learning.tiny_set import TASK, TINY, tiny_config, write_tiny_set

import artiskill
from artiskill.cli.main import main
from artiskill.errors import ConfigError, DemoError, RunError, UnknownNameError
from artiskill.files import lock_folder
from artiskill.learning.processes import Processes
from artiskill.learning.run import INFO, LATEST, read_info
from artiskill.learning.train import TrainData, train
from artiskill.learning.train_config import load_train_config
from artiskill.learning.trainer import Trainer


def go(data: Path | TrainData, out: Path, lines: list[str] | None = None, **values: Any) -> Trainer:
    given = data if isinstance(data, TrainData) else TrainData(data)
    told = [] if lines is None else lines
    return train(tiny_config(**values), given, out, device="cpu", threads=1, on_lines=told.extend)


@pytest.fixture
def run(tiny_set: Path, tmp_path: Path) -> Path:
    """A finished run."""
    go(tiny_set, tmp_path / "run")
    return tmp_path / "run"


def test_the_files_of_a_run(run: Path) -> None:
    found = {path.name for path in run.iterdir()}
    assert found == {"config.yaml", "run.json", "metrics.csv", "tensorboard", "checkpoints"}
    info = read_info(run)
    assert (info.task, info.algorithm, info.control_mode, info.steps) == (TASK, "bc", "joint", 48)
    assert info.sizes == {"points": 16, "masks": 3, "agent": 38, "action": 13}
    assert info.versions["torch"] == metadata.version("torch")


def test_a_set_is_made_from_demonstrations(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pack = artiskill.load_demo_pack("PushChair").folder
    told: list[tuple[str, int, int]] = []
    data = TrainData(pack, num_points=32, frame="robot")
    config = tiny_config(steps=5)
    with pytest.raises(DemoError, match="is of task PushChair, not 'OpenCabinetDrawer'"):
        train(config, data, tmp_path / "run", device="cpu", threads=1)
    chairs = load_train_config("bc", "PushChair", overrides=TINY | {"steps": 2})
    lines: list[str] = []
    train(chairs, data, tmp_path / "run", "cpu", 1, None, lines.extend, lambda *progress: told.append(progress))
    assert not [line for line in lines if line.startswith("note")]
    assert {what for what, *_ in told} == {"replaying", "writing"}
    assert read_info(tmp_path / "run").sampling["num_points"] == 32
    told.clear()
    train(chairs, data, tmp_path / "run", device="cpu", threads=1, on_set=lambda *progress: told.append(progress))
    assert not told  # the set is there
    monkeypatch.setattr("artiskill.learning.trainer.FIRST_DEMONSTRATED", 200_000)
    train(chairs, data, tmp_path / "run", "cpu", 1, None, lines.extend)
    assert lines[-1].startswith(
        "note: 12 of 12 demonstrations begin at levels below 200000, where evaluations play"
    )
    lines.clear()
    monkeypatch.setattr("artiskill.learning.train_config.MEASURED_SPLITS", ("train",))
    train(chairs, data, tmp_path / "run", "cpu", 1, None, lines.extend)
    found = [line for line in lines if "by which results are measured" in line]
    assert len(found) == 1
    assert re.match(r"note: 'chair-\d+' is of 'train'(, and \d+ more of these)?, by which", found[0])


def test_other_values_are_refused_and_listed(run: Path, tiny_set: Path) -> None:
    before = (run / "config.yaml").read_bytes()
    with pytest.raises(
        RunError, match=r"holds a run of other values \(batch_size 4 there, 8 here\); choose another"
    ):
        go(tiny_set, run, batch_size=8)
    assert (run / "config.yaml").read_bytes() == before


def test_other_data_are_refused(run: Path, tmp_path: Path) -> None:
    with pytest.raises(RunError, match="holds a run on other data"):
        go(write_tiny_set(tmp_path / "other", seed=1), run)


def test_data_of_another_task_can_be_mended(tiny_set: Path, tmp_path: Path) -> None:
    with pytest.raises(DemoError, match=f"is of task {TASK}, not 'PushChair'"):
        train(load_train_config("bc", "PushChair"), TrainData(tiny_set), tmp_path / "run")
    assert not (tmp_path / "run").exists()
    assert go(tiny_set, tmp_path / "run").state.step == 20


def _truncate(folder: Path) -> None:
    path = folder / "frames.bin"
    path.write_bytes(path.read_bytes()[:-10])


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (_truncate, "it was truncated or changed"),
        (lambda folder: (folder / "steps.npy").unlink(), "was not copied whole"),
        (lambda folder: (folder / "manifest.json").unlink(), "neither training files nor demonstrations"),
        (lambda folder: shutil.rmtree(folder), "there is no folder"),
    ],
)
def test_damaged_data(tmp_path: Path, damage: Callable[[Path], None], says: str) -> None:
    folder = write_tiny_set(tmp_path / "set")
    damage(folder)
    with pytest.raises(DemoError, match=says):
        go(folder, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_settings_that_the_set_has_not(tiny_set: Path, tmp_path: Path) -> None:
    with pytest.raises(DemoError, match="number of points 16, not 256"):
        go(TrainData(tiny_set, num_points=256), tmp_path / "run")
    with pytest.raises(DemoError, match="frame world, not 'robot'"):
        go(TrainData(tiny_set, frame="robot"), tmp_path / "run")


def test_a_folder_of_something_else(tiny_set: Path, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "thesis.tex").write_text("")
    with pytest.raises(RunError, match=r"holds no training run, but 'thesis\.tex'"):
        go(tiny_set, tmp_path / "run")


def test_two_runs_in_one_folder(tiny_set: Path, run: Path) -> None:
    with lock_folder(run, "training run"), pytest.raises(ConfigError, match=r"another training run .*already"):
        go(tiny_set, run)


@pytest.mark.parametrize(
    ("content", "says"),
    [(b"", "is damaged, or no checkpoint"), (b"PK\x03\x04half", "is damaged, or no checkpoint")],
)
def test_damaged_checkpoints(run: Path, tiny_set: Path, content: bytes, says: str) -> None:
    (run / LATEST).write_bytes(content)
    with pytest.raises(RunError, match=says):
        go(tiny_set, run, steps=30)


def test_checkpoints_of_other_versions_and_networks(run: Path, tiny_set: Path) -> None:
    found = torch.load(run / LATEST, weights_only=True)
    torch.save(found | {"version": 9}, run / LATEST)
    with pytest.raises(RunError, match="is of version 9; this version of artiskill reads 1"):
        go(tiny_set, run, steps=30)
    weights = {name: value[..., :-1] for name, value in found["weights"].items()}
    torch.save(found | {"weights": weights}, run / LATEST)
    with pytest.raises(RunError, match="does not fit the run"):
        go(tiny_set, run, steps=30)


def test_other_versions_of_libraries_are_named(run: Path, tiny_set: Path) -> None:
    info = json.loads((run / INFO).read_text())
    info["versions"]["torch"] = "1.0"
    (run / INFO).write_text(json.dumps(info))
    lines: list[str] = []
    go(tiny_set, run, lines, steps=30)
    (note,) = [line for line in lines if line.startswith("note")]
    assert 'torch "1.0" there' in note


def test_devices_and_threads(tiny_set: Path, tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="unknown device 'gpu'"):
        train(tiny_config(), TrainData(tiny_set), tmp_path / "run", device="gpu")
    with pytest.raises(ConfigError, match="threads must be a whole number of at least 1, not 0"):
        train(tiny_config(), TrainData(tiny_set), tmp_path / "run", device="cpu", threads=0)
    if not torch.cuda.is_available():
        with pytest.raises(ConfigError, match="device 'cuda' cannot be used here"):
            train(tiny_config(), TrainData(tiny_set), tmp_path / "run", device="cuda")


def test_a_batch_that_cannot_be_split_leaves_nothing_behind(
    tiny_set: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    three = contextlib.nullcontext(Processes(0, 3))
    monkeypatch.setattr("artiskill.learning.train.joined_processes", lambda device: three)
    with pytest.raises(ConfigError, match="a batch of 8 cannot be split among 3 processes alike"):
        go(tiny_set, tmp_path / "run", batch_size=8)
    assert not (tmp_path / "run").exists()


def test_mixed_precision_trains(tiny_set: Path, tmp_path: Path) -> None:
    assert go(tiny_set, tmp_path / "run", precision="bfloat16").state.step == 20


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["--dev-objects", "test"], "nor what chooses the checkpoint may be of test and ood"),
        (["--dev-objects", "none", "cabinet-0002"], "--dev-objects none takes no other object"),
        (["--set", "network.hed=3"], "did you mean 'head'?"),
        (["--stepz", "3"], "did you mean '--steps'?"),
        (["--device", "tpu"], "unknown device 'tpu'"),
    ],
)
def test_errors_of_the_command_are_one_line(
    tiny_set: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], more: list[str], says: str
) -> None:
    out = tmp_path / "run"
    assert main(["train", "bc", "--task", TASK, "--data", str(tiny_set), "--out", str(out), *more]) == 2
    err = capsys.readouterr().err
    assert says in err
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert not out.exists()
