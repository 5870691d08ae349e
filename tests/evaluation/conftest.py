"""Policies as participants write them, and small evaluations."""

from collections.abc import Callable
from pathlib import Path

import pytest

FORWARD = """
import numpy as np

def policy(observation):
    action = np.zeros(13)
    action[0] = 1.0
    return action
"""


@pytest.fixture
def solution(tmp_path: Path) -> Callable[[str], Path]:
    """Writes a solution file."""

    def write(text: str) -> Path:
        path = tmp_path / "solution.py"
        path.write_text(text)
        return path

    return write
