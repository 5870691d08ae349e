"""Confinement: which kind is taken, what it says, what a solution may still do, and what its limits say."""

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.evaluation.test_attacks import why_not

from artiskill.cli.main import main
from artiskill.errors import ArtiSkillError, ConfigError, PolicyError, UnknownNameError
from artiskill.evaluation import sandbox
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.report import REPORT_JSON, write_report
from artiskill.evaluation.sandbox import BUBBLEWRAP, LANDLOCK, LIMITS, NONE, SANDBOXES, SandboxConfig
from artiskill.evaluation.solution import FileSolution
from artiskill.evaluation.verify import verify_policy, verify_report
from artiskill.sensors.observations.sampling import cell_of

Write = Callable[[str], Path]
INFO = {"object": "cabinet-0005", "level": 4, "target": "link_1"}
STILL = "def policy(o):\n    return [0.0] * 13\n"
SHORT: dict[str, Any] = {"config": {"episode_steps": 3}}
linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="confinement needs Linux")


def need(kind: str) -> None:
    if why := why_not(kind):
        pytest.skip(why)


def first_action(path: Path, config: SandboxConfig, size: int = 1) -> Any:
    found = FileSolution(path, sandbox=config)
    try:
        found.reset(np.zeros(3), INFO)
        return found.act(np.zeros(3), (size,)).tolist()
    finally:
        found.close()


@pytest.mark.parametrize("kind", SANDBOXES)
def test_what_is_promised_was_tried(solution: Write, kind: str) -> None:
    need(kind)
    found = FileSolution(solution(STILL), sandbox=SandboxConfig(kind))
    held, tried = found.confinement.held, found.confinement.tried
    found.close()
    assert found.confinement.sandbox == kind
    if kind in (BUBBLEWRAP, LANDLOCK):
        assert all(held.values())
        assert not any("possible" in ways.values() for ways in tried.values())
        assert found.confinement.text.endswith("(held: files, network, memory, processes, privileges, time)")
    else:
        assert not held["files"]
        assert not held["network"]
        assert set(tried["network"].values()) <= {"possible", "ENETUNREACH"}  # there may be no network at all


