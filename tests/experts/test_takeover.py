"""Experts go on from any state: in the midst of what a poor student, or nobody in particular, has done."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

from artiskill.assets.catalog import list_objects

LEVELS = {"OpenCabinetDrawer": 2, "OpenCabinetDoor": 2, "PushChair": 5, "MoveBucket": 5}  # enough for a rate
LEAST, LEAST_OF_ONE = 0.95, 0.90  # of both kinds of beginners, and of each: docs/experts.md has the rates


@pytest.fixture(scope="module")
def tool(root: Path) -> ModuleType:
    """`tools/measure_takeover.py`."""
    spec = importlib.util.spec_from_file_location("measure_takeover", root / "tools" / "measure_takeover.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
@pytest.mark.parametrize("task", LEVELS)
def test_an_expert_takes_over(tool: ModuleType, task: str) -> None:
    """Levels of every training target, after a poor student and after noise."""
    objects = list_objects(split="train", task=task)
    played = {
        beginner: [
            one
            for one in tool.outcomes(task, objects, beginner, range(LEVELS[task]))
            if one.solved or not one.lost
        ]
        for beginner in ("student", "noise")
    }
    for beginner, episodes in played.items():
        failed = [(one.object, one.target, one.level) for one in episodes if not one.solved]
        assert len(failed) <= (1 - LEAST_OF_ONE) * len(episodes), (beginner, failed)
    both = [one for episodes in played.values() for one in episodes]
    solved = sum(one.solved for one in both)
    assert solved >= LEAST * len(both), f"{solved} of {len(both)}"
