"""docs/adding_a_task.md, followed: what it says, as it stands there, makes a task that passes the tests."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
COPIED = (
    "src",
    "tests",
    "docs",
    "tools",
    "examples",
    "benchmarks",
    "pyproject.toml",
    "README.md",
    "CHANGELOG.md",
    "Makefile",
)
Run = Callable[..., subprocess.CompletedProcess[str]]

EPISODE = """
import numpy as np
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.geometry.rotations import quat_from_rpy
from artiskill.scene.scene import build_scene
from artiskill.sim.simulation import Simulation
from artiskill.tasks.levels import RngStream, level_generator

env = ManipulationEnv("TurnChair", objects="train")
observation, info = env.reset(seed=0)
assert info["flags"] == {"chair_turned": False, "chair_static": False}
for action in np.random.default_rng(0).uniform(-1, 1, (10, env.control.size)):
    observation, reward, terminated, _, info = env.step(action)
    assert env.observation_space.contains(observation)
    assert -3 <= reward < -1
    assert not terminated
assert set(info["reward_terms"]) == {"turning", "slow", "stage"}

# the chair turned by hand: flags and stages follow
task, obj = env.task, env.simulation.scene.object
simulation = Simulation(build_scene(task.robot, obj, task.physics))
state = task.sample_initial_state(obj, level_generator(0, RngStream.INITIAL_STATE))
x, y = state.root_pose_w[:2]
state.root_pose_w[3:] = quat_from_rpy((0, 0, np.arctan2(y, x)))  # its -x points at the origin
simulation.reset([state])
snapshot = simulation.snapshot()
flags = task.flags(snapshot, env.goal)
assert bool(flags["chair_turned"][0]) and bool(flags["chair_static"][0])
assert float(task.reward_terms(snapshot, env.goal, flags)["stage"][0]) == -1.0
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Runs Python in a copy of the repository in which all that the page says has been done."""
    copy = tmp_path_factory.mktemp("repository")
    for name in COPIED:
        whole = ROOT / name
        (shutil.copytree if whole.is_dir() else shutil.copy2)(whole, copy / name)

    def python(*arguments: str) -> subprocess.CompletedProcess[str]:
        environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")}
        environment |= {"PYTHONPATH": str(copy / "src")}
        return subprocess.run(
            [sys.executable, *arguments], cwd=copy, env=environment, capture_output=True, text=True, check=False
        )

    follow((ROOT / "docs" / "adding_a_task.md").read_text(encoding="utf-8"), copy, python)
    return python


def follow(page: str, root: Path, python: Run) -> None:
    """Do what each block of the page says."""
    for language, block in re.findall(r"```(\w+)\n(.*?)```", page, re.DOTALL):
        if language == "sh":
            for command in block.splitlines():
                program, _, output = command.partition(" > ")
                done = python(*program.split()[1:])
                assert done.returncode == 0, done.stderr
                if output:
                    (root / output).write_text(done.stdout, encoding="utf-8")
            continue
        head, _, text = block.partition("\n")
        if found := re.fullmatch(r"# into (\w+) in (\S+)", head):
            insert(root / found[2], found[1], text)
        else:
            path = root / head.removeprefix("# ")
            before = path.read_text(encoding="utf-8") + "\n\n" if path.exists() else ""
            path.write_text(before + text, encoding="utf-8")


def insert(path: Path, name: str, line: str) -> None:
    """Put a line at the end of what a module-level name is bound to: behind the last line indented like it."""
    text = path.read_text(encoding="utf-8")
    start = re.search(rf"^{name}\b.*=", text, re.MULTILINE)
    assert start is not None
    end = text.index("\n\n", start.end())
    indent = line[: len(line) - len(line.lstrip())]
    *_, last = re.finditer(rf"^{indent}\S.*,\n", text[start.end() : end], re.MULTILINE)
    place = start.end() + last.end()
    path.write_text(text[:place] + line + text[place:], encoding="utf-8")


@pytest.mark.slow
def test_the_new_task_runs(run: Run) -> None:
    done = run("-c", EPISODE)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_new_task_passes_the_tests(run: Run) -> None:
    """The tests that know of tasks, the new one's contract among them, with its expert's test skipped."""
    done = run(
        *("-m", "pytest", "-q", "-p", "no:cacheprovider", "tests/contract", "-k", "TurnChair"),
    )
    assert done.returncode == 0, done.stdout
    assert "there is no expert for TurnChair" in done.stdout
    others = ("tests/tasks", "tests/tools", "tests/test_architecture.py::test_imports_point_one_way")
    done = run("-m", "pytest", "-q", "-p", "no:cacheprovider", *others)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_the_new_task_is_clean(run: Run) -> None:
    touched = [f"src/artiskill/{name}.py" for name in ("tasks/turn_chair", "tasks/registry", "assets/needs")]
    for command in (("ruff", "check", *touched), ("ruff", "format", "--check", *touched), ("mypy",)):
        pytest.importorskip(command[0], reason="a tool of the extra `dev`")
        done = run("-m", *command)
        assert done.returncode == 0, done.stdout
