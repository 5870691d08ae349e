"""What tests of `tools/` share: those are scripts, in no package."""

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from learning_tables.cells import Settings

LoadTool = Callable[[str], ModuleType]


@pytest.fixture
def load_tool(root: Path) -> LoadTool:
    """Load a script of `tools/` by its name, as a new module each time."""

    def load(name: str) -> ModuleType:
        spec = importlib.util.spec_from_file_location(f"{name}_under_test", root / "tools" / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load


@pytest.fixture
def settings() -> Settings:
    """Return small settings of the tables of docs/learning.md."""
    return Settings(
        drawer=("cabinet-0002", "link_0"),
        schedule={"10": 20, "30": 40},
        scale=0.5,
        samples=80,
        batch_size=8,
        episodes=5,
        per_object=3,
        train_objects=["cabinet-0002", "chair-0004"],
        test_objects=["test"],
        train_levels=2,
        test_levels=4,
        frame="world",
    )


STAND_IN = """#!{python}
import json, os, pathlib, sys
command = sys.argv[3:]
with open({log!r}, "a") as log:
    log.write(" ".join(command) + "\\n")
folder = pathlib.Path(command[command.index("--out") + 1])
folder.mkdir(parents=True, exist_ok=True)
if command[0] == os.environ.get("FAILS"):
    sys.exit(2)
if command[0] == "training-set":
    (folder / "manifest.json").write_text('{{"format": "artiskill-training-set"}}')
if command[0] == "train":
    (folder / "metrics.csv").write_text("step,seconds\\n10,30.0\\n")
if command[0] == "evaluate":
    row = {{"object": "one", "successes": 3, "episodes": 4}}
    (folder / "report.json").write_text(json.dumps({{"objects": [row], "timing": {{"seconds": 6.0}}}}))
"""


@pytest.fixture
def called(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], list[str]]:
    """Put a stand-in in the place of the command `artiskill`; return what tells its latest calls."""
    log, program = tmp_path / "log.txt", tmp_path / "python"
    program.write_text(STAND_IN.format(python=sys.executable, log=str(log)))
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))

    def read() -> list[str]:
        lines = log.read_text().splitlines() if log.exists() else []
        log.unlink(missing_ok=True)
        return lines

    return read
