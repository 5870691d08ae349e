"""The queue of cells: what is done is not done again."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from learning_tables.cells import STAGES, A, Cell, Method, Resources, Settings, place_of
from learning_tables.queue import CommandError, Queue, locked, training_seconds

CELL = Cell(A, Method("small", "bc"), "10", 0)
ALL = ["demos", "training-set", "train", "evaluate"]


def run(work: Path, settings: Settings, *stages: str) -> None:
    with locked(work) as lock:
        Queue(settings, work, Resources("cpu", "float32", 1), stages or STAGES, lock).run(CELL)


def verbs(lines: list[str]) -> list[str]:
    return [line.split()[0] for line in lines]


def test_a_cell_goes_on_where_it_was_stopped(
    tmp_path: Path, settings: Settings, called: Callable[[], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    work = tmp_path / "work"
    monkeypatch.setenv("FAILS", "train")
    with pytest.raises(CommandError, match="exit status 2 of: artiskill train bc --task OpenCabinetDrawer"):
        run(work, settings)
    assert verbs(called()) == ALL[:3]
    monkeypatch.delenv("FAILS")
    run(work, settings)
    assert verbs(called()) == ALL[2:]
    place = place_of(CELL, work)
    assert place.is_finished
    trained = json.loads(place.trained.read_text())
    assert (trained["steps"], trained["samples"], trained["seconds"]) == (10, 80, 30.0)
    run(work, settings)
    assert called() == []


def test_a_training_set_that_was_not_finished_is_made(
    tmp_path: Path, settings: Settings, called: Callable[[], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAILS", "training-set")
    with pytest.raises(CommandError, match="artiskill training-set"):
        run(tmp_path / "work", settings)
    assert verbs(called()) == ALL[:2]
    monkeypatch.delenv("FAILS")
    run(tmp_path / "work", settings)
    assert verbs(called()) == ALL


def test_stages_may_be_done_on_several_machines(
    tmp_path: Path, settings: Settings, called: Callable[[], list[str]]
) -> None:
    for stage, done in (("evaluate", []), ("collect", ALL[:2]), ("train", ALL[2:3]), ("evaluate", ALL[3:])):
        run(tmp_path / "work", settings, stage)
        assert verbs(called()) == done


def test_time_of_training_is_that_of_all_steps(tmp_path: Path) -> None:
    table = tmp_path / "metrics.csv"
    assert training_seconds(table, 10) is None
    table.write_text("step,seconds,loss\n")
    assert training_seconds(table, 10) is None
    table.write_text("step,seconds,loss\n4,2.0,1\n8,4.0,1\n")
    assert training_seconds(table, 10) == 5.0


def test_a_killed_queue_takes_its_command_along(tmp_path: Path) -> None:
    sleep = "[sys.executable, '-c', 'import time; time.sleep(60)']"
    code = (
        "import subprocess, sys; from learning_tables.queue import _end_with_parent as end; "
        f"print(subprocess.Popen({sleep}, preexec_fn=end).pid, flush=True); input()"
    )
    path = str(Path(__file__).resolve().parents[3] / "tools")
    environment = os.environ | {"PYTHONPATH": path}
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment
    ) as queue:
        assert queue.stdout is not None
        command = int(queue.stdout.readline())
        queue.kill()
    deadline = time.monotonic() + 60
    while is_alive(command) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not is_alive(command)


def is_alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
