"""docs/experts.md: its tables are made from demonstrations that hold."""

import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from artiskill.demos.collect import collect
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.plan import CollectionOptions, make_plan
from artiskill.demos.verify import VerifyResult


@pytest.fixture
def tool(load_tool: Callable[[str], ModuleType]) -> ModuleType:
    return load_tool("make_expert_docs")


def test_the_page_says_what_the_files_hold(
    tool: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page, folder = tmp_path / "experts.md", tmp_path / "drawers"
    page.write_text(f"before\n{tool.BEGIN}\nof old\n{tool.END}\nafter\n")
    collect(make_plan("OpenCabinetDrawer", ["cabinet-0002"], CollectionOptions(per_object=2)), folder)
    with DemoFile(folder / "cabinet-0002.h5") as file:
        first, second = sorted(len(trajectory) for trajectory in file)
        attempts = len(file.attempts)
    arguments = [str(folder), "--page", str(page)]
    assert tool.main(arguments) == 0
    text = re.sub(" +", " ", page.read_text())
    assert text.startswith(f"before\n{tool.BEGIN}\n")
    assert text.endswith(f"{tool.END}\nafter\n")
    assert "of old" not in text
    steps = f"{first} .. {(first + second) / 2:.0f} .. {second}"
    table = page.parent / tool.TABLE
    row = f"OpenCabinetDrawer,cabinet-0002,train,link_0 2/{attempts},{steps},2 of 2"
    assert table.read_text().splitlines()[1:] == [row]
    assert f"| OpenCabinetDrawer | train | 1 | 1 | {attempts} | {2 / attempts:.1%} |" in text
    assert tool.main(arguments) == 0
    assert re.sub(" +", " ", page.read_text()) == text

    result = VerifyResult("", "cabinet-0002", 2, 100, 1, ("one differs",))
    monkeypatch.setattr(tool, "verify", lambda *given, **options: [result])
    assert tool.main(arguments) == 1
    assert "| 1 of 2 |" in re.sub(" +", " ", page.read_text())
