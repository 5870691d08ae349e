"""The page about vector environments runs as it is printed."""

import re
from pathlib import Path

import pytest


def test_examples_run(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = (root / "docs" / "vector.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    space: dict[str, object] = {}
    for block in blocks[:2]:  # the third needs an extra
        exec(block, space)
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("(64, 121) (64,) ['chair-")
    assert second == "(16, 1200, 3)"
