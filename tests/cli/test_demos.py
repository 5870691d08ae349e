import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from artiskill.cli.main import main
from artiskill.demos import demonstrator
from artiskill.demos.demos import PACK, load_demo_pack
from artiskill.demos.training_file import TrainingFile

DRAWERS = str(PACK / "OpenCabinetDrawer")


def test_collect_verify_stats(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "demos" / "drawers"
    collect = ["demos", "collect", "--task", "OpenCabinetDrawer", "--objects", "cabinet-0026", "--out", str(out)]
    collect += ["--per-object", "3", "--workers", "1"]
    assert main(collect) == 0
    shown = capsys.readouterr()
    assert "cabinet-0026         2      3/3          3   100%" in shown.out
    assert shown.err.splitlines()[-1].startswith("OpenCabinetDrawer, joint: 3/3 trajectories, 100% solved, ")
    assert main(collect) == 0
    assert capsys.readouterr().err == ""  # nothing was left to do

    assert main(["demos", "verify", str(tmp_path / "demos"), "--workers", "1"]) == 0
    assert "3 of 3 trajectories bit-exact: all is as recorded" in capsys.readouterr().out

    numbers = tmp_path / "stats.json"
    assert main(["demos", "stats", str(out), "--json", str(numbers)]) == 0
    assert (
        "OpenCabinetDrawer, joint: 3 trajectories of 1 object, 100.0% of the attempts solved"
        in capsys.readouterr().out
    )
    assert json.loads(numbers.read_text())[0]["objects"][0]["successes"] == 3

    assert main([*collect, "--plain"]) == 2
    assert "other settings (variety true there, false here" in capsys.readouterr().err

    with (out / "cabinet-0026.h5").open("ab") as file:
        file.write(b"x")
    assert main(["demos", "verify", str(out), "--workers", "1"]) == 1
    assert "is not the file that the manifest lists" in capsys.readouterr().out


def test_replay_export_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pack = load_demo_pack("OpenCabinetDrawer")
    name, training = pack.objects[0], str(tmp_path / "training")
    replay = ["demos", "replay", str(pack.folder), "--out", training, "--obs-mode", "pointcloud", "--points", "60"]
    replay += [
        "--objects",
        name,
        "--count",
        "2",
        "--set",
        "cameras.width=40",
        "cameras.height=16",
        "--workers",
        "1",
    ]
    assert main(replay) == 0
    shown = capsys.readouterr()
    assert f"{name}          2        2           2      0.0%      2" in shown.out
    assert shown.err.splitlines()[-1].startswith(
        "OpenCabinetDrawer, pointcloud, joint: 2/2 trajectories, 100% solved"
    )
    assert main(replay) == 0
    assert capsys.readouterr().err == ""  # nothing was left to do
    for file_format in ("minari", "lerobot"):
        export = ["demos", "export", training, "--format", file_format, "--out", str(tmp_path / file_format)]
        assert main(export) == 0
        assert "2 trajectories: " in capsys.readouterr().out
        assert main(export) == 2
        assert "exists: remove it" in capsys.readouterr().err
    picture = str(tmp_path / "picture.png")
    command = ["demos", "pictures", str(pack.folder), "--object", name, "--out", picture, "--count", "1"]
    assert main([*command, "--moments", "2", "--width", "40"]) == 0
    assert capsys.readouterr().out == f"{picture}: {name}, demonstrations 0\n"


def test_replay_by_shares_sees_no_robot(tmp_path: Path) -> None:
    pack = load_demo_pack("OpenCabinetDrawer")
    name, training = pack.objects[0], tmp_path / "training"
    replay = ["demos", "replay", str(pack.folder), "--out", str(training), "--obs-mode", "pointcloud"]
    replay += ["--points", "128", "--objects", name, "--count", "1", "--workers", "1"]
    assert main([*replay, "--method", "shares"]) == 0
    with TrainingFile(training / f"{name}.h5") as file:
        seg = file.array(0, "obs/pointcloud/seg")
    handle, link, robot = (seg[..., mask].mean() for mask in range(3))
    assert robot == 0
    assert link > 0.5 > handle > 0.1


def test_a_half_collected_folder_is_called_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, pack = tmp_path / "drawers", load_demo_pack("OpenCabinetDrawer")
    shutil.copytree(pack.folder, out)
    staged = out / ".unfinished" / "cabinet-0001"
    staged.mkdir(parents=True)
    line = f"{out} is not finished: 1 object is still to be collected"
    replay = ["replay", str(out), "--out", str(tmp_path / "t"), "--obs-mode", "state", "--restore", "--count", "1"]
    for command in (["verify", str(out)], ["stats", str(out)], replay):
        workers = [] if command[0] == "stats" else ["--workers", "1"]
        assert main(["demos", *command, *workers]) == 0
        shown = capsys.readouterr().out
        assert line in shown
    row = next(text for text in shown.splitlines() if pack.objects[0] in text)
    assert row.split()[1:4] == ["1", "1", "-"]  # restored: most of its states are rounded
    staged.rmdir()
    assert main(["demos", "stats", str(out)]) == 0
    assert "not finished" not in capsys.readouterr().out


def test_an_object_that_no_expert_solves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    collect = [
        "demos",
        "collect",
        "--task",
        "OpenCabinetDrawer",
        "--objects",
        "cabinet-0002",
        "--per-object",
        "100",
    ]
    assert main([*collect, "--set", "episode_steps=1", "--out", str(tmp_path / "d"), "--workers", "1"]) == 1
    shown = capsys.readouterr().out
    assert "given up after 50 attempts, 0 of 100 trajectories" in shown


COLLECT = ["demos", "collect", "--task", "OpenCabinetDrawer", "--objects", "cabinet-0002", "--workers", "1"]


def test_what_ends_attempts_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def record(*arguments: object) -> None:
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr(demonstrator, "record", record)
    assert main([*COLLECT, "--per-object", "60", "--out", str(tmp_path / "d")]) == 1
    told = "given up after 50 attempts, 0 of 60 trajectories; ended before their end, of 50 attempts: 50 by Lin"
    assert f"cabinet-0002, link_0: {told}" in capsys.readouterr().out
    assert main(["demos", "stats", str(tmp_path / "d")]) == 0
    assert "joint: 0 trajectories of 1 object, 0.0% of the attempts solved" in capsys.readouterr().out


def test_ctrl_c_says_that_it_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def record(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(demonstrator, "record", record)
    out = str(tmp_path / "d")
    assert main([*COLLECT, "--out", out]) == 130
    assert (
        capsys.readouterr().err
        == "interrupted; all that was made before is kept: the same command goes on from there\n"
    )
    for command in ("verify", "stats"):
        assert main(["demos", command, out]) == 0
        shown = capsys.readouterr().out
        assert f"{out} is not finished: 1 object is still to be collected, and not counted here" in shown
        assert "as recorded" not in shown


def test_files_beside_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pack = Path(shutil.copytree(DRAWERS, tmp_path / "pack"))
    content = json.loads((pack / "manifest.json").read_text())
    name = sorted(content["files"])[0]
    del content["files"][name]
    (pack / "manifest.json").write_text(json.dumps(content))
    assert main(["demos", "stats", str(pack)]) == 0
    assert f"{pack}: {name}: not in the manifest, and not counted here; the next" in capsys.readouterr().out


@pytest.mark.parametrize(
    "command",
    [
        [*COLLECT, "--out", ""],
        [*COLLECT, "--out", " "],
        ["demos", "verify", ""],
        ["demos", "stats", ".", "--json", ""],
    ],
)
def test_no_path_is_empty(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An empty variable of a shell is not the working directory."""
    monkeypatch.chdir(tmp_path)
    assert main(command) == 2
    assert "needs a path, not '" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("command", "error"),
    [
        (["collect", "--task", "OpenCabinetDrawer"], "the following arguments are required: --out"),
        (["collect", "--task", "PushChairs", "--out", "x"], "unknown task 'PushChairs'; did you mean 'PushChair'"),
        (["collect", "--task", "PushChair", "--out", "x", "--per-object", "0"], "trajectories per object must be"),
        (["verify", "x"], "holds no demonstrations"),
        (["stats", "x"], "holds no demonstrations"),
        (["replay", "x", "--out", "y", "--obs-mode", "state"], "holds no demonstrations"),
        (
            ["replay", DRAWERS, "--out", "y", "--obs-mode", "cloud"],
            "unknown observation mode 'cloud'; did",
        ),
        (
            ["replay", DRAWERS, "--out", "y", "--obs-mode", "state", "--points", "9"],
            "--points is for --obs-mode point",
        ),
        (["replay", DRAWERS, "--out=y", "--obs-mode", "pointcloud", "--points", "many"], "a number or `all`"),
        (["replay", DRAWERS, "--out=y", "--obs-mode", "state", "--objects", "chair-0004"], "unknown object"),
        (["export", DRAWERS, "--format", "minari", "--out", "y"], "holds no training files"),
        (["export", "x", "--format", "minary", "--out", "y"], "did you mean 'minari'"),
        (["pictures", DRAWERS, "--object", "x", "--out", "a.png"], "unknown object 'x'"),
        (["collcet"], "unknown command 'collcet'; did you mean 'collect'"),
    ],
)
def test_errors_are_one_line(
    command: list[str],
    error: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["demos", *command]) == 2
    shown = capsys.readouterr().err
    assert error in shown
    assert len(shown.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_without_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    command = ["demos", "collect", "--task", "OpenCabinetDrawer", "--objects", "cabinet-0002"]
    assert main([*command, "--out", str(tmp_path / "d")]) == 2
    assert "pip install 'artiskill[demos]'" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
