# ruff: noqa: E402
"""`artiskill export-policy`: a run in one file acts as the run does."""

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from tests.learning.tiny_set import SIZES, tiny_config

from artiskill.cli.main import main
from artiskill.learning.array_policy import ArrayPolicy
from artiskill.learning.policy import RunPolicy
from artiskill.learning.train import TrainData, train


@pytest.fixture(scope="module")
def run(tiny_set: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    train(tiny_config("td3bc", ema=0.5), TrainData(tiny_set), folder, device="cpu", threads=1)
    return folder


def test_the_file_acts_as_its_run(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "new" / "policy.npz"
    assert main(["export-policy", str(run), str(path)]) == 0
    out = capsys.readouterr().out
    assert f"artiskill evaluate --task OpenCabinetDrawer --policy {path}" in out
    assert f"td3bc of {run}, as it was after step 20 of 20\n" in out
    exported, original = ArrayPolicy(path), RunPolicy(run)
    assert (exported.control_mode, exported.sampling) == (original.control_mode, original.sampling)
    rng = np.random.default_rng(0)
    for _ in range(3):
        cloud = {
            "xyz": rng.normal(size=(SIZES.points, 3)).astype(np.float32),
            "rgb": rng.integers(256, size=(SIZES.points, 3), dtype=np.uint8),
            "seg": rng.random((SIZES.points, SIZES.masks)) < 0.3,
        }
        seen = {"pointcloud": cloud, "agent": rng.normal(size=SIZES.agent).astype(np.float32)}
        np.testing.assert_allclose(exported.act(seen), original.act(seen), atol=1e-5)


@pytest.mark.parametrize(
    ("name", "message"),
    [("policy.pt", "must end in .npz"), ("folder.npz", "folder.npz"), ("file/policy.npz", "cannot write")],
)
def test_where_no_file_can_be_written(
    run: Path, tmp_path: Path, name: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "folder.npz").mkdir()
    (tmp_path / "file").touch()
    assert main(["export-policy", str(run), str(tmp_path / name)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert message in error
    assert error.count("\n") == 1


def test_only_commands_recover(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export-policy", str(run), str(tmp_path / "policy.npz"), "--recovery"]) == 2
    assert (
        capsys.readouterr().err == "error: recovery needs commands, which dagger and command_bc learn, not td3bc\n"
    )
    assert not (tmp_path / "policy.npz").exists()


def test_what_is_no_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export-policy", str(tmp_path), str(tmp_path / "policy.npz")]) == 2
    assert "is a folder, but of no training run" in capsys.readouterr().err
    assert main(["export-policy", str(tmp_path / "none"), str(tmp_path / "policy.npz")]) == 2
    assert "there is no folder" in capsys.readouterr().err
    assert not (tmp_path / "policy.npz").exists()
