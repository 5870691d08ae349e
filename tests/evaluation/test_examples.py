"""The examples run as they are printed."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

SMALL = {
    "03_evaluate_your_policy.py": ("--objects", "cabinet-0005", "--episodes", "1"),
    "04_train_ppo.py": ("--envs", "2", "--steps", "500", "--rollout", "100"),
    "05_train_ppo_many.py": (
        "--num-envs",
        "4",
        "--objects",
        "test",
        "--steps",
        "64",
        "--rollout",
        "8",
        "--out",
        "many",
    ),
}
SMALL["07_train_sac.py"] = ("--envs", "4", "--steps", "4400")
NEEDS = {"04_train_ppo.py": "stable_baselines3", "05_train_ppo_many.py": "stable_baselines3"}
NEEDS["07_train_sac.py"] = "torch"
SERVERS = ("policy_server.py",)  # run until they are stopped, see test_openpi.py
SAYS = {
    "01_first_steps.py": ("open link_", "reward "),
    "02_expert.py": ("approach", "pull", ": solved after"),
    "03_evaluate_your_policy.py": ("expert: 100% solved", "solution_example.py: 0% solved", "Sway: 0% solved"),
    "04_train_ppo.py": ("0% solved", "wrote policy.zip, scaling.pkl, episodes.csv, curve.png"),
    "05_train_ppo_many.py": ("4 environments, 10 objects", "saved many"),
    "06_demonstrations.py": ("12 demonstrations of", "solved: True, 1200 points"),
    "07_train_sac.py": ("% of 100 new levels solved",),
    "solution_example.py": (),
}


def test_all_examples_are_tried(root: Path) -> None:
    assert {path.name for path in (root / "examples").glob("*.py")} == {*SAYS, *SERVERS}


@pytest.mark.parametrize("name", SAYS)
def test_example(root: Path, tmp_path: Path, name: str) -> None:
    if name in NEEDS and find_spec(NEEDS[name]) is None:
        pytest.skip(f"needs {NEEDS[name]}")
    command = [sys.executable, "-W", "error", str(root / "examples" / name), *SMALL.get(name, ())]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert all(part in done.stdout for part in SAYS[name]), done.stdout
