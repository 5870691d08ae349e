"""Solutions that harm their process: told alike, or to no effect, for any number of workers."""

import builtins
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.errors import ConfigError, PolicyError
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.plan import plan_evaluation
from artiskill.evaluation.recording import record_video
from artiskill.evaluation.report import Report
from artiskill.jobs import worker as worker_module

TASK, OBJECTS = "OpenCabinetDrawer", ["cabinet-0005", "cabinet-0010", "cabinet-0028"]
SHORT = {"episode_steps": 3}
WORKERS = pytest.mark.parametrize("workers", [1, 2])


def comparable(report: Report) -> dict[str, Any]:
    mapping = report.to_mapping()
    mapping.pop("timing")
    mapping.pop("sha256")
    return mapping


def test_what_helper_modules_remember_ends_with_the_object(solution: Callable[[str], Path]) -> None:
    path = solution(
        "import helper, numpy as np\n"
        "class Policy:\n    obs_mode = 'state'\n"
        "    def reset(self, observation, info):\n        helper.seen.append(info['episode'])\n"
        "    def act(self, observation):\n"
        "        if helper.seen not in ([0], [0, 1]):\n            raise ValueError(helper.seen)\n"
        "        return np.full(13, 0.1)\n"
    )
    path.with_name("helper.py").write_text("seen = []\n")
    one, two = (evaluate(TASK, path, OBJECTS, 2, config=SHORT, workers=count) for count in (1, 2))
    assert comparable(one) == comparable(two)
    assert one.total.episodes == 6


