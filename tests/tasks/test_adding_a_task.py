"""docs/adding_a_task.md, followed: what it says, as it stands there, makes a package with a task that works."""

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
Run = Callable[..., subprocess.CompletedProcess[str]]

EPISODE = """
import numpy as np
import turn_chair
from artiskill import ManipulationEnv
from artiskill.evaluation.recording import episode_caption
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

start, turn, end = episode_caption(env, done=True).split("  ·  ")
assert start == env.scene.object.id and end == "not solved"
assert turn.endswith(" degrees from its target") and 90 < float(turn.split()[0]) <= 180

# the chair turned by hand: flags and stages follow
task, obj = env.task, env.simulation.scene.object
simulation = Simulation(build_scene(task.robot, obj, task.physics))
state = task.sample_initial_state(obj, level_generator(0, RngStream.INITIAL_STATE))
x, y = state.root_pose_w[:2]
state.root_pose_w[3:] = quat_from_rpy((0, 0, np.arctan2(y, x)))  # its -x points at the origin
simulation.reset([state])
flags, terms = task.evaluate(simulation.snapshot(), env.goal)
assert bool(flags["chair_turned"][0]) and bool(flags["chair_static"][0])
assert float(terms["stage"][0]) == -1.0
"""
VARIANT = """
import numpy as np
import calm_chair
from artiskill import ManipulationEnv

plain, calm = (ManipulationEnv(task, objects="chair-0001") for task in ("PushChair", "CalmChair"))
for env in (plain, calm):
    env.reset(seed=0)
for action in np.random.default_rng(0).uniform(-1, 1, (10, calm.control.size)):
    reward, info = calm.step(action)[1::3]
    cost = info["reward_terms"]["fast_hands"]
    assert -1 <= cost < 0
    np.testing.assert_allclose(reward, plain.step(action)[1] + 0.3 * cost, rtol=1e-12)
"""
INSTALLED = """
import gymnasium as gym
import artiskill
from artiskill.tasks.registry import task_names
assert "TurnChair" in task_names()
gym.make("ArtiSkill/TurnChair-v0").reset(seed=0)
"""
CONTRACT = "import sys, pytest, turn_chair; sys.exit(pytest.main(sys.argv[1:]))"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Runs Python in a folder in which all that the page says has been done."""
    folder = tmp_path_factory.mktemp("package")

    def python(*arguments: str, cwd: Path = folder, path: Path = folder) -> subprocess.CompletedProcess[str]:
        environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")}
        environment |= {"PYTHONPATH": f"{path}{os.pathsep}{ROOT / 'src'}"}
        command = [sys.executable, *arguments]
        return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)

    follow((ROOT / "docs" / "adding_a_task.md").read_text(encoding="utf-8"), folder, python)
    return python


def follow(page: str, folder: Path, python: Run) -> None:
    """Do what each block of the page says."""
    for language, block in re.findall(r"```(\w+)\n(.*?)```", page, re.DOTALL):
        if language == "sh":
            for command in block.splitlines():
                program, *arguments = command.split()
                done = python(*(["-m", "artiskill"] if program == "artiskill" else []), *arguments)
                assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
            continue
        head, _, text = block.partition("\n")
        path = folder / head.removeprefix("# ")
        path.parent.mkdir(exist_ok=True)
        before = path.read_text(encoding="utf-8") + "\n\n" if path.exists() else ""
        path.write_text(before + text, encoding="utf-8")


@pytest.mark.slow
def test_the_new_task_runs(run: Run) -> None:
    done = run("-c", EPISODE)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_variant_adds_its_term(run: Run) -> None:
    done = run("-c", VARIANT)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_command_line_evaluated_its_expert(run: Run) -> None:
    done = run("-c", "print(open('results/report.md').read())")
    assert "TurnChair" in done.stdout, done.stderr


@pytest.mark.slow
def test_workers_collect_and_verify_its_demonstrations(run: Run) -> None:
    """Of a package that is not installed: each command is told where the task comes from."""
    easy = ("--set", "success.max_angle_rad=3.1", "success.max_angular_speed_rad_s=9", "episode_steps=40")
    objects = ("--objects", "chair-0001", "chair-0003", "--per-object", "2", "--plain")
    task = ("--task", "turn_chair:TurnChair", "--workers", "2")
    commands = (
        ("collect", "--out", "demos", *objects, *easy),
        ("verify", "demos"),
        ("replay", "demos", "--out", "training", "--obs-mode", "state"),
    )
    said = [run("-m", "artiskill", "demos", *command, *task) for command in commands]
    assert [done.returncode for done in said] == [0, 0, 0], said
    assert "4 of 4 trajectories bit-exact" in said[1].stdout
    done = run("-m", "artiskill", "demos", "verify", "demos")
    assert done.returncode == 1
    assert "on the command line, name it module:Task" in done.stdout


@pytest.mark.slow
def test_an_installed_package_is_found(run: Run, tmp_path: Path) -> None:
    """As pip installs it: its entry points beside it."""
    folder = Path(run("-c", "import os; print(os.getcwd())").stdout.strip())
    project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (tmp_path / "turn_chair").symlink_to(folder / "turn_chair")
    info = tmp_path / "turn_chair-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 0.1\n")
    points = "".join(
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in entries.items())
        for group, entries in project["entry-points"].items()
    )
    (info / "entry_points.txt").write_text(points)
    done = run("-c", INSTALLED, cwd=tmp_path, path=tmp_path)
    assert done.returncode == 0, done.stderr
    (tmp_path / "turn_chair").unlink()
    done = run("-c", "import artiskill", cwd=tmp_path, path=tmp_path)
    assert done.returncode == 0
    assert "the tasks of 'turn_chair' could not be registered: No module named 'turn_chair'" in done.stderr


@pytest.mark.slow
def test_the_new_task_keeps_the_contract(run: Run) -> None:
    mine = "TurnChair and chair-0001 and not expert_solves_it"  # the page's expert only drives up to the chair
    options = ("-q", "-p", "no:cacheprovider", "-m", "slow or not slow", "-k", mine)
    done = run("-c", CONTRACT, *options, str(ROOT / "tests" / "contract" / "test_contract.py"), cwd=ROOT)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_the_new_task_is_clean(run: Run) -> None:
    configuration = ("--config", str(ROOT / "pyproject.toml"))
    # imports are sorted as from outside, where this package is one among others
    for command in (
        ("ruff", "check", "--ignore", "I001", *configuration),
        ("ruff", "format", "--check", *configuration),
    ):
        pytest.importorskip(command[0], reason="a tool of the extra `dev`")
        done = run("-m", *command, "turn_chair")
        assert done.returncode == 0, done.stdout
    pytest.importorskip("mypy", reason="a tool of the extra `dev`")
    done = run("-m", "mypy", "--strict", "turn_chair")
    assert done.returncode == 0, done.stdout
