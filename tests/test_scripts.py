"""Scripts beside the package, which nothing else runs: what they import is there."""

import ast
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = sorted(path for folder in ("benchmarks", "examples", "tools") for path in (ROOT / folder).rglob("*.py"))


def is_there(module: str, name: str) -> bool:
    """Whether a module has something of a name; also if it needs an extra that is not installed."""
    try:
        if hasattr(import_module(module), name):
            return True
        import_module(f"{module}.{name}")
    except ImportError as error:
        return error.name is not None and error.name.partition(".")[0] != "artiskill"
    return True


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_what_a_script_takes_from_the_package_is_there(path: Path) -> None:
    imports = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)]
    missing = [
        f"line {node.lineno}: {node.module}.{alias.name}"
        for node in imports
        if node.module is not None and node.module.partition(".")[0] == "artiskill"
        for alias in node.names
        if not is_there(node.module, alias.name)
    ]
    assert not missing
