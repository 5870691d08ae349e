import json
import sys
from pathlib import Path

import pytest

from artiskill.bench.cases import Case
from artiskill.bench.measure import Measurement
from artiskill.bench.report import BenchReport
from artiskill.cli.bench import print_bench
from artiskill.cli.main import main

Capture = pytest.CaptureFixture[str]
MACHINE = {"processor": "Abacus", "cores": 2, "load": 0.1, "versions": {"artiskill": "1", "mujoco-core": "4"}}


def test_bench_shows_and_writes(tmp_path: Path, capsys: Capture) -> None:
    pytest.importorskip("matplotlib")
    out = tmp_path / "bench"
    line = ["bench", "--task", "OpenCabinetDrawer", "--num-envs", "2", "--threads", "1"]
    assert main([*line, "--objects", "cabinet-0003", "--seconds", "0.01", "--out", str(out)]) == 0
    shown = capsys.readouterr()
    assert "OpenCabinetDrawer   state" in shown.out
    assert f"written: {out}/bench.json" in shown.out
    assert "1/1 rows" in shown.err
    assert json.loads((out / "bench.json").read_text())["cases"][0]["num_envs"] == 2
    assert (out / "bench.png").stat().st_size > 5000


def test_the_table(capsys: Capture) -> None:
    measurements = [
        Measurement(
            Case(task, "pointcloud", size, 2, ("train",), 1200),
            *(9, 1234.5, 1543.0, 0.8, (0.7, 0.9), 2.345, 1200.0, 30862.5, memory),
        )
        for task, size, memory in (
            ("OpenCabinetDrawer", 16, 1234.4),
            ("OpenCabinetDrawer", 1024, None),
            ("PushChair", 2, 3.0),
        )
    ]
    print_bench(BenchReport(MACHINE, measurements))
    lines = [line.split() for line in capsys.readouterr().out.splitlines() if line.strip()]
    row = ["pointcloud", "1200", "16", "2", "1,234", "1,543", "0.80", "1,200", "2.35", "1,234"]
    assert ["OpenCabinetDrawer", *row] in lines
    assert ["pointcloud", "1200", "1,024", "2", "1,234", "1,543", "0.80", "1,200", "2.35", "-"] in lines
    assert lines[-1] == ["Abacus,", "2", "cores,", "artiskill", "1,", "mujoco", "4"]


def test_a_busy_machine_is_told_of(capsys: Capture) -> None:
    print_bench(BenchReport(MACHINE | {"load": 5.0}, []))
    assert "the machine was busy (load 5.0)" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("--task OpenCabinetDrwer", "did you mean 'OpenCabinetDrawer'?"),
        ("--obs rgb", "did you mean 'rgbd'?"),
        ("--num-envs 0", "num_envs must be at least 1, not 0"),
        ("--num-envs few", "invalid int value: 'few'"),
        ("--threads 0", "threads must be at least 1"),
        ("--task PushChair --objects cabinet-0003", "cabinet-0003"),
        ("--seconds 0", "seconds must be positive"),
    ],
)
def test_errors_are_one_line_and_come_at_once(line: str, says: str, capsys: Capture) -> None:
    assert main(["bench", *line.split()]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("error: ")
    assert shown.err.count("\n") == 1
    assert says in shown.err


def test_without_the_extra_nothing_is_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert main(["bench", "--out", str(tmp_path / "out")]) == 2
    assert "pip install 'artiskill[bench]'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_said_before_anything_is_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert main(["bench", "--out", str(tmp_path / "file" / "bench")]) == 2
    assert "cannot write to" in capsys.readouterr().err
