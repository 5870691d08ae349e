# ruff: noqa: E402
"""`artiskill train` as a process: what it prints, and how it ends."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch")

from tests.learning.tiny_set import TASK, TINY

from artiskill.learning.run import BEST, INFO, LATEST

VALUES = [f"{key}={value}" for key, value in TINY.items() if key not in ("steps", "development.objects")]
# what a machine has that only trains
NO_ENGINE = """
import sys
class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in ('mujoco', 'numba', 'llvmlite', 'h5py'):
            raise ModuleNotFoundError(f'No module named {name!r}', name=name.partition('.')[0])
sys.meta_path.insert(0, Blocker())
from artiskill.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


def command(tiny_set: Path, out: Path, steps: int = 40, *more: str) -> list[str]:
    """Arguments of a tiny run; options that `more` repeats replace these."""
    given = ["bc", "--task", TASK, "--data", str(tiny_set), "--out", str(out), "--steps", str(steps)]
    given += ["--device", "cpu", "--threads", "1", *(() if "--dev-objects" in more else ("--dev-objects", "none"))]
    return ["train", *given, *more, "--set", *VALUES]


def start(arguments: Sequence[str], launcher: Sequence[str] = ("-m", "artiskill")) -> subprocess.Popen[str]:
    pipe = subprocess.PIPE
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    return subprocess.Popen(
        [sys.executable, *launcher, *arguments], stdout=pipe, stderr=pipe, text=True, env=environment
    )


def finish(process: subprocess.Popen[str], status: int = 0) -> tuple[str, str]:
    out, err = process.communicate(timeout=120)
    assert process.returncode == status, err
    return out, err


def wait_for(path: Path, process: subprocess.Popen[str]) -> None:
    end = time.monotonic() + 120
    while not path.exists():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.01)


def weights(run: Path) -> dict[str, Any]:
    return torch.load(run / LATEST, weights_only=True)["weights"]


def assert_same_weights(one: Path, other: Path) -> None:
    ours, theirs = weights(one), weights(other)
    assert ours.keys() == theirs.keys()
    for name in ours:
        assert torch.equal(ours[name], theirs[name]), name


def test_a_killed_run_goes_on_and_ends_with_the_same_bits(tiny_set: Path, tmp_path: Path) -> None:
    steps = 1200
    whole = start(command(tiny_set, tmp_path / "whole", steps))
    killed = start(command(tiny_set, tmp_path / "parts", steps))
    wait_for(tmp_path / "parts" / LATEST, killed)
    killed.kill()
    finish(killed, -signal.SIGKILL)
    assert 0 < torch.load(tmp_path / "parts" / LATEST, weights_only=True)["state"]["step"] < steps
    out, _ = finish(start(command(tiny_set, tmp_path / "parts", steps)))
    assert re.search(r"^going on after step \d+0$", out, re.MULTILINE)
    finish(whole)
    assert_same_weights(tmp_path / "whole", tmp_path / "parts")


def test_what_a_run_prints_and_ctrl_c(tiny_set: Path, tmp_path: Path) -> None:
    process = start(command(tiny_set, tmp_path / "run", 100_000))
    wait_for(tmp_path / "run" / LATEST, process)
    process.send_signal(signal.SIGINT)
    out, err = finish(process, 130)
    assert "bc, OpenCabinetDrawer: 48 steps of 4 demonstrations on 2 objects, 16 points each" in out
    assert "100000 steps of 4, 400000 samples; float32 on cpu (1 threads)" in out
    assert "no success is measured: the last checkpoint counts" in out
    last = err.splitlines()[-1]
    assert re.fullmatch(
        r"interrupted after step \d+, which is saved; go on with: artiskill train bc --task .*", last
    )
    assert f"--out {tmp_path / 'run'}" in last


def test_without_the_engine_a_run_trains_and_says_what_it_lacks(tiny_set: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    arguments = command(tiny_set, run, 10, "--dev-objects", "generated:cabinet:1000000")
    out, err = finish(start(arguments, ["-c", NO_ENGINE]))
    assert re.search(r"^note: \w+ is not installed, so success cannot be measured here$", err, re.MULTILINE)
    assert "no success is measured: the last checkpoint counts" in out
    assert (run / LATEST).exists()
    assert not (run / BEST).exists()
    (tmp_path / "demos").mkdir()
    other = command(tmp_path / "demos", tmp_path / "other", 10)
    _, err = finish(start(other, ["-c", NO_ENGINE]), 2)
    assert "making one needs" in err
    assert len(err.splitlines()) == 1


@pytest.mark.slow
def test_two_processes_train_as_one(tiny_set: Path, tmp_path: Path) -> None:
    launcher = ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2", "-m", "artiskill"]
    finish(start(command(tiny_set, tmp_path / "two", 20), launcher))
    finish(start(command(tiny_set, tmp_path / "one", 20)))
    two, one = weights(tmp_path / "two"), weights(tmp_path / "one")
    for name in one:  # the same batches, in other sums
        torch.testing.assert_close(two[name], one[name], atol=1e-5, rtol=1e-4)
    out, _ = finish(start(command(tiny_set, tmp_path / "two", 40), launcher))
    assert out.count("going on after step 20") == 1
    finish(start(command(tiny_set, tmp_path / "whole", 40), launcher))
    assert_same_weights(tmp_path / "two", tmp_path / "whole")


@pytest.mark.slow
def test_ctrl_c_reaches_two_processes(tiny_set: Path, tmp_path: Path) -> None:
    launcher = ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2", "-m", "artiskill"]
    process = start(command(tiny_set, tmp_path / "run", 100_000), launcher)
    wait_for(tmp_path / "run" / LATEST, process)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert process.returncode != 0
    assert re.search(r"interrupted after step \d+, which is saved", err)
    assert (tmp_path / "run" / INFO).exists()
