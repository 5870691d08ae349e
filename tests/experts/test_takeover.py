"""Experts go on from any state: in the midst of what a poor student, or nobody in particular, has done."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

from artiskill.assets.catalog import list_objects

LEVELS = {"OpenCabinetDrawer": 2, "OpenCabinetDoor": 2, "PushChair": 5, "MoveBucket": 5}  # enough for a rate
LEAST = 0.95


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
@pytest.mark.parametrize("beginner", ["student", "noise"])
@pytest.mark.parametrize("task", LEVELS)
def test_an_expert_takes_over(tool: ModuleType, task: str, beginner: str) -> None:
    """Levels of every training target; docs/experts.md has more."""
    levels = range(LEVELS[task])
    played = list(tool.outcomes(task, list_objects(split="train", task=task), beginner, levels))
    played = [one for one in played if one.solved or not one.lost]
    failed = [(one.object, one.target, one.level) for one in played if not one.solved]
    assert len(failed) <= (1 - LEAST) * len(played), failed