def test_a_solution_leaves_no_trace_in_the_process_that_evaluates(
    solution: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    before = os.getcwd(), list(sys.path), dict(os.environ)
    solution(
        "import os, sys, builtins, numpy as np, only_helper\n"
        "os.chdir('/')\nos.environ['TOUCHED'] = 'yes'\nsys.path.insert(0, '/nowhere')\n"
        "np.e = builtins.ascii = None\n"
        "def policy(observation):\n    os.chdir('/tmp')\n    return [0.0] * 13\n"
    )
    (tmp_path / "only_helper.py").write_text("")
    reports = [evaluate(TASK, "solution.py", OBJECTS, 1, config=SHORT, workers=count) for count in (1, 2)]
    assert comparable(reports[0]) == comparable(reports[1])
    assert (os.getcwd(), list(sys.path), dict(os.environ)) == before
    assert "only_helper" not in sys.modules
    assert (np.e, builtins.ascii("ä")) == (math.e, r"'\xe4'")


AT = r"object cabinet-0005, level 0, step 1\)(\n|$)"
WHERE = rf"\(line \d+, {AT}"
HOSTILE = {
    "exit": ("os._exit(0)", rf"its process ended \(exit status 0\): the policy ended it, .* \({AT}"),
    "kill": (
        "os.kill(os.getpid(), 9)",
        rf"its process ended \(killed by signal 9, Killed\): .* \({AT}",
    ),
    "system_exit": ("sys.exit('enough')", rf"act\(\) raised SystemExit: enough {WHERE}"),
    "ctrl_c": ("raise KeyboardInterrupt('mine')", rf"act\(\) raised KeyboardInterrupt: mine {WHERE}"),
    "base": ("raise BaseException('bare')", rf"act\(\) raised BaseException: bare {WHERE}"),
    "generator": ("raise GeneratorExit", rf"act\(\) raised GeneratorExit {WHERE}"),
    "recursion": ("self.act(observation)", rf"act\(\) raised RecursionError: .* {WHERE}"),
    "shape": ("return [0.0]", r"act\(\) returned shape \(1,\)"),
}


@WORKERS
@pytest.mark.parametrize("kind", HOSTILE)
def test_what_a_policy_does_to_its_process_is_told(
    solution: Callable[[str], Path], kind: str, workers: int
) -> None:
    text, says = HOSTILE[kind]
    path = solution(
        "import os, sys\nclass Policy:\n    obs_mode = 'state'\n"
        "    def reset(self, observation, info):\n        self.step = 0\n"
        "    def act(self, observation):\n        self.step += self.step < 2\n"
        f"        if self.step == 2:\n            {text}\n"
        "        return [0.0] * 13\n"
    )
    with pytest.raises(PolicyError, match=says) as caught:
        evaluate(TASK, path, OBJECTS, 1, config=SHORT, workers=workers)
    assert str(caught.value).startswith(str(path))


AT_IMPORT = {
    "exit": (
        "import os\nos._exit(3)",
        r": its process ended \(exit status 3\): the policy ended it",
    ),
    "ctrl_c": ("raise KeyboardInterrupt", r": cannot be imported: KeyboardInterrupt \(line 1\)(\n|$)"),
    "base": ("raise BaseException('bare')", r": cannot be imported: BaseException: bare \(line 1\)(\n|$)"),
    "hang": ("while True:\n    pass", r": not loaded within 0\.5 s$"),
    "deaf": (
        "import signal\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\nwhile True:\n    pass",
        r": not loaded within 0\.5 s$",
    ),
    "constructor": (
        "class Policy:\n    obs_mode = 'state'\n    def __init__(self):\n        while True:\n            pass",
        r": not loaded within 0\.5 s$",
    ),
}


@WORKERS
@pytest.mark.parametrize("kind", AT_IMPORT)
def test_what_happens_at_import_is_told(
    solution: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch, kind: str, workers: int
) -> None:
    monkeypatch.setattr(worker_module, "_GRACE_S", 0.2)
    text, says = AT_IMPORT[kind]
    path = solution(text + "\n")
    limit = {"load_timeout_s": 0.5} if "loaded within" in says else {}
    start = time.perf_counter()
    with pytest.raises(PolicyError, match=says) as caught:
        evaluate(TASK, path, OBJECTS, 1, config=SHORT, workers=workers, **limit)
    assert str(caught.value).startswith(str(path))
    assert time.perf_counter() - start < 120


def test_a_hang_at_import_may_come_later(solution: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """The first look at a solution is no promise."""
    monkeypatch.setattr(worker_module, "_GRACE_S", 0.2)
    path = solution("def policy(observation):\n    return [0.0] * 13\n")
    plan = plan_evaluation(TASK, path, OBJECTS[:1], 1, config=SHORT)
    plan = replace(plan, load_timeout_s=0.5)
    path.write_text("while True:\n    pass\n")
    with pytest.raises(PolicyError, match=r"not loaded within 0\.5 s$"):
        record_video(plan, path.with_suffix(".gif"))


@pytest.mark.parametrize("limit", [0, -1.0, float("inf"), "5", True])
def test_illegal_limits(limit: Any) -> None:
    with pytest.raises(ConfigError, match="time limit for loading a policy must be a positive number of seconds"):
        evaluate(TASK, "still", OBJECTS[:1], 1, load_timeout_s=limit)


def test_processes_of_a_policy_end_with_it(solution: Callable[[str], Path]) -> None:
    path = solution(
        "import subprocess, sys, pathlib\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        "with open(pathlib.Path(__file__).with_name('pids'), 'a') as file:\n    print(child.pid, file=file)\n"
        "def policy(observation):\n    return [0.0] * 13\n"
    )
    evaluate(TASK, path, OBJECTS[:2], 1, config=SHORT, workers=2, sandbox="none")
    pids = path.with_name("pids").read_text().split()
    assert len(pids) == 3, "one for the first look, one for each object"
    end = time.perf_counter() + 60
    while time.perf_counter() < end and any(Path("/proc", pid).exists() for pid in pids):
        time.sleep(0.05)
    left = [pid for pid in pids if Path("/proc", pid).exists()]
    assert all(") Z " in Path("/proc", pid, "stat").read_text() for pid in left)


def test_the_same_command_gives_the_same_report(solution: Callable[[str], Path], tmp_path: Path) -> None:
    """Also of a policy that draws before its first episode, and from what the order of a set says."""
    path = solution(
        "import random, numpy as np\n"
        "names = list({'a', 'b', 'c', 'd', 'e', 'f', 'g'})\nfirst = names.index('a')\n"
        "weights = np.random.uniform(-0.1, 0.1, 13) + random.uniform(0, 0.1)\nweights[first] = 1.0\n"
        "def policy(observation):\n    return weights\n"
    )
    reports = []
    for count in (1, 2):
        out = tmp_path / str(count)
        arguments = ["--policy", str(path), "--objects", *OBJECTS[:2], "--episodes", "1", "--out", str(out)]
        arguments += [
            "--workers",
            str(count),
            "--set",
            "initial.lift_m=0.3",
            "--set",
            "success.open_fraction=0.001",
        ]
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONHASHSEED"}
        command = [sys.executable, "-m", "artiskill", "evaluate", *arguments]
        subprocess.run(command, env=environment, check=True, capture_output=True, timeout=120)
        data = json.loads((out / "report.json").read_text())
        data.pop("timing")
        data.pop("sha256")
        reports.append((data, (out / "episodes.csv").read_text()))
    assert reports[0] == reports[1]