@linux
def test_the_next_kind_is_taken_where_one_does_not_hold(
    solution: Write, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    broken = tmp_path / "bin" / "bwrap"
    broken.parent.mkdir()
    monkeypatch.setenv("PATH", str(broken.parent))
    path = solution(STILL)
    found = FileSolution(path)
    assert found.confinement.passed_over["bubblewrap"].startswith("bwrap is not on the path")
    found.close()
    broken.write_text("#!/bin/sh\necho no namespaces here >&2\nexit 1\n")
    broken.chmod(0o755)
    found = FileSolution(path)
    assert found.confinement.passed_over["bubblewrap"] == "no namespaces here"
    assert found.confinement.sandbox != "bubblewrap"
    found.close()
    with pytest.raises(ConfigError, match=r"^sandbox 'bubblewrap' does not hold here: no namespaces here; "):
        FileSolution(path, sandbox=SandboxConfig("bubblewrap"))


def test_elsewhere_only_limits_are_left(solution: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "darwin")
    found = FileSolution(solution(STILL))
    found.close()
    assert found.confinement.sandbox == LIMITS
    assert set(found.confinement.passed_over) == {BUBBLEWRAP, LANDLOCK}
    assert found.confinement.passed_over[LANDLOCK] == "it needs Linux, not darwin"
    with pytest.raises(ConfigError, match=r"^sandbox 'landlock' does not hold here: it needs Linux, not darwin; "):
        FileSolution(solution(STILL), sandbox=SandboxConfig(LANDLOCK))


def test_long_paths_for_temporary_files(solution: Write, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """No socket can have such a path."""
    long = tmp_path / ("x" * 120)
    long.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(long))
    assert first_action(solution(STILL), SandboxConfig(), 13) == [0.0] * 13


@linux
def test_what_does_not_hold_is_not_taken_for_held(solution: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrapper that confines nothing, but for what the process does to itself."""
    monkeypatch.setattr(sandbox._Place, "prefix", lambda self: [])
    monkeypatch.setattr(sandbox.shutil, "which", lambda name: f"/usr/bin/{name}")  # bwrap need not be here
    with pytest.raises(
        ConfigError, match="'bubblewrap' does not hold here: a process in it can read a file of the"
    ):
        FileSolution(solution(STILL), sandbox=SandboxConfig("bubblewrap"))


def test_unknown_kinds_and_illegal_limits() -> None:
    with pytest.raises(UnknownNameError, match=r"unknown sandbox 'bublewrap'.*'bubblewrap'"):
        SandboxConfig("bublewrap")
    with pytest.raises(ConfigError, match="memory_gb must be positive and finite, not 0"):
        SandboxConfig(memory_gb=0)


# -- what may be used ---------------------------------------------------------------------------------------------

USES = """
import os, tempfile, threading
import beside, numpy as np
from concurrent.futures import ThreadPoolExecutor
weights = np.load("weights.npy")
with tempfile.NamedTemporaryFile() as file:
    file.write(bytes(10)), file.flush()
    assert os.path.getsize(file.name) == 10
assert os.path.expanduser("~") == tempfile.gettempdir()
def policy(observation):
    with ThreadPoolExecutor(2) as pool:
        return [sum(pool.map(float, weights)) + beside.VALUE]
"""


@pytest.mark.parametrize("kind", [BUBBLEWRAP, LANDLOCK, LIMITS])
def test_a_confined_solution_has_what_it_needs(solution: Write, kind: str) -> None:
    need(kind)
    path = solution(USES)
    np.save(path.with_name("weights.npy"), np.arange(4.0))
    path.with_name("beside.py").write_text("VALUE = 0.5\n")
    assert first_action(path, SandboxConfig(kind)) == [6.5]


COMPILED = """
from numba.core import event
from artiskill.sensors.observations.sampling import cell_of
compiled = []
class Listener(event.Listener):
    def on_start(self, e): compiled.append(e.data["dispatcher"].py_func.__name__)
    def on_end(self, e): pass
event.register("numba:compile", Listener())
def policy(observation):
    return [cell_of(1.0, 0.5), len(compiled)]
"""


@pytest.mark.parametrize("kind", [BUBBLEWRAP, LANDLOCK, LIMITS])
def test_a_confined_solution_reads_kernels_that_are_compiled(solution: Write, kind: str) -> None:
    need(kind)
    assert cell_of(1.0, 0.5) == 2, "which compiles it, unless that is done"
    assert first_action(solution(COMPILED), SandboxConfig(kind), 2) == [2.0, 0.0]


@pytest.mark.parametrize("kind", [BUBBLEWRAP, LANDLOCK])
def test_other_folders_are_readable_if_they_are_named(solution: Write, tmp_path: Path, kind: str) -> None:
    need(kind)
    other = tmp_path / "other"
    other.mkdir()
    (other / "weights").write_text("3")
    (tmp_path / "entry").mkdir()
    path = solution(f"with open({str(other / 'weights')!r}) as file:\n    w = float(file.read())\n{STILL}")
    path = path.rename(tmp_path / "entry" / "solution.py")
    assert first_action(path, SandboxConfig(kind, readable=(str(other),)), 13) == [0.0] * 13
    with pytest.raises(PolicyError, match=r"cannot be imported: (FileNotFound|Permission)Error"):
        first_action(path, SandboxConfig(kind))


@pytest.mark.parametrize("kind", [BUBBLEWRAP, LANDLOCK])
def test_neighbours_in_a_home_folder_are_not_its_own(
    solution: Write, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    need(kind)
    path = solution("open(__file__[:-11] + 'notes')\n" + STILL)
    path.with_name("notes").write_text("private")
    first_action(path, SandboxConfig(kind), 13)
    monkeypatch.setenv("HOME", str(path.parent))
    with pytest.raises(PolicyError, match=r"(Permission|FileNotFound)Error"):
        first_action(path, SandboxConfig(kind), 13)


def test_what_it_prints_is_shown_but_leads_nowhere(solution: Write, capfd: pytest.CaptureFixture[str]) -> None:
    first_action(solution("print('a word\\x1b[2J')\n" + STILL), SandboxConfig(), 13)
    said = capfd.readouterr()
    assert said.err == "solution: a word[2J\n"
    assert said.out == ""


def test_output_ends_somewhere(solution: Write, capfd: pytest.CaptureFixture[str]) -> None:
    first_action(solution("for _ in range(30):\n    print('x' * 99_999)\n" + STILL), SandboxConfig(), 13)
    said = capfd.readouterr().err
    assert len(said) < 1_200_000
    assert said.endswith("solution: (what it prints from here on is not shown)\n")


def test_nothing_is_left_behind(solution: Write) -> None:
    found = FileSolution(solution(STILL))
    folder = found._process._sandboxed.folder
    left = os.path.join(os.path.dirname(folder), "artiskill-leftover"[:18])
    os.makedirs(left, exist_ok=True)  # of an evaluator that was killed
    other = FileSolution(solution(STILL))
    assert os.path.exists(folder)
    assert not os.path.exists(left)
    for one in (found, other):
        one.close()
    assert not os.path.exists(folder)


# -- limits, reports ----------------------------------------------------------------------------------------------


def test_time_limits(solution: Write) -> None:
    slow = solution("import time\ndef policy(o):\n    time.sleep(60)\n")
    with pytest.raises(PolicyError, match=r"no action within 2 s \(object cabinet-0005, level 4, step 0\)$"):
        first_action(slow, SandboxConfig(step_timeout_s=2.0))
    with pytest.raises(PolicyError, match=r"its actions took more than 2 s in this episode \(.*, step 0\)$"):
        first_action(slow, SandboxConfig(episode_timeout_s=2.0))
    stuck = solution(
        "import time\nclass Policy:\n    obs_mode = 'state'\n"
        "    def reset(self, o, i): time.sleep(60)\n    def act(self, o): pass\n"
    )
    with pytest.raises(PolicyError, match=r"reset\(\) has not ended within 2 s \(object cabinet-0005, level 4\)$"):
        first_action(stuck, SandboxConfig(step_timeout_s=2.0))


def test_a_report_says_what_held_and_is_verified(solution: Write, tmp_path: Path) -> None:
    path = solution(STILL)
    report = evaluate("OpenCabinetDrawer", path, "cabinet-0005", 1, **SHORT)
    other = evaluate("OpenCabinetDrawer", path, "cabinet-0005", 1, **SHORT, sandbox=NONE)
    assert report.protocol == other.protocol
    assert other.confinement is not None
    assert (other.confinement.sandbox, other.confinement.passed_over) == (NONE, {})
    folder = write_report(report, tmp_path / "report")
    stored = json.loads((folder / REPORT_JSON).read_text())["confinement"]
    assert stored["held"] == report.confinement.held
    assert stored["limits"]["step_timeout_s"] == 60.0
    assert report.confinement.text in (folder / "report.md").read_text()
    assert verify_report(folder).faults == ()
    assert verify_policy(folder, str(path), 1, np.random.default_rng(0)).faults == ()
    stored["held"]["network"] = not stored["held"]["network"]
    forged = json.loads((folder / REPORT_JSON).read_text()) | {"confinement": stored}
    (folder / REPORT_JSON).write_text(json.dumps(forged, indent=2) + "\n")
    assert "was changed" in verify_report(folder).faults[0]


def test_policies_of_the_package_have_no_confinement() -> None:
    report = evaluate("OpenCabinetDrawer", "still", "cabinet-0005", 1, **SHORT)
    assert report.confinement is None
    assert report.to_mapping()["confinement"] is None


def test_the_command(solution: Write, capsys: pytest.CaptureFixture[str]) -> None:
    common = ["evaluate", "--policy", str(solution(STILL)), "--objects", "cabinet-0005", "--episodes", "1"]
    common += ["--set", "episode_steps=2"]
    assert main([*common, "--sandbox", "limits", "--memory", "4"]) == 0
    assert "confinement limits (held: " in capsys.readouterr().out
    assert main([*common, "--sandbox", "jail"]) == 2
    assert "unknown sandbox 'jail'" in capsys.readouterr().err


def test_errors_are_of_this_package() -> None:
    assert issubclass(sandbox.SandboxError, ArtiSkillError)
