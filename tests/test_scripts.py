"""Scripts beside the package, which nothing else runs: what they import is there."""

import ast
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = sorted(path for folder in ("benchmarks", "examples", "tools") for path in (ROOT / folder).glob("*.py"))


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_what_a_script_takes_from_the_package_is_there(path: Path) -> None:
    imports = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)]
    for node in imports:
        if node.module is None or node.module.partition(".")[0] != "artiskill":
            continue
        try:
            module = import_module(node.module)
        except ImportError as error:
            if error.name is not None and error.name.partition(".")[0] != "artiskill":
                continue  # of an extra that is not installed
            raise
        for alias in node.names:
            name = f"{node.module}.{alias.name}"
            assert hasattr(module, alias.name) or find_spec(name) is not None, f"line {node.lineno}: {name}"
