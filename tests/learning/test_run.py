"""The run's folder; nothing here needs torch."""

import dataclasses
import json
from pathlib import Path

import pytest

from artiskill.errors import PolicyError, RunError
from artiskill.learning.run import (
    BEST,
    INFO,
    LATEST,
    RunInfo,
    Table,
    read_info,
    run_folder,
    weights_digest,
    weights_file,
    write_info,
    write_whole,
)

INFORMATION = RunInfo(
    task="OpenCabinetDrawer",
    algorithm="bc",
    control_mode="joint",
    sampling={"num_points": 16, "method": "maniskill", "frame": "world", "settings": {}},
    sizes={"points": 16, "masks": 3, "agent": 38, "action": 13},
    statistics={"point_mean": [0.0, 0.5, 1.0]},
    overrides={},
    data="0" * 64,
    objects=["cabinet-0002"],
    steps=10,
    versions={"torch": "2.13.0"},
)


def test_cameras_of_the_demonstrations_are_asked_for() -> None:
    overrides = {"episode_steps": 90, "cameras": {"width": 64}, "cameras.height": 48, "render.sky": True}
    asked = dataclasses.replace(INFORMATION, overrides=overrides).observation_config
    assert asked == {"cameras": {"width": 64}, "cameras.height": 48, "render.sky": True}


def test_what_a_run_says_of_itself(tmp_path: Path) -> None:
    write_info(INFORMATION, tmp_path)
    assert read_info(tmp_path) == INFORMATION


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"version": 7}, "is a training run of version 7; this version of artiskill reads 1"),
        ({"format": "other"}, "holds no training run"),
        ({"steps": "many"}, "is damaged"),
    ],
)
def test_other_runs_and_damaged_ones(tmp_path: Path, change: dict[str, object], says: str) -> None:
    write_info(INFORMATION, tmp_path)
    (tmp_path / INFO).write_text(json.dumps(json.loads((tmp_path / INFO).read_text()) | change))
    with pytest.raises(RunError, match=says):
        read_info(tmp_path)


def test_no_run_and_half_a_file(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"holds no training run: it has no run\.json"):
        read_info(tmp_path)
    (tmp_path / INFO).write_text("{")
    with pytest.raises(RunError, match="is damaged"):
        read_info(tmp_path)


def test_the_best_checkpoint_acts_else_the_latest(tmp_path: Path) -> None:
    with pytest.raises(PolicyError, match="of no training run"):
        weights_file(tmp_path)
    write_info(INFORMATION, tmp_path)
    with pytest.raises(PolicyError, match="without a checkpoint yet"):
        weights_file(tmp_path)
    write_whole(tmp_path / LATEST, b"latest")
    assert weights_file(tmp_path) == tmp_path / LATEST
    first = weights_digest(tmp_path)
    write_whole(tmp_path / BEST, b"best")
    assert weights_file(tmp_path) == tmp_path / BEST
    assert weights_digest(tmp_path) != first == weights_digest(tmp_path / LATEST)
    assert run_folder(tmp_path / LATEST) == run_folder(tmp_path) == tmp_path
    with pytest.raises(PolicyError, match="there is no file"):
        weights_file(tmp_path / "other.pt")


def test_a_folder_may_have_a_dot_and_a_checkpoint_a_short_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "lr0.001"
    write_whole(run / LATEST, b"latest")
    assert weights_file(run) == run / LATEST
    monkeypatch.chdir((run / LATEST).parent)
    assert run_folder(LATEST.name) == run


def test_a_table_forgets_what_came_after_a_checkpoint(tmp_path: Path) -> None:
    path = tmp_path / "metrics.csv"
    table = Table(path, 0)
    for step in (5, 10, 15):
        table.add({"step": step, "loss": step / 2})
    assert path.read_text() == "step,loss\n5,2.5\n10,5.0\n15,7.5\n"
    again = Table(path, 10)
    again.add({"step": 15, "loss": 8.0})
    assert path.read_text() == "step,loss\n5,2.5\n10,5.0\n15,8.0\n"


def test_a_table_takes_new_columns_and_misses_old_ones(tmp_path: Path) -> None:
    table = Table(tmp_path / "metrics.csv", 0)
    table.add({"step": 1, "a": 1})
    table.add({"step": 2, "b": 2})
    table.add({"step": 3, "a": 3})
    assert (tmp_path / "metrics.csv").read_text() == "step,a,b\n1,1,\n2,,2\n3,3,\n"


def test_a_damaged_table(tmp_path: Path) -> None:
    (tmp_path / "metrics.csv").write_text("step,a\nx,1\n")
    with pytest.raises(RunError, match=r"is damaged.*remove it to go on without"):
        Table(tmp_path / "metrics.csv", 5)


def test_half_a_row_of_a_killed_run_is_after_its_checkpoint(tmp_path: Path) -> None:
    (tmp_path / "metrics.csv").write_text("step,a\n5,1\n1")
    assert [row["step"] for row in Table(tmp_path / "metrics.csv", 5).rows] == ["5"]
